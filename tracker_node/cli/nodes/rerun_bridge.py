"""``tracker_node rerun_bridge``: a running graph in Rerun's viewer."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..arguments.cameras import add_topics_argument, with_topics
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "hand on a tracker's states and the cameras' images to Rerun's viewer"
EXAMPLE = "tracker_node rerun_bridge --rig rig.yaml --model person.yaml"
VIEWER = "rerun+http://127.0.0.1:9876/proxy"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", required=True, metavar="FILE", help="rig.yaml: the cameras")
    body = parser.add_mutually_exclusive_group(required=True)
    body.add_argument("--model", metavar="FILE", help="model.yaml or URDF: the body that is tracked")
    body.add_argument("--bodies", metavar="RECORDING", help="recording.yaml whose bodies are tracked together")
    add("--tracker", default="tracker", metavar="NAME", help="the tracker's node (default: %(default)s)")
    add_topics_argument(parser)
    add("--compressed", action="store_true", help="subscribe to <cam>/image_raw/compressed")
    add("--image-rate", type=float, default=10.0, metavar="HZ",
        help="images a second of each camera, at most (default: %(default)g; 0: none)")  # fmt: skip
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--connect", default=VIEWER, metavar="URL", help="a viewer's (default: %(default)s)")
    where.add_argument("-o", "--output", type=Path, metavar="FILE", help="write a file, such as live.rrd, instead")
    add("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...errors import FileFormatError
    from ...loaders.model.model_yaml import load_model
    from ...loaders.recording_yaml import load_recording
    from ...loaders.rig.rig_yaml import load_rig
    from ...ros.executor import attach, ros_process, spin
    from ...ros.parameter_overrides import refuse_undeclared
    from ...ros.rerun_bridge import BridgeOptions, RerunBridge

    if not 0.0 <= args.image_rate <= 1000.0:
        raise FileFormatError("command line", "--image-rate", "0 to 1000", args.image_rate)
    if not args.connect.startswith(("rerun://", "rerun+http://", "rerun+https://")):
        raise FileFormatError("command line", "--connect", f"an address such as {VIEWER}", args.connect)
    if args.output is not None:
        refuse_to_overwrite(args, args.output)
    files = {"": args.model}
    if args.bodies:
        files = load_recording(args.bodies).models
        if not files:
            raise FileFormatError(args.bodies, "bodies", "several bodies by name, or joining", "none")
    rig = load_rig(args.rig)
    options = BridgeOptions(
        {name: load_model(file) for name, file in files.items()}, rig, args.tracker.strip("/"), args.output, args.connect,
        args.image_rate, args.compressed,
    )  # fmt: skip
    with ros_process(with_topics(args.ros_args, rig, dict(args.topics))) as stop:
        node = RerunBridge(options)
        attach(node)
        print("rerun_bridge: ready", flush=True)
        try:
            refuse_undeclared(node, args.ros_args)
            spin(node, stop, lambda: node.fatal is not None)
        finally:
            node.close()
            failure, n = node.fatal, node.sets
            node.destroy_node()
    if failure is not None:
        print(f"tracker_node rerun_bridge: error: {failure}", file=sys.stderr)
        return 2
    print(f"rerun_bridge: {n} states shown")
    return 0
