"""``tracker_node rig world``: origin, axes and scale of a rig's world."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.board import add_board_shape
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "set or check origin, axes, scale and vertical of a rig, by a board, points of known place, a wand or a plumb line"
EXAMPLE = (
    "tracker_node rig world rig.yaml --points control_points.csv -o rig_world.yaml\n"
    "  tracker_node rig world rig.yaml --board-images left=floor_left.png right=floor_right.png --charuco 4x5 --square 0.054"
    " -o rig_world.yaml\n"
    "  tracker_node rig world rig.yaml --axes axes.csv --wand wand.csv --length 0.5 --plumb plumb.csv -o rig_world.yaml"
)
_OTHER_UNIT = 5.0  # lengths that differ by such a factor are not of one unit
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
    rig = _scaled_by_wand(args, _turned_by_plumb(args, _moved(args, before)))
    _tell(before, rig)
    if args.output:
        moved = rig_file.with_extrinsics({camera.name: camera.T_world_cam for camera in rig})
        write_rig_file(moved.model_copy(update={"lights": _lights(rig)}), args.output, base_dir=base)
        print(f"wrote {args.output}")
    return 0


def _moved(args: argparse.Namespace, rig):
    """The rig in the world of points, axes or a board."""
    import numpy as np

    from ...calibration import world_frame
    from ...errors import TrackerError
    from ...loaders.rig.control_points import load_clicks

    if args.up:
        up = np.zeros(3)
        up["xyz".index(args.up[-1])] = -1.0 if args.up.startswith("-") else 1.0
        return world_frame.upright(up).rig(rig)
    if args.axes:
        seen = world_frame.seen_points(rig, load_clicks(args.axes))
        change = world_frame.onto_axes(*(_named(args.axes, seen, name) for name in ("origin", "x", "y")))
        return change.rig(rig)
    if not (args.points or args.board_images):
        return rig
    clicks, places = _control_points(args.points) if args.points else _board_points(args)
    seen = world_frame.seen_points(rig, clicks)
    points, targets = np.array([seen[name].place for name in seen]), np.array([places[name] for name in seen])
    scale = world_frame.onto_points(points, targets, with_scale=True).scale
    if not args.scale and not 1.0 / _OTHER_UNIT < scale < _OTHER_UNIT:
        raise TrackerError(
            f"lengths of the rig times {scale:.4g} are those of the points: one of them is not in meters; --scale goes by the"
            " points"
        )
    change = world_frame.onto_points(points, targets, args.scale)
    assert change.residuals_m is not None
    rms, worst = float(np.sqrt(np.mean(change.residuals_m**2))), int(np.argmax(change.residuals_m))
    print(
        f"{len(points)} points fitted to {1e3 * rms:.1f} mm (rms), worst {list(seen)[worst]}"
        f" {1e3 * change.residuals_m[worst]:.1f} mm; rays meet within {max(s.worst_px for s in seen.values()):.1f} px"
    )
    kept = "the rig is scaled by that" if args.scale else "kept; --scale makes it 1"
    print(f"lengths of the rig times {scale:.4f} are those of the points ({kept})")
    return change.rig(rig)


def _control_points(path: str):
    """Camera -> point -> pixel, and point -> place."""
    from ...loaders.rig.control_points import load_control_points

    found = load_control_points(path)
    clicks = {camera: dict(zip(seen.names, seen.pixels, strict=True)) for camera, seen in found.items()}
    places = {name: place for seen in found.values() for name, place in zip(seen.names, seen.points, strict=True)}
    return clicks, places


def _board_points(args: argparse.Namespace):
    """The same of a board's corners."""
    import cv2

    from ...calibration.board.board import BoardDetector
    from ...errors import SourceError, TrackerError
    from ..arguments.board import board_of

    if not (args.charuco or args.chessboard) or args.square is None:
        raise TrackerError("a board needs --charuco or --chessboard, and --square")
    board = board_of(args)
    if board.turns_unseen:
        raise TrackerError("this chessboard looks the same upside down: cameras may not agree on its corners; take another")
    clicks, detector = {}, BoardDetector(board)
    for text in args.board_images:
        camera, _, file = text.partition("=")
        image = cv2.imread(file) if file else None
        if image is None:
            raise SourceError(text, "expected CAMERA=IMAGE with an image that can be read")
        view = detector.find(image)
        if view is None:
            raise SourceError(file, f"no {board} in it")
        clicks[camera] = {f"corner {i}": pixel for i, pixel in zip(view.ids, view.pixels, strict=True)}
    twice = {name for points in clicks.values() for name in points if sum(name in other for other in clicks.values()) > 1}
    clicks = {camera: {n: p for n, p in points.items() if n in twice} for camera, points in clicks.items()}
    return clicks, {f"corner {i}": corner for i, corner in enumerate(board.corners)}


def _turned_by_plumb(args: argparse.Namespace, rig):
    """The rig upright, where a plumb line alone gives it; else the angle to its vertical is printed."""
    from ...calibration import world_frame
    from ...loaders.rig.control_points import load_clicks

    if not args.plumb:
        return rig
    seen = world_frame.seen_points(rig, load_clicks(args.plumb))
    up = _named(args.plumb, seen, "top") - _named(args.plumb, seen, "bottom")
    print(f"the plumb line is {world_frame.tilt_deg(up):.2f} degrees off the z axis")
    if args.points or args.axes or args.board_images or args.up:
        return rig
    return world_frame.upright(up).rig(rig)


def _scaled_by_wand(args: argparse.Namespace, rig):
    """The rig in the wand's scale; where points have set the scale it is only printed."""
    import numpy as np

    from ...calibration import world_frame
    from ...errors import FileFormatError, TrackerError
    from ...loaders.rig.control_points import load_clicks

    if not args.wand:
        return rig
    seen = world_frame.seen_points(rig, load_clicks(args.wand))
    pairs = [name[:-1] for name in seen if name.endswith("a") and f"{name[:-1]}b" in seen]
    if not pairs:
        raise FileFormatError(args.wand, "point", "two ends at least, such as 1a and 1b", list(seen))
    lengths = np.array([np.linalg.norm(seen[f"{pair}a"].place - seen[f"{pair}b"].place) for pair in pairs])
    if np.median(lengths) < world_frame.LEAST_M:
        raise TrackerError(f"{args.wand}: the ends of the wand are at the same place")
    factor = args.length / float(np.median(lengths))
    spread = f", from {1e3 * lengths.min():.1f} to {1e3 * lengths.max():.1f}" if len(pairs) > 1 else ""
    print(f"the wand is {1e3 * np.median(lengths):.1f} mm long in the rig{spread}; {1e3 * args.length:.1f} mm are given")
    if args.points and args.scale:
        return rig
    print(f"the rig is scaled by {factor:.4f}")
    return world_frame.scaled(factor).rig(rig)


def _named(path: str, seen, name: str):
    from ...errors import FileFormatError

    if name not in seen:
        raise FileFormatError(path, "point", f"a point named '{name}'", list(seen))
    return seen[name].place


def _lights(rig):
    from ...loaders.rig.rig_yaml import rig_file_of

    return rig_file_of(rig).lights


def _tell(before, after) -> None:
    """Where cameras were and are."""
    print(f"{'camera':12} {'center before (m)':>27}   {'center now (m)':>27}")
    for old, new in zip(before, after, strict=True):
        row = ["  ".join(f"{v:7.3f}" for v in camera.center) for camera in (old, new)]
        print(f"{old.name:12} {row[0]:>27}   {row[1]:>27}")
