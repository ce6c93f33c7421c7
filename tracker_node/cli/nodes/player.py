"""``tracker_node player``: a bag into topics."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SUMMARY = "publish the topics of a bag, with /clock"
EXAMPLE = "tracker_node player out/run1 --rate 0.5 --topics /tracker/state /tracker/pose"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", type=Path, help="bag folder or .mcap file; an unfinished one is played as far as it goes")
    parser.add_argument("--topics", nargs="+", default=[], metavar="NAME", help="only these topics")
    parser.add_argument("--exclude", nargs="+", default=[], metavar="NAME", help="but not these")
    parser.add_argument("--rate", type=float, default=1.0, help="speed (default 1)")
    parser.add_argument("--start", type=float, default=0.0, metavar="S", help="seconds to leave out at the beginning")
    parser.add_argument("--duration", type=float, metavar="S", help="seconds of the bag to play (default: to its end)")
    parser.add_argument("--loop", action="store_true", help="begin again at the end, for ever")
    parser.add_argument("--clock", type=float, default=100.0, metavar="HZ", help="rate of /clock, 0 for none (default 100)")
    parser.add_argument("--wait-for-subscribers", type=int, default=0, metavar="N", help="begin when every topic has N of them")
    parser.add_argument(
        "--wait-for-node", default="", metavar="NAME",
        help="begin when this node, such as tracker or /lab/tracker, subscribes to topics of the bag",
    )
    parser.add_argument("--reliable", action="store_true", help="offer reliably what was recorded as best effort, too")
    parser.add_argument("--paused", action="store_true", help="wait for the service ~/pause to let it go")


def run(args: argparse.Namespace) -> int:
    from ...loaders.bag.reader import BagReader
    from ...ros.bag.player import PlayerNode, PlayerOptions
    from ...ros.executor import ros_process, spin
    from ...ros.parameter_overrides import refuse_undeclared

    options = PlayerOptions(
        topics=_full_names(args.topics),
        exclude=_full_names(args.exclude),
        rate=args.rate,
        start_s=args.start,
        duration_s=args.duration,
        loop=args.loop,
        clock_hz=args.clock,
        wait_for_subscribers=args.wait_for_subscribers,
        wait_for_node=args.wait_for_node,
        reliable=args.reliable,
        paused=args.paused,
    )
    with BagReader(args.bag) as reader:
        if reader.recovered:
            print(f"player: {args.bag} is unfinished: {reader.problem}", file=sys.stderr)
        seconds = (reader.end_ns - reader.start_ns) * 1e-9
        with ros_process(args.ros_args) as stop:
            node = PlayerNode(reader, options)
            refuse_undeclared(node, args.ros_args)
            print(f"player: {reader.message_count} messages of {len(reader.topics)} topics, {seconds:.1f} s", flush=True)
            node.start()
            try:
                spin(node, stop, node.finished.is_set)
            finally:
                node.close()
                published, problem = sum(node.published.values()), node.problem
                node.destroy_node()
    print(f"player: {published} messages published")
    if problem:
        print(f"tracker_node player: error: {problem}", file=sys.stderr)
    return 1 if problem else 0


def _full_names(names: list[str]) -> tuple[str, ...]:
    return tuple("/" + name.lstrip("/") for name in names)
