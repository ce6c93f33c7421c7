"""``tracker_node recorder``: topics into a bag."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import threading
import time
from pathlib import Path

SUMMARY = "record topics to a rosbag2 bag (MCAP) that ros2 bag, Foxglove and PlotJuggler open"
EXAMPLE = "tracker_node recorder --output out/run1 --regex '/(cam0[1-4]|tracker)/.*' --images none"

READY = "recorder: ready"
"""Start of the line on stdout that says that messages are recorded from now on."""
QUIET_S = 0.3  # after a signal, messages on their way are still taken until there was none for this long
DRAIN_S, HURRIED_DRAIN_S = 5.0, 0.4  # and no longer than this
MB = 2**20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="the bag; must not exist")
    what = parser.add_argument_group("what is recorded (at least one)")
    what.add_argument(
        "--topics",
        nargs="+",
        default=[],
        metavar="NAME[:TYPE]",
        help="topics; with a type (/tracker/state:tracker_msgs/msg/TrackedState) nothing is missed when they appear",
    )
    what.add_argument("--all", action="store_true", help="every topic that is not hidden")
    what.add_argument("--namespace", nargs="+", default=[], metavar="NS", help="every topic below these names")
    what.add_argument("--regex", nargs="+", default=[], metavar="RE", help="every topic whose whole name matches")
    parser.add_argument("--exclude", nargs="+", default=[], metavar="RE", help="but not those whose whole name matches")
    parser.add_argument(
        "--images",
        choices=("all", "raw", "compressed", "none"),
        default="all",
        help="which image topics to take among those asked for (default: all)",
    )
    _add_file_arguments(parser.add_argument_group("how it is written"))


def _add_file_arguments(how) -> None:
    from ...loaders.bag.mcap_writer import COMPRESSIONS

    how.add_argument("--split-mb", type=float, default=0.0, metavar="MB", help="begin another file at this size (default: never)")
    how.add_argument(
        "--split-s", type=float, default=0.0, metavar="S", help="begin another file after this time (default: never)"
    )
    how.add_argument("--compression", choices=tuple(COMPRESSIONS), default="none", help="of the messages (default: none)")
    how.add_argument(
        "--flush-s", type=float, default=0.5, metavar="S", help="what is older than this survives a kill -9 (default: 0.5)"
    )
    how.add_argument("--sync", action="store_true", help="write through to the disk each time, to survive a power failure too")
    how.add_argument(
        "--min-free-mb", type=int, default=200, metavar="MB", help="stop when the disk has less room than this (default: 200)"
    )
    how.add_argument(
        "--queue-mb", type=int, default=512, metavar="MB", help="memory for messages that wait for the disk (default: 512)"
    )


def run(args: argparse.Namespace) -> int:
    from ...errors import TrackerError
    from ...ros.bag.recorder import RecorderNode
    from ...ros.executor import finished_bag, ros_process, spin
    from ...ros.parameter_overrides import refuse_undeclared
    from ...ros.tracker.heap import keep_freed_memory

    selection = _selection_of(args)
    keep_freed_memory()
    bag = _open_bag(args)
    with finished_bag(bag):
        problem, lost, problems, topics = "", {}, {}, {}
        try:
            with ros_process(args.ros_args) as stop:
                node = RecorderNode(selection, bag)
                refuse_undeclared(node, args.ros_args)
                print(f"{READY}, {len(node.topics)} topics so far, writing to {args.output}", flush=True)
                spin(node, stop, lambda: bool(node.bag_problem))
                node.report()
                ended_s = time.monotonic()
                spin(node, threading.Event(), lambda: _quiet(node, ended_s))
                lost, problems, topics = dict(node.lost), dict(node.problems), node.topics
                node.destroy_node()
        finally:
            try:
                bag.close()
            except TrackerError as error:
                problem = str(error)
    if problem:
        print(f"tracker_node recorder: error: {problem}", file=sys.stderr)
    _report(bag, topics, lost, problems)
    return 1 if problem else 0


def _open_bag(args: argparse.Namespace):
    from ...errors import TrackerError
    from ...loaders.bag.queue import BagQueue
    from ...loaders.bag.writer import BagWriter

    for name in ("split_mb", "split_s", "min_free_mb"):
        if not 0 <= getattr(args, name) < float("inf"):
            raise TrackerError(f"--{name.replace('_', '-')}: expected 0 or more, got {getattr(args, name)}")
    for name in ("flush_s", "queue_mb"):
        if not 0 < getattr(args, name) < float("inf"):
            raise TrackerError(f"--{name.replace('_', '-')}: expected a positive number, got {getattr(args, name)}")
    min_free_bytes = args.min_free_mb * MB
    _check_room(args.output, min_free_bytes)
    writer = BagWriter(
        args.output,
        split_bytes=round(args.split_mb * MB),
        split_ns=round(args.split_s * 1e9),
        compression=args.compression,
        repeat_latched=True,
    )
    return BagQueue(writer, args.queue_mb * MB, flush_s=args.flush_s, min_free_bytes=min_free_bytes, to_disk=args.sync)


def _check_room(output: Path, min_free_bytes: int) -> None:
    from ...errors import TrackerError

    place = next((folder for folder in output.absolute().parents if folder.is_dir()), Path("/"))
    free = shutil.disk_usage(place).free
    if free < min_free_bytes:
        raise TrackerError(f"{place}: --min-free-mb asks for {min_free_bytes // MB} MB of free room, there are {free // MB}")


def _selection_of(args: argparse.Namespace):
    """`TopicSelection` of the command line.

    Raises
    ------
    TrackerError : nothing is asked for, or a name or a regular expression is wrong.
    """
    from ...errors import TrackerError
    from ...ros.bag.recorder import TopicSelection, is_topic_name

    patterns = [_compiled(text) for text in args.regex]
    patterns += [re.compile(rf"{re.escape('/' + name.strip('/'))}/.+") for name in args.namespace]
    if args.all:
        patterns.append(re.compile(r".*"))
    names = {}
    for text in args.topics:
        name, _, type_name = text.partition(":")
        names["/" + name.lstrip("/")] = type_name or None
    for name in names:
        if not is_topic_name(name):
            raise TrackerError(f"--topics: expected names of topics, got '{name}'")
    if not names and not patterns:
        raise TrackerError("nothing to record: give --topics, --namespace, --regex or --all")
    return TopicSelection(names, tuple(patterns), tuple(_compiled(text) for text in args.exclude), args.images)


def _compiled(text: str) -> re.Pattern[str]:
    from ...errors import TrackerError

    try:
        return re.compile(text)
    except re.error as error:
        raise TrackerError(f"regular expression '{text}': {error}") from None


def _quiet(node, ended_s: float) -> bool:
    from ...ros.ending import hurried

    now_s = time.monotonic()
    drain_s = QUIET_S if node.bag_problem else HURRIED_DRAIN_S if hurried() else DRAIN_S
    return now_s - max(node.last_message_s, ended_s) > QUIET_S or now_s - ended_s > drain_s


def _report(bag, topics: dict[str, str], lost: dict[str, int], problems: dict[str, str]) -> None:
    total = sum(bag.written.values())
    print(f"recorder: {total} messages of {len(bag.written)} topics in {bag.path}")
    silent = sorted(set(topics) - set(bag.written))
    if silent:
        print(f"recorder: no message on {', '.join(silent)}")
    for topic, problem in sorted(problems.items()):
        print(f"recorder: {topic} was not recorded: {problem}", file=sys.stderr)
    for what, counts in (("lost on their way", lost), ("dropped because they could not be written", bag.dropped)):
        for topic, count in sorted(counts.items()):
            if count:
                print(f"recorder: {topic}: {count} messages {what}", file=sys.stderr)
