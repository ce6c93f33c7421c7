"""``tracker_node recover_bag``: finish what a killed recorder left."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "make a finished bag of an unfinished one (recorder killed, disk full, file cut off)"
EXAMPLE = "tracker_node recover_bag out/run1 --output out/run1_recovered"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", type=Path, help="bag folder or .mcap file; it is left as it is")
    parser.add_argument("--output", type=Path, required=True, metavar="FOLDER", help="the new bag; must not exist")


def run(args: argparse.Namespace) -> int:
    from ..loaders.bag_recovery import recover_bag

    count, problem = recover_bag(args.bag, args.output)
    print(f"{args.bag}: {problem or 'is a finished bag'}")
    print(f"{count} messages copied to {args.output}")
    return 0
