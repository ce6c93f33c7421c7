"""``tracker_node rig world``: origin, axes and scale of a rig's world."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.board import add_board_shape, board_of
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "set or check origin, axes, scale and vertical of a rig, by a board, points of known place, a wand or a plumb line"
EXAMPLE = (
    "tracker_node rig world rig.yaml --points control_points.csv -o rig_world.yaml\n"
    "  tracker_node rig world rig.yaml --board-images left=floor_left.png right=floor_right.png --charuco 4x5 --square 0.054"
    " -o rig_world.yaml\n"
    "  tracker_node rig world rig.yaml --axes axes.csv --wand wand.csv --length 0.5 --plumb plumb.csv -o rig_world.yaml"
)
AXES = ("x", "-x", "y", "-y", "z", "-z")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("rig", metavar="RIG", help="rig.yaml")
    frame = parser.add_mutually_exclusive_group()
    frame.add_argument("--points", metavar="CSV", help="points of known place: columns camera,point,x,y,z,u,v (meters, pixels)")
    frame.add_argument("--axes", metavar="CSV", help="where the points 'origin', 'x' and 'y' are seen: columns camera,point,u,v")
    frame.add_argument(
        "--board-images", nargs="+", metavar="CAMERA=IMAGE", help="a board that lies still: its middle becomes the origin, x"
        " to its right, y to its top, z towards the viewer",
    )  # fmt: skip
    frame.add_argument("--up", choices=AXES, help="the axis of the present world that points up; it becomes z")
    add("--scale", action="store_true", help="with --points or a board: fit the rig's scale too (default: reported, not changed)")
    add("--wand", metavar="CSV", help="ends of a wand, points named NAMEa and NAMEb: columns camera,point,u,v")
    add("--length", type=float, metavar="M", help="length of the wand, meters")
    add("--plumb", metavar="CSV", help="where the points 'top' and 'bottom' of a plumb line are seen: columns camera,point,u,v")
    add_board_shape(parser, required=False)
    add("-o", "--output", metavar="FILE", help="rig to write; without it everything is printed, and nothing is written")
    add("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...calibration.world_fit import fit_world, with_world
    from ...errors import TrackerError
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file

    if not (args.points or args.axes or args.board_images or args.up or args.wand or args.plumb):
        raise TrackerError("nothing to go by: give --points, --axes, --board-images, --up, --wand or --plumb")
    if bool(args.wand) != (args.length is not None) or (args.length is not None and not 0.0 < args.length < 100.0):
        raise TrackerError("a wand needs --wand and its --length in meters (more than 0, less than 100)")
    if args.output:
        refuse_to_overwrite(args, args.output)
    base = Path(args.rig).parent
    rig_file = read_rig_file(args.rig)
    before = build_rig(rig_file, base)
    fit = fit_world(before, _evidence(args))
    _print_fit(args, fit)
    _print_cameras(before, fit.rig)
    if args.output:
        write_rig_file(with_world(rig_file, fit.rig), args.output, base_dir=base)
        print(f"wrote {args.output}")
    return 0


def _evidence(args: argparse.Namespace):
    """What the arguments name."""
    import numpy as np

    from ...calibration.world_fit import WorldEvidence
    from ...errors import SourceError, TrackerError

    board, files, up = None, {}, None
    if args.board_images:
        if not (args.charuco or args.chessboard) or args.square is None:
            raise TrackerError("a board needs --charuco or --chessboard, and --square")
        board = board_of(args)
        for text in args.board_images:
            camera, _, files[camera] = text.partition("=")
            if not files[camera]:
                raise SourceError(text, "expected CAMERA=IMAGE")
    if args.up:
        up = np.zeros(3)
        up["xyz".index(args.up[-1])] = -1.0 if args.up.startswith("-") else 1.0
    return WorldEvidence(
        args.points, args.axes, board, files, up, args.scale, args.wand or None, args.length or 0.0, args.plumb or None
    )


def _print_fit(args: argparse.Namespace, fit) -> None:
    """How well the evidence agrees with the rig."""
    if points := fit.points:
        print(
            f"{points.n_points} points fitted to {1e3 * points.rms_m:.1f} mm (rms), worst {points.worst}"
            f" {1e3 * points.worst_m:.1f} mm; rays meet within {points.worst_px:.1f} px"
        )
        kept = "the rig is scaled by that" if args.scale else "kept; --scale makes it 1"
        print(f"lengths of the rig times {points.scale:.4f} are those of the points ({kept})")
    if fit.tilt_deg is not None:
        print(f"the plumb line is {fit.tilt_deg:.2f} degrees off the z axis")
    if wand := fit.wand:
        lengths = 1e3 * wand.lengths_m
        spread = f", from {lengths.min():.1f} to {lengths.max():.1f}" if len(lengths) > 1 else ""
        print(f"the wand is {1e3 * wand.length_m:.1f} mm long in the rig{spread}; {1e3 * args.length:.1f} mm are given")
        if wand.applied:
            print(f"the rig is scaled by {wand.factor:.4f}")


def _print_cameras(before, after) -> None:
    """Where cameras were and are."""
    print(f"{'camera':12} {'center before (m)':>27}   {'center now (m)':>27}")
    for old, new in zip(before, after, strict=True):
        row = ["  ".join(f"{v:7.3f}" for v in camera.center) for camera in (old, new)]
        print(f"{old.name:12} {row[0]:>27}   {row[1]:>27}")
