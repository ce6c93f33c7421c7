"""``tracker_node keypoints``: the detector of people as a ROS node."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments.cameras import add_topics_argument, tracker_name, with_topics

if TYPE_CHECKING:
    from ...observation.keypoints.blazepose import BlazePose

SUMMARY = "find people and their points in the images of ROS cameras, for a tracker with the modality keypoints"
EXAMPLE = "tracker_node keypoints --rig rig.yaml --rate 5"
READY = "keypoints: ready"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="FILE", help="rig.yaml: names of the cameras; lenses are not needed")
    parser.add_argument("--cameras", nargs="+", metavar="NAME", help="only these cameras of the rig")
    add_topics_argument(parser)
    parser.add_argument("--compressed", action="store_true", help="subscribe to <cam>/image_raw/compressed")
    parser.add_argument(
        "--weights",
        type=Path,
        metavar="FILE",
        help="of the network that finds points, such as pose_landmark_heavy.tflite (default: the full size, fetched once)",
    )
    parser.add_argument("--threads", type=_within(int, 1, 64), default=1, metavar="N", help="of the networks (default: 1)")
    parser.add_argument(
        "--niceness", type=_within(int, 0, 19), default=5, metavar="N", help="0 to 19: how far others go first (default: 5)"
    )
    parser.add_argument(
        "--rate", type=_within(float, 0, 1000), default=5.0, metavar="HZ",
        help="image sets a second at most (default: 5; 0: as many as possible)",
    )  # fmt: skip
    parser.add_argument("--lossless", action="store_true", help="look at every image set in order, for a lossless tracker")
    parser.add_argument(
        "--wait-for-subscribers", type=int, default=0, metavar="N", help="begin when the points of each camera have N of them"
    )
    parser.add_argument(
        "--tracker", nargs="*", metavar="NODE",
        help="whose crops say where to search: nodes, and NODE/BODY of one with several bodies (nothing: none; default: tracker, "
        "and none with --joining)",
    )
    parser.add_argument(
        "--joining", nargs="*", default=[], metavar="NODE/BODY",
        help="bodies of people who come and go: whole images are searched every 0.3 s, too, for who has come in",
    )  # fmt: skip
    parser.add_argument("--config", metavar="FILE", help="tracker parameters: how images are matched (default: built in)")


def _within(kind: type, least: int, most: int) -> Callable[[str], float]:
    def number(text: str) -> float:
        value = kind(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"expected {least} to {most}, got {text}")
        return value

    return number


def followed(args: argparse.Namespace) -> tuple[str, ...]:
    """Who is always there; a node that people join has no crops of its own, and would be waited for in vain."""
    usual = () if args.joining else ("tracker",)
    return usual if args.tracker is None else tuple(name for name in args.tracker if name)


def run(args: argparse.Namespace) -> int:
    from ...loaders.fetched_files import detector_name, usable_weights
    from ...loaders.rig.rig_yaml import load_rig
    from ...ros.executor import attach, ros_process, spin
    from ...ros.keypoints.node import KeypointsNode, KeypointsOptions
    from ...ros.parameter_overrides import refuse_undeclared
    from ...runs.config_file import load_config
    from ...tracking.config import TrackerConfig

    rig = load_rig(args.rig)
    config = load_config(args.config, tracker_name(args.ros_args, renamed=False)) if args.config else TrackerConfig()
    files = usable_weights(args.weights)

    def make() -> BlazePose:
        from ...observation.keypoints.blazepose import BlazePose

        return BlazePose(files, args.threads)

    used = rig.subset(args.cameras) if args.cameras else rig
    options = KeypointsOptions(
        cameras={camera.name: camera.frame_id for camera in used},
        make_detector=make,
        name=detector_name(args.weights),
        synchronizer=config.synchronizer,
        trackers=followed(args),
        joining=tuple(args.joining),
        compressed=args.compressed,
        rate_hz=args.rate,
        lossless=args.lossless,
        wait_for_subscribers=args.wait_for_subscribers,
        niceness=args.niceness,
    )
    with ros_process(with_topics(args.ros_args, rig, dict(args.topics))) as stop:
        node = KeypointsNode(options)
        attach(node)
        try:
            refuse_undeclared(node, args.ros_args)
            spin(node, stop, node.worker.ready.is_set)
            if node.fatal is None and not stop.is_set():
                print(f"{READY}, {options.name}, {len(options.cameras)} cameras", flush=True)
                spin(node, stop)
            failure = node.fatal
        finally:
            node.close()
            node.destroy_node()
    if failure is not None:
        first = (str(failure).splitlines() or [type(failure).__name__])[0]
        print(f"tracker_node keypoints: error: the networks cannot be loaded: {first}", file=sys.stderr)
    return 0 if failure is None else 2
