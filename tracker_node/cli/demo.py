"""``tracker_node demo``: a real recording from the package index to a report, in one command."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

SUMMARY = "track a real recording of a person from end to end (fetch, ingest, track, record, evaluate) and report"
EXAMPLE = "tracker_node demo --out out/demo"
SIZE = "544x960"
N_IMAGE_SETS = 100
CONFIG = "config/balancing.yaml"
MASKS = "config/balancing_masks.json"
TARGETS = ("lost_sets<=0", "mpjpe_mm<=60", "mpjpe_offset_free_mm<=40", "iou_cam03>=0.8", "iou_cam04>=0.8")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", default="out/demo", metavar="DIR", help="folder to write (default: %(default)s)")
    parser.add_argument("--fresh", action="store_true", help="make rig, plates and body anew, even where they are there already")


def run(args: argparse.Namespace) -> int:
    folder = Path(args.out)
    began = time.monotonic()
    for number, (title, stage) in enumerate((("The recording", _recording), ("Tracking", _track), ("Evaluation", _evaluate)), 1):
        print(f"\n== {number} of 3: {title} ({time.monotonic() - began:.0f} s)", flush=True)
        status = stage(folder, args.fresh)
        if status != 0:
            print(f"tracker_node demo: stopped at '{title}' with status {status}", file=sys.stderr)
            return status
    print(f"\nDone in {time.monotonic() - began:.0f} s.")
    print(f"  {folder / 'report.html'}: open it in a browser")
    print(f"  {folder / 'report.json'}: the figures")
    print(f"  {folder / 'bag'}: for ros2 bag, PlotJuggler or Foxglove")
    return 0


def _recording(folder: Path, fresh: bool) -> int:
    from .sample import prepare

    return prepare(folder / "sample", fresh)


def _track(folder: Path, fresh: bool) -> int:
    from .sample import run_verb

    bag, sample = folder / "bag", folder / "sample"
    print("On its first start the tracker compiles its inner loops: up to a minute without a word")
    if (bag / "metadata.yaml").exists() or (bag.is_dir() and list(bag.glob("*.mcap"))):
        shutil.rmtree(bag)  # of an earlier demo
    arguments: list[str | Path] = ["--rig", sample / "rig_refined.yaml", "--model", sample / "person.yaml"]
    arguments += ["--initial-state", sample / "initial_state.yaml", *_config()]
    # At half size the defaults in pixels fit the body, and two cores keep up
    return run_verb("pipeline", *arguments, "--resize", SIZE, "--bag", bag, "--masks")


def _evaluate(folder: Path, fresh: bool) -> int:
    from .sample import run_verb

    sample = folder / "sample"
    arguments: list[str | Path] = [
        "--truth",
        sample / "truth.trc",
        "--model",
        sample / "person.yaml",
        "--rig",
        sample / "rig_refined.yaml",
    ]
    arguments += ["--name", "balancing", "--image-sets", str(N_IMAGE_SETS), *_masks(sample), "--output", folder]
    for target in TARGETS:
        arguments += ["--target", target]
    return run_verb("evaluate", folder / "bag", *arguments)


def _config() -> list[str | Path]:
    from ..loaders.data_files import data_file

    return ["--config", data_file(CONFIG)]


def _masks(sample: Path) -> list[str | Path]:
    """Reference masks: from the stills, and those drawn by hand that come with the package."""
    from ..calibration.balancing import write_masks
    from ..errors import SourceError
    from ..loaders.data_files import data_file

    try:
        drawn = data_file(MASKS)
    except SourceError:  # figures of two cameras are better than none
        drawn = None
    return ["--masks", write_masks(sample, drawn)]
