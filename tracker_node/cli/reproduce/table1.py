"""``tracker_node reproduce table1``: the half-twisting somersault (Trewartha, Yeadon & Knight, Table 1 and Fig. 4)."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "track a somersault of 11 synthetic images and three cameras by color; errors beside the paper's Table 1"
EXAMPLE = "tracker_node reproduce table1 --output out/reproduce/table1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", default="out/reproduce/table1", metavar="DIR", help="folder of results (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="three small images: shows that it runs, the figures mean nothing")


def run(args: argparse.Namespace) -> int:
    from ...experiments.somersault.table1 import run_table1

    run_table1(Path(args.output), args.quick)
    return 0
