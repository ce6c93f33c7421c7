"""``tracker_node sample <name>``: fetch a recording for a first run and make it ready to be tracked."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from shlex import quote

from .arguments.verbs import run_verb

SUMMARY = "fetch a sample recording (real videos, calibration, reference) and make it ready to be tracked"
EXAMPLE = "tracker_node sample balancing --output out/balancing"
POINTS, TOGETHER, RECORDING = "tracker_points.yaml", "tracker_together.yaml", "recording.yaml"
DESCRIBED = {
    "balancing.yaml": "tracker.yaml",
    "balancing_points.yaml": POINTS,
    "balancing_together.yaml": TOGETHER,
    "balancing_recording.yaml": RECORDING,
}
"""Files of this package's ``config`` -> what they are called beside the clip."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "name", choices=("balancing",), help="balancing: a man balances on a treadmill; four cameras, 100 images each, 60 Hz"
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="folder to write (default: the sample's name)")
    parser.add_argument("--fresh", action="store_true", help="make everything anew, even what is there already")


def run(args: argparse.Namespace) -> int:
    folder = Path(args.output or args.name)
    status = prepare(folder, args.fresh)
    if status == 0:
        print(f"{folder} is ready. Track it, and see how well, with one of")
        recording = quote(f"{folder}/recording.yaml")
        print(f"  tracker_node pipeline {recording}         as a ROS graph")
        print(f"  tracker_node track {recording}    without ROS")
    return status


def prepare(folder: Path, fresh: bool = False) -> int:
    """Fetch and prepare the Balancing clip, and print each step; existing files are kept.

    Parameters
    ----------
    folder : of the clip.
    fresh : make everything again.

    Returns
    -------
    status : exit status of the calibrations.
    """
    from ..calibration import balancing
    from ..loaders.fetched_files import fetch_sample

    print("Balancing clip (Pose2Sim, BSD 3-Clause), from wheels on the package index; kept in the cache", flush=True)
    balancing.copy_files(fetch_sample("balancing"), folder)
    if fresh or not (folder / "rig_refined.yaml").exists():
        print("Refining the places of the cameras on the 2D joints", flush=True)
        print(balancing.write_rigs(folder).table())
    if fresh or not balancing.has_backgrounds(folder):
        print("Making images of the background from the videos and the stills", flush=True)
        balancing.write_backgrounds(folder)
    person, state = folder / "person.yaml", folder / "initial_state.yaml"
    status, force = 0, ("--force",) if fresh else ()
    if fresh or not person.exists():
        status = run_verb("calibrate", "body", "--trc", folder / "static.trc", "-o", person, *force)
    if status == 0 and (fresh or not state.exists()):
        arguments = ("--model", person, "--trc", folder / "truth.trc", "--row", "0", "-o", state)
        status = run_verb("calibrate", "pose", *arguments, *force)
    _describe(folder, fresh)
    return status


def _describe(folder: Path, fresh: bool) -> None:
    """Write recording.yaml and what it names of the package's files, unless they are there."""
    from ..calibration import balancing
    from ..loaders.fetched_files import data_file

    if fresh or not (folder / "masks.json").exists():
        balancing.write_masks(folder, data_file("config/balancing_masks.json"))
    for name, target in DESCRIBED.items():
        if fresh or not (folder / target).exists():
            shutil.copyfile(data_file(f"config/{name}"), folder / target)
