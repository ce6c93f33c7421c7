"""``tracker_node bag repair``: finish what a killed recorder left."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "copy what can be read of an unfinished or damaged bag to a sound one (recorder killed, disk full, file cut off)"
EXAMPLE = "tracker_node bag repair out/run1 --output out/run1_repaired"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ...loaders.bag.mcap_writer import COMPRESSIONS

    parser.add_argument("bag", type=Path, help="bag folder, or a .mcap or .db3 file; it is left as it is")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="the new bag; must not exist")
    parser.add_argument("--compression", choices=tuple(COMPRESSIONS), default="none", help="of the new bag (default: none)")


def run(args: argparse.Namespace) -> int:
    from ...loaders.bag.check import repair_bag

    repair = repair_bag(args.bag, args.output, args.compression)
    print(f"{args.bag}: {repair.problem or 'nothing is wrong with it'}")
    print(f"{repair.count} messages copied to {args.output}")
    return 0
