"""``tracker_node rectify``: images without distortion, for other programs."""

from __future__ import annotations

import argparse

SUMMARY = "publish <camera>/image_rect, images without distortion, for other programs (the tracker needs none)"
EXAMPLE = "tracker_node rectify --cameras cam01 cam02"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--cameras", nargs="+", required=True, metavar="NAME", help="cameras, as their topics are named")


def run(args: argparse.Namespace) -> int:
    from ...errors import TrackerError
    from ...loaders.source_address import TOPIC_NAME
    from ...ros.executor import ros_process, spin
    from ...ros.ingest.rectify_node import RectifyNode
    from ...ros.parameter_overrides import refuse_undeclared

    for name in args.cameras:
        if not TOPIC_NAME.fullmatch(name):
            raise TrackerError(f"camera '{name}': expected a-z, A-Z, 0-9 and _, as its topics have this name")
    with ros_process(args.ros_args) as stop:
        node = RectifyNode(args.cameras)
        refuse_undeclared(node, args.ros_args)
        print(f"rectify: ready, {len(node.rectifiers)} cameras", flush=True)
        spin(node, stop)
        node.destroy_node()
    return 0
