"""``tracker_node reproduce convergence``: how wide the score's valley is (Trewartha, Yeadon & Knight, Figs 5 and 6)."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "score against each variable around the truth, widths of its valley, and from how far each optimizer finds back"
EXAMPLE = "tracker_node reproduce convergence --output out/reproduce/convergence"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", default="out/reproduce/convergence", metavar="DIR", help="folder of the results (default: %(default)s)")
    add("--trials", type=int, default=44, metavar="N", help="starts for each size of the start's error (default: %(default)s)")
    add("--quick", action="store_true", help="few small images and starts: shows that it runs, the figures mean nothing")


def run(args: argparse.Namespace) -> int:
    from ...errors import FileFormatError
    from ...experiments.somersault.convergence import run_convergence

    if args.trials < 1:
        raise FileFormatError("command line", "--trials", "at least 1", args.trials)
    run_convergence(Path(args.output), args.trials, args.quick)
    return 0
