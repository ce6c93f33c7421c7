"""``tracker_node reproduce cross``: a wooden cross in interlaced video (Trewartha, Yeadon & Knight, Figs 3 and 7 to 10)."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "film a thrown wooden cross as interlaced video, track it by color, and hold it against truth and digitizing"
EXAMPLE = "tracker_node reproduce cross --output out/reproduce/cross"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", default="out/reproduce/cross", metavar="DIR", help="folder of results (%(default)s)")
    parser.add_argument("--seed", type=int, default=20, help="of noise, background, lights and control points (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="three fields of each throw, two ways to track: a first look")


def run(args: argparse.Namespace) -> int:
    from ...experiments.cross.experiment import run_cross

    run_cross(Path(args.output), args.seed, args.quick)
    return 0
