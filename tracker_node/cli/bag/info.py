"""``tracker_node bag info``: what a bag says of itself."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

SUMMARY = "list topics, types, numbers of messages and times of a bag, from its index"
EXAMPLE = "tracker_node bag info out/run1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", type=Path, help="bag folder, or a .mcap or .db3 file")


def run(args: argparse.Namespace) -> int:
    from ...loaders.bag.reader import BagReader

    with BagReader(args.bag) as reader:
        size = sum(file.stat().st_size for file in reader.files)
        print(f"{args.bag}: {len(reader.files)} file(s), {size / 1e6:.1f} MB, {reader.message_count} messages")
        if reader.message_count:
            print(f"from {time_text(reader.start_ns)} on, {(reader.end_ns - reader.start_ns) * 1e-9:.3f} s")
        if reader.recovered:
            print(f"not finished: {reader.problem}")
        for topic in sorted(reader.topics.values(), key=lambda topic: topic.name):
            print(f"  {topic.name:40} {topic.message_count:8} {topic.type_name}")
    return 0


def time_text(stamp_ns: int) -> str:
    """A time as people write it (UTC), or as seconds where no year comes out of it."""
    try:
        return f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError, OSError):
        return f"{stamp_ns * 1e-9:.3f} s"
