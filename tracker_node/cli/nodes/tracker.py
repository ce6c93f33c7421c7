"""``tracker_node tracker``: the tracker as a ROS node."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments.cameras import add_topics_argument, tracker_name, with_topics

if TYPE_CHECKING:
    from threading import Event

    from ...camera.rig import CameraRig
    from ...loaders.recording_yaml import RecordingFile
    from ...ros.tracker.image_inbox import InboxOptions
    from ...ros.tracker.node import TrackerNode
    from ...ros.tracker.setup import BodyOptions, TrackerOptions
    from ...tracking.together.joining import JoiningOptions

SUMMARY = "track a body in the images of ROS cameras"
EXAMPLE = "tracker_node tracker --rig rig.yaml --model person.yaml --initial-state start.yaml"
SETTLE_S = 0.3  # between our discovery of a subscriber and its discovery of us; what is sent before is lost
OUTPUTS = ("state", "state_covariance", "pose", "joint_states", "markers", "mask", "overlay", "masked_image")


def add_body_arguments(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Arguments for rig, body and parameters; shared with ``pipeline``.

    Parameters
    ----------
    parser : of a node.
    required : whether rig and model must be given.
    """
    parser.add_argument("--rig", required=required, metavar="FILE", help="rig.yaml: places and lenses of the cameras")
    one = parser.add_mutually_exclusive_group(required=required)
    one.add_argument("--model", metavar="FILE", help="the body: model.yaml, URDF or name (gait_human)")
    if required:
        one.add_argument("--bodies", metavar="RECORDING", help="recording.yaml whose bodies and joining people are tracked")
    parser.add_argument(
        "--occluders", metavar="FILE", help="model.yaml or URDF: fixed things that may hide the body, in the world's frame"
    )
    parser.add_argument("--config", metavar="FILE", help="tracker parameters (default: built in, or those of the recording)")
    parser.add_argument(
        "--initial-state", metavar="FILE", help="state.yaml: where the body is in the first images (default: it is searched)"
    )
    parser.add_argument(
        "--keypoints-table",
        metavar="FILE",
        help="keypoints.yaml: what the points of a detector that publishes them are on the body (default: BlazePose's)",
    )


