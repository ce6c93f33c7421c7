"""``tracker_node demo``: a real recording from the package index to a report, in one command."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

from .arguments.verbs import run_verb

SUMMARY = "track a real recording of a person from end to end (fetch, ingest, track, record, evaluate) and report"
EXAMPLE = "tracker_node demo --output out/demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", default="out/demo", metavar="DIR", help="folder to write (default: %(default)s)")
    again = "make rig, backgrounds and body anew, even where they are there already"
    parser.add_argument("--fresh", action="store_true", help=again)


def run(args: argparse.Namespace) -> int:
    folder = Path(args.output)
    began = time.monotonic()
    for number, (title, stage) in enumerate((("The recording", _recording), ("Tracking and evaluation", _track)), 1):
        print(f"\n== {number} of 2: {title} ({time.monotonic() - began:.0f} s)", flush=True)
        status = stage(folder, args.fresh)
        if status != 0:
            print(f"tracker_node demo: stopped at '{title}' with status {status}", file=sys.stderr)
            return status
    print(f"\nDone in {time.monotonic() - began:.0f} s.")
    print(f"  {folder / 'report.html'}: open it in a browser; {folder / 'report.pdf'}: the same for print")
    print(f"  {folder / 'report.json'}: the metrics")
    print(f"  {folder / 'bag'}: for ros2 bag, PlotJuggler or Foxglove")
    return 0


def _recording(folder: Path, fresh: bool) -> int:
    from .sample import prepare

    return prepare(folder / "sample", fresh)


def _track(folder: Path, fresh: bool) -> int:

    print("On its first start the tracker compiles its inner loops, which takes minutes")
    if not (folder / "states.csv").exists():  # of an offline run, over which nothing is written
        _remove_earlier(folder)
    return run_verb("pipeline", folder / "sample" / "recording.yaml", "--output", folder)


def _remove_earlier(folder: Path) -> None:
    """Bag and ``run.json`` of an earlier demo."""
    bag = folder / "bag"
    if (bag / "metadata.yaml").exists() or (bag.is_dir() and list(bag.glob("*.mcap"))):
        shutil.rmtree(bag)
    (folder / "run.json").unlink(missing_ok=True)
