"""``tracker_node bag check``: whether a bag is sound."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SUMMARY = "read all of a bag and say what is in it and what is wrong with it; exit status 1 if anything is"
EXAMPLE = "tracker_node bag check out/run1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", type=Path, help="bag folder, or a .mcap or .db3 file")


def run(args: argparse.Namespace) -> int:
    from ...loaders.bag.check import check_bag
    from .info import time_text

    check = check_bag(args.bag, lambda file: print(f"reading {file}", file=sys.stderr, flush=True))
    print(f"{check.path}: {check.files} file(s), {check.size / 1e6:.1f} MB, {check.message_count} messages")
    if check.message_count:
        print(f"from {time_text(check.start_ns)} on, {check.seconds:.3f} s")
        print(f"  {'topic':40} {'messages':>8} {'Hz':>8} {'longest gap':>12}  type")
    for each in check.topics:
        figures = f"{each.count:8} {each.rate_hz:8.2f} {each.longest_s:10.3f} s"
        print(f"  {each.topic.name:40} {figures}  {each.topic.type_name}")
    for note in check.notes:
        print(f"note: {note}")
    for problem in check.problems:
        print(f"problem: {problem}")
    print("Sound." if check.sound else f"Not sound. {check.advice}")
    return 0 if check.sound else 1
