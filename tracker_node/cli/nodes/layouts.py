"""``tracker_node layouts``: files that set up RViz, Foxglove and PlotJuggler for a rig and a body."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "write layouts of RViz, Foxglove and PlotJuggler for the cameras of a rig and the joints of a body"
EXAMPLE = "tracker_node layouts --rig rig.yaml --model person.yaml --output layouts"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    cameras = parser.add_mutually_exclusive_group(required=True)
    cameras.add_argument("--rig", type=Path, metavar="FILE", help="rig.yaml: names of the cameras and of the world's frame")
    cameras.add_argument("--cameras", nargs="+", metavar="NAME", help="names of the cameras, where there is no rig.yaml")
    body = parser.add_mutually_exclusive_group()
    body.add_argument("--model", type=Path, metavar="FILE", help="model.yaml or URDF: the body (default: the human)")
    body.add_argument("--bodies", type=Path, metavar="RECORDING", help="recording.yaml whose bodies are tracked together")
    parser.add_argument("--tracker", default="tracker", metavar="NAME", help="the tracker's node (default: %(default)s)")
    parser.add_argument("--namespace", default="", metavar="NS", help="of the tracker and the cameras (default: none)")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="gets rviz/, foxglove/ and plotjuggler/"
    )
    parser.add_argument("--force", action="store_true", help="write over what is there")


def run(args: argparse.Namespace) -> int:
    from ...errors import FileFormatError, TrackerError
    from ...loaders.layouts import ViewedGraph, joints_to_plot, write_foxglove_layout, write_plotjuggler_layout, write_rviz_layout
    from ...loaders.model.model_yaml import load_model
    from ...loaders.recording_yaml import load_recording
    from ...loaders.rig.rig_yaml import load_rig
    from ...model.humans.human import human_model

    joints = joints_to_plot(load_model(args.model) if args.model else human_model())
    rig = load_rig(args.rig) if args.rig else None
    cameras, world = (rig.names, rig.world_frame) if rig else (tuple(args.cameras), "world")
    bodies = {}
    if args.bodies:
        models = load_recording(args.bodies).models
        bodies = {name: joints_to_plot(load_model(model)) for name, model in models.items()}
        if not bodies:
            raise FileFormatError(args.bodies, "bodies", "several bodies by name, or joining", "none")
    graph = ViewedGraph(tuple(cameras), joints, world, args.tracker.strip("/"), args.namespace, bodies)
    writers = {
        "rviz/tracker.rviz": write_rviz_layout,
        "foxglove/tracker.json": write_foxglove_layout,
        "plotjuggler/tracker.xml": write_plotjuggler_layout,
    }
    there = [str(args.output / name) for name in writers if (args.output / name).exists()]
    if there and not args.force:
        raise TrackerError(f"{', '.join(there)}: there already; --force writes over them")
    for name, write in writers.items():
        write(graph, args.output / name)
        print(args.output / name)
    return 0
