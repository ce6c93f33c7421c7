"""``tracker_node urdf``: a body as robot description."""

from __future__ import annotations

import argparse

SUMMARY = "print a body as URDF, for robot_state_publisher and other programs that show robots"
EXAMPLE = "tracker_node urdf person.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", metavar="FILE", help="model.yaml or URDF: the body")


def run(args: argparse.Namespace) -> int:
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.urdf_writer import urdf_of

    print(urdf_of(load_model(args.model)))
    return 0
