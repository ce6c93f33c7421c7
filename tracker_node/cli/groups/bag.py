"""``tracker_node bag``: what bags hold, whether they are sound, and what can be saved of damaged ones."""

from __future__ import annotations

import argparse
import sys
from datetime import UTC, datetime
from pathlib import Path

from ..arguments.verbs import Subverb, add_subverbs, run_subverb

SUMMARY = "look into bags: what is in one, whether it is sound, and a sound one of what can be read"
EXAMPLE = "tracker_node bag check out/run1"


def _add_check_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", type=Path, help="bag folder, or a .mcap or .db3 file")


def _run_check(args: argparse.Namespace) -> int:
    from ...loaders.bag.check import check_bag

    check = check_bag(args.bag, lambda file: print(f"reading {file}", file=sys.stderr, flush=True))
    print(f"{check.path}: {check.files} file(s), {check.size / 1e6:.1f} MB, {check.message_count} messages")
    if check.message_count:
        print(f"from {_time_text(check.start_ns)} on, {check.seconds:.3f} s")
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


def _add_info_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", type=Path, help="bag folder, or a .mcap or .db3 file")


def _run_info(args: argparse.Namespace) -> int:
    from ...loaders.bag.reader import BagReader

    with BagReader(args.bag) as reader:
        size = sum(file.stat().st_size for file in reader.files)
        print(f"{args.bag}: {len(reader.files)} file(s), {size / 1e6:.1f} MB, {reader.message_count} messages")
        if reader.message_count:
            print(f"from {_time_text(reader.start_ns)} on, {(reader.end_ns - reader.start_ns) * 1e-9:.3f} s")
        if reader.recovered:
            print(f"not finished: {reader.problem}")
        for topic in sorted(reader.topics.values(), key=lambda topic: topic.name):
            print(f"  {topic.name:40} {topic.message_count:8} {topic.type_name}")
    return 0


def _time_text(stamp_ns: int) -> str:
    """A time as people write it (UTC), or as seconds where no year comes out of it."""
    try:
        return f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError, OSError):
        return f"{stamp_ns * 1e-9:.3f} s"


def _add_repair_arguments(parser: argparse.ArgumentParser) -> None:
    from ...loaders.bag.mcap_writer import COMPRESSIONS

    parser.add_argument("bag", type=Path, help="bag folder, or a .mcap or .db3 file; it is left as it is")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="the new bag; must not exist")
    parser.add_argument("--compression", choices=tuple(COMPRESSIONS), default="none", help="of the new bag (default: none)")


def _run_repair(args: argparse.Namespace) -> int:
    from ...loaders.bag.check import repair_bag

    repair = repair_bag(args.bag, args.output, args.compression)
    print(f"{args.bag}: {repair.problem or 'nothing is wrong with it'}")
    print(f"{repair.count} messages copied to {args.output}")
    return 0


SUBVERBS = (
    Subverb(
        "check",
        "read all of a bag and say what is in it and what is wrong with it; exit status 1 if anything is",
        "tracker_node bag check out/run1",
        _add_check_arguments,
        _run_check,
    ),
    Subverb(
        "info",
        "list topics, types, numbers of messages and times of a bag, from its index",
        "tracker_node bag info out/run1",
        _add_info_arguments,
        _run_info,
    ),
    Subverb(
        "repair",
        "copy what can be read of an unfinished or damaged bag to a sound one (recorder killed, disk full, file cut off)",
        "tracker_node bag repair out/run1 --output out/run1_repaired",
        _add_repair_arguments,
        _run_repair,
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, SUBVERBS)


run = run_subverb
