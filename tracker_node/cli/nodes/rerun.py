"""``tracker_node rerun``: runs as a file of Rerun's viewer."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "write runs as a file of Rerun's viewer: bodies, cameras, images with outlines, curves"
EXAMPLE = "tracker_node rerun out/run --output run.rrd"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("runs", nargs="+", type=Path, metavar="RUN", help="run folder, folder with the runs of several bodies, or bag")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="file to write, such as run.rrd")
    add("--rig", metavar="FILE", help="cameras; default: what run.json names")
    add("--model", nargs="+", default=[], metavar="FILE", help="one for all bodies, or one each; default: what run.json names")
    add("--bodies", type=Path, metavar="RECORDING", help="recording.yaml of the bodies in a bag; default: what run.json names")
    add("--no-images", action="store_true", help="leave the images out")
    add("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...watch.playback import PlaybackFiles, write_rerun_file

    refuse_to_overwrite(args, args.output)
    files = PlaybackFiles(args.runs, args.model, args.rig, args.bodies, not args.no_images)
    counts = write_rerun_file(files, args.output, lambda text: print(f"rerun: {text}", file=sys.stderr))
    n_images = counts.pop("images")
    sets = ", ".join(f"{n} image set{'s' * (n != 1)} of {name}" for name, n in counts.items())
    print(f"wrote {args.output}: {sets}, {n_images} images")
    return 0
