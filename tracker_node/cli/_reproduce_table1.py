"""``tracker_node reproduce table1``: the half-twisting somersault (Trewartha, Yeadon & Knight, Table 1 and Fig. 4)."""

from __future__ import annotations

import argparse

SUMMARY = "track a somersault of 11 synthetic images and three cameras by color; errors beside the paper's Table 1"
EXAMPLE = "tracker_node reproduce table1 --output out/reproduce/table1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--output", default="out/reproduce/table1", metavar="DIR", help="folder of the results (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="few small images: shows that it runs, the figures mean nothing")


def run(args: argparse.Namespace) -> int:
    from ..errors import TrackerError

    raise TrackerError("this experiment is not in this version")
