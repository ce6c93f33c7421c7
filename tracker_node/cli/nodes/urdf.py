"""``tracker_node urdf``: a body as robot description."""

from __future__ import annotations

import argparse

from ...errors import TrackerError

SUMMARY = "print a body as URDF, for robot_state_publisher and other programs that show robots"
EXAMPLE = "tracker_node urdf person.yaml\n  tracker_node urdf gait_human --mass 72"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", metavar="FILE", help="model.yaml or URDF: the body, or its name (gait_human)")
    parser.add_argument(
        "--mass", type=float, metavar="KG", help="of the whole person: links get masses and inertias after de Leva (1996)"
    )


def run(args: argparse.Namespace) -> int:
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.urdf_writer import urdf_of
    from ...model.humans.masses import inertials

    if args.mass is not None and not 1.0 <= args.mass <= 500.0:
        raise TrackerError(f"--mass: expected 1 to 500 kilograms, got {args.mass:g}")
    model = load_model(args.model)
    print(urdf_of(model, None if args.mass is None else inertials(model, args.mass)))
    return 0
