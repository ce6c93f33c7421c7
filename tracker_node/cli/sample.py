"""``tracker_node sample <name>``: fetch a recording for a first run and make it ready to be tracked."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "fetch a sample recording (real videos, calibration, reference) and make it ready to be tracked"
EXAMPLE = "tracker_node sample balancing --output out/balancing"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", choices=("balancing",), help="balancing: a man balances on a treadmill; four cameras, 100 images each, 60 Hz")
    parser.add_argument("--output", metavar="DIR", help="folder to write (default: the sample's name)")
    parser.add_argument("--fresh", action="store_true", help="make everything anew, even what is there already")


def run(args: argparse.Namespace) -> int:
    folder = Path(args.output or args.name)
    prepare(folder, args.fresh)
    print(f"{folder} is ready. Track it with")
    print(
        f"  tracker_node track_offline --rig {folder}/rig_refined.yaml --model {folder}/person.yaml"
        f" --initial-state {folder}/initial_state.yaml --output out/{args.name}"
    )
    return 0


def prepare(folder: Path, fresh: bool = False) -> None:
    """Fetch and prepare the Balancing clip in ``folder``, saying what happens; what is there already is kept."""
    from ..calibration import balancing
    from ..loaders.sample_data import fetch_sample
    from ._calibrate_refine import print_table
    from ._progress import ByteProgress

    print("Balancing clip (Pose2Sim, BSD 3-Clause), from wheels on the package index; kept in the cache")
    balancing.copy_files(fetch_sample("balancing", ByteProgress()), folder)
    if fresh or not (folder / "rig_refined.yaml").exists():
        print("Refining the places of the cameras on the 2D joints")
        print_table(balancing.write_rigs(folder))
    if fresh or not balancing.has_plates(folder):
        print("Making pictures of the empty scene from the videos and the stills", flush=True)
        balancing.write_plates(folder)
    if fresh or not (folder / "initial_state.yaml").exists():
        print("Scaling the body to the static trial, posing it by the first row of the reference", flush=True)
        balancing.write_person(folder)