def add_tracking_arguments(parser: argparse.ArgumentParser) -> None:
    """What else a tracker is told; shared with ``compose``."""
    parser.add_argument(
        "--calibration",
        choices=("rig", "camera_info"),
        default="rig",
        help="where the lenses are taken from; camera_info suits resampled images (default: rig)",
    )
    add_topics_argument(parser)
    parser.add_argument(
        "--joint-states", default="", metavar="TOPIC", help="where a robot says its joints are (sensor_msgs/JointState)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER",
        help="of the run: at the end body.yaml is written there, the body with its clothes, where points show them",
    )  # fmt: skip
    parser.add_argument("--lossless", action="store_true", help="track every image set in order, however long it takes")
    parser.add_argument(
        "--wait-for",
        nargs="+",
        default=[],
        type=listeners,
        metavar="TOPIC=N",
        help="begin when these outputs have N subscribers: state, state_covariance, pose, joint_states, markers, or mask,"
        " overlay, masked_image (of every camera); NAME/TOPIC=N: those of one of several bodies",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_body_arguments(parser)
    parser.add_argument("--cameras", nargs="+", metavar="NAME", help="only these cameras of the rig")
    add_tracking_arguments(parser)
    parser.add_argument("--compressed", action="store_true", help="subscribe to <cam>/image_raw/compressed")
    parser.add_argument(
        "--no-autostart", action="store_true", help="wait to be configured and activated by the services of a lifecycle node"
    )
    parser.add_argument(
        "--end-on-failure", action="store_true", help="end where the automatic start fails, instead of waiting to be configured"
    )


def listeners(text: str) -> tuple[str, int]:
    """``mask=1`` -> ("mask", 1)."""
    topic, _, count = text.partition("=")
    if topic.rpartition("/")[2] not in OUTPUTS or not count.isdigit():
        expected = ", ".join(f"{name}=N" for name in OUTPUTS)
        raise argparse.ArgumentTypeError(f"expected one of {expected}, got '{text}'")
    return topic, int(count)


def tracker_options(args: argparse.Namespace, rig: CameraRig, inbox: InboxOptions) -> TrackerOptions:
    """What the command line says of the tracker; shared with ``compose``.

    Parameters
    ----------
    args : of `add_body_arguments`, `add_tracking_arguments` and ``--cameras``.
    rig : all cameras.
    inbox : how images are received.

    Returns
    -------
    options : of the node.

    Raises
    ------
    TrackerError : files that cannot be used, or cameras that there are not.
    """
    from ...loaders.keypoints.table import load_keypoint_table
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import load_state
    from ...loaders.recording_yaml import load_recording
    from ...ros.tracker.setup import BodyOptions, TrackerOptions
    from ...runs.config_file import load_config
    from ...tracking.config import TrackerConfig

    recording = load_recording(args.bodies) if args.bodies else None
    bodies, joining = ({}, None) if recording is None else _bodies(args, recording)
    config, occluders = (getattr(args, name) or getattr(recording, name, None) for name in ("config", "occluders"))
    table = args.keypoints_table or (recording and recording.keypoints.table)
    _check_listeners(args, [*bodies, *(() if joining is None else joining.names)])
    first = next(iter(bodies.values()), None if joining is None else BodyOptions(joining.model))
    model = load_model(args.model) if first is None else first.model
    state = load_state(args.initial_state, model) if args.initial_state else None
    usual = TrackerConfig() if joining is None else joining.config
    return TrackerOptions(
        rig=rig.subset(args.cameras) if args.cameras else rig,
        model=model,
        config=load_config(config, tracker_name(args.ros_args)) if config else usual,
        initial_state=state if first is None else first.initial_state,
        bodies=bodies,
        joining=joining,
        occluders=load_model(occluders) if occluders else None,
        keypoints=load_keypoint_table(table, model) if table else None,
        joint_states=args.joint_states,
        inbox=inbox,
        calibration_from_topics=args.calibration == "camera_info",
        ros_args=args.ros_args,
    )


def _check_listeners(args: argparse.Namespace, bodies: Sequence[str]) -> None:
    """Topics that are waited for are those of bodies that there are."""
    from ...errors import FileFormatError

    for topic, _ in args.wait_for:
        body = topic.rpartition("/")[0]
        if body and body not in bodies:
            expected = f"topics of {', '.join(bodies)}" if bodies else "topics of the one body that there is"
            raise FileFormatError("command line", "--wait-for", expected, topic)


def _bodies(args: argparse.Namespace, recording: RecordingFile) -> tuple[dict[str, BodyOptions], JoiningOptions | None]:
    """Those of a recording.yaml, and people who join, all with the parameters of the node."""
    import numpy as np

    from ...errors import FileFormatError
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import load_state
    from ...ros.tracker.setup import BodyOptions
    from ...tracking.together.joining import USUAL, JoiningOptions

    for name in ("initial_state", "joint_states"):
        if getattr(args, name):
            expected = "nothing beside --bodies, each of which has its own"
            raise FileFormatError("command line", f"--{name.replace('_', '-')}", expected, getattr(args, name))
    if not recording.several:
        raise FileFormatError(args.bodies, "bodies", "several bodies by name, or joining", "none")
    found = {}
    for name, body in recording.bodies.items():
        if body.config is not None:
            raise FileFormatError(args.bodies, f"bodies.{name}.config", "nothing: a node has one set of parameters", body.config)
        model = load_model(body.model)
        state = load_state(body.initial_state, model) if body.initial_state else None
        found[name] = BodyOptions(model, state, None if body.person is None else np.array(body.person))
    entry = recording.joining
    if entry is None:
        return found, None
    if entry.config is not None:
        raise FileFormatError(args.bodies, "joining.config", "nothing: a node has one set of parameters", entry.config)
    return found, JoiningOptions(load_model(entry.model), USUAL, entry.names, entry.gone_s)


def start_by_itself(node: TrackerNode, wait_for: dict[str, int], stop: Event) -> None:
    """Configure and activate a tracker, the latter when its outputs have subscribers.

    Parameters
    ----------
    node : attached to its event loop.
    wait_for : output -> how many.
    stop : ends the waiting.
    """
    from ...ros.executor import spin
    from ...ros.guarded_node import INACTIVE

    if node.autostart and node.configure():
        spin(node, stop, lambda: node.state != INACTIVE or node.has_subscribers(wait_for))
        settled_s = time.monotonic() + (SETTLE_S if wait_for else 0.0)
        spin(node, stop, lambda: time.monotonic() >= settled_s)
        node.activate()


def run(args: argparse.Namespace) -> int:
    from ...ros.tracker.heap import kept_for_ever

    with kept_for_ever():
        from ...loaders.rig.rig_yaml import load_rig
        from ...ros.executor import attach, ros_process, spin
        from ...ros.tracker.image_inbox import InboxOptions
        from ...ros.tracker.node import TrackerNode

        rig = load_rig(args.rig)
        options = tracker_options(args, rig, InboxOptions(lossless=args.lossless, compressed=args.compressed))
    options = replace(options, autostart=not args.no_autostart)
    with ros_process(with_topics(args.ros_args, rig, dict(args.topics))) as stop:
        node = TrackerNode(options)
        attach(node)
        failure: object = None
        try:
            start_by_itself(node, dict(args.wait_for), stop)
            if args.end_on_failure:
                failure = node.failure
            if not failure:
                spin(node, stop, lambda: node.has_ended)
        finally:
            node.close()
            if args.output is not None:
                node.write_bodies(args.output)
            failure = failure or node.fatal
            node.destroy_node()
    if failure:
        print(f"tracker_node tracker: error: {failure}", file=sys.stderr)
    return 2 if failure else 0
