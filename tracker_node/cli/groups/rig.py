"""``tracker_node rig``: a rig checked, moved, and handed to and from other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ...errors import without_password
from ..arguments.board import add_board_shape, board_of
from ..arguments.cameras import UNITS, add_pixel_map_argument, add_sources_argument, size_option, sources_of_cameras
from ..arguments.run_images import refuse_to_overwrite
from ..arguments.verbs import Subverb, add_subverbs, run_subverb

SUMMARY = "look after a rig of cameras: find out what is wrong with it, move its world frame, hand it to other programs"
EXAMPLE = "tracker_node rig check rig.yaml"


def _add_check_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="rig.yaml")
    parser.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="*",
        help="a bag, or a video or image folder for each camera in the order of the rig, or camera=source (default: the"
        " rig's own sources)",
    )
    parser.add_argument("--seconds", type=float, default=4.0, metavar="S", help="how much is processed (default: %(default)s)")
    parser.add_argument(
        "-o", "--output", default="rig_check", metavar="DIR", help="folder for an image per camera, index.html and"
        " findings.json (default: %(default)s)",
    )  # fmt: skip


def _run_check(args: argparse.Namespace) -> int:
    from ...doctor.diagnosis import examine
    from ...doctor.people import LEAST_CAMERAS
    from ...doctor.recording import record, with_inputs
    from ...doctor.report import JSON, write_examination
    from ...errors import SourceError, TrackerError
    from ...loaders.rig.rig_yaml import load_rig
    from ...runs.people.detection import DetectionOptions, detectors_of

    if not 0.0 < args.seconds <= 600.0:
        raise SourceError("--seconds", f"expected a number in (0, 600], got {args.seconds:g}")
    rig = with_inputs(load_rig(args.rig), args.inputs)
    if Path(args.output).is_file():
        raise SourceError(args.output, "expected a folder to write to, got a file")
    output = Path(args.output)
    if output.is_dir() and any(output.iterdir()) and not (output / JSON).exists():
        raise SourceError(args.output, f"holds other files (and no {JSON} of an earlier check), which are not overwritten")
    detector = None
    try:
        if len(rig) >= LEAST_CAMERAS:
            (detector,) = detectors_of(DetectionOptions())
    except TrackerError as error:
        print(f"cameras are not compared by people: {error}", file=sys.stderr)
    recordings = record(rig, args.seconds, lambda camera: print(f"looking at the images of {camera}", file=sys.stderr), detector)
    print("comparing the cameras", file=sys.stderr, flush=True)
    examination = examine(rig, recordings)
    page = write_examination(args.output, rig, recordings, examination)
    for finding in examination.findings:
        print(f"- {finding.sentence}")
    for note in examination.notes:
        print(note)
    found = f"{len(examination.findings)} found." if examination.findings else "Nothing found in what was checked."
    print("Nothing found." if examination.compared and not examination.findings else found, f"See {page}")
    if examination.findings:
        return 1
    return 0 if examination.compared else 3


FORMATS = ("pose2sim", "anipose", "caliscope", "camera_info", "opencv", "qualisys", "dlt")


def _add_export_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="rig.yaml")
    parser.add_argument("--to", required=True, choices=FORMATS, help="the format")
    parser.add_argument(
        "-o", "--output", required=True, metavar="PATH", help="file to write (camera_info: folder, one file per camera)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def _run_export(args: argparse.Namespace) -> int:
    from ...loaders.rig import formats as rig_formats
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file

    rig_file = read_rig_file(args.rig)
    rig = build_rig(rig_file, Path(args.rig).parent)
    refuse_to_overwrite(args, *_written(rig, args))
    _write(rig, args.to, Path(args.output))
    print(f"wrote {args.output}")
    target = {"camera_info": rig_formats.CAMERA_INFO, "dlt": rig_formats.DLT}.get(args.to, args.to)
    dropped = rig_formats.dropped(rig_file, target)
    if dropped:
        print(f"Not in it, since {args.to} cannot hold it: " + "; ".join(dropped) + ".")
    return 0


def _written(rig, args: argparse.Namespace) -> list[str]:
    if args.to != "camera_info":
        return [args.output]
    return [str(Path(args.output) / f"{camera.name}.yaml") for camera in rig]


def _write(rig, target: str, output: Path) -> None:
    from ...calibration.points.dlt import dlt_parameters
    from ...loaders.rig.calibration_toml import dump_calibration_toml
    from ...loaders.rig.camera_info import dump_camera_info
    from ...loaders.rig.control_points import dump_dlt
    from ...loaders.rig.opencv_storage import dump_opencv
    from ...loaders.rig.qualisys_xml import dump_qualisys

    (output if target == "camera_info" else output.parent).mkdir(parents=True, exist_ok=True)
    if target == "camera_info":
        for camera in rig:
            dump_camera_info(camera.name, camera.model, output / f"{camera.name}.yaml")
    elif target == "opencv":
        dump_opencv(rig, output)
    elif target == "qualisys":
        dump_qualisys(rig, output)
    elif target == "dlt":
        dump_dlt([dlt_parameters(camera) for camera in rig], output)
    else:
        dump_calibration_toml(rig, output, target)




def _add_import_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "files", nargs="*", metavar="FILE", help="calibration, or several that belong together, of whatever program"
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--pose2sim", metavar="TOML", help="Pose2Sim, aniposelib or Caliscope calibration (lenses and places)")
    kind.add_argument("--camera-info", metavar="YAML", nargs="+", help="ROS camera_info files, one a camera (lenses only)")
    parser.add_argument(
        "--like",
        metavar="RIG",
        help="with ROS camera_info: take the cameras' places from this rig.yaml; without it all stand at the world's origin",
    )
    parser.add_argument("--size", metavar="WxH", help="size of the images, for files that do not say it (DLT, OpenCV)")
    parser.add_argument("--unit", choices=UNITS, help="unit of the places in the file, where that may be any (default: m)")
    add_sources_argument(parser)
    add_pixel_map_argument(parser)
    parser.add_argument("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def _run_import(args: argparse.Namespace) -> int:
    from ...calibration.imported import import_rig, numbers_of_cameras
    from ...calibration.video_pixels import parsed_choices, rig_of_videos
    from ...loaders.rig.formats import CAMERA_INFO, RIG, TOML, detect_all
    from ...loaders.rig.rig_yaml import build_rig, load_rig, rig_file_of, write_rig_file

    refuse_to_overwrite(args, args.output)
    files = args.files or args.camera_info or ([args.pose2sim] if args.pose2sim else [])
    _check_files(args, files)
    kind = CAMERA_INFO if args.camera_info else TOML if args.pose2sim else detect_all(files)
    size = None if args.size is None else size_option("--size", args.size)
    moves_on = kind == RIG and len(files) == 1 and args.sources  # a rig that was mended gets the videos
    rig = load_rig(files[0]) if moves_on else import_rig(kind, files, size, args.unit, args.like, print)
    counted = "{number" in (args.sources or "") and not moves_on
    numbers = numbers_of_cameras(kind, files, rig, print) if counted else None
    sources = sources_of_cameras(args.sources, rig.names, print, numbers)
    rig = rig.subset([name for name in rig.names if name in sources]).with_sources(sources)
    rig = rig_of_videos(rig, parsed_choices("--pixel-map", args.pixel_map), print)
    rig_file = rig_file_of(rig)
    write_rig_file(rig_file, args.output, base_dir=".")
    _print_rig(build_rig(rig_file, "."))
    print(f"wrote {args.output}")
    if kind == CAMERA_INFO and not args.like:
        print("The cameras' places are not known yet: put each T_world_cam into the file, or give a rig with --like.")
    return 0


def _check_files(args: argparse.Namespace, files: list[str]) -> None:
    from ...errors import SourceError

    if not files:
        raise SourceError("rig import", "expected a calibration file")
    if args.files and (args.pose2sim or args.camera_info):
        raise SourceError(args.files[0], "expected files either as they are or behind --pose2sim or --camera-info, got both")


def _print_rig(rig) -> None:
    print(f"{'camera':12} {'pixels':>11} {'focal px':>9} {'lens':20} center in the world (m)")
    for camera in rig:
        model = camera.model
        center = " ".join(f"{v:7.3f}" for v in camera.center)
        size = f"{model.width}x{model.height}"
        print(f"{camera.name:12} {size:>11} {model.K[0, 0]:9.1f} {model.distortion_model:20} {center}")
        if camera.source and not Path(camera.source).exists():
            print(f"{'':12} note: {without_password(camera.source)} does not exist")


AXES = ("x", "-x", "y", "-y", "z", "-z")


def _add_world_arguments(parser: argparse.ArgumentParser) -> None:
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


def _run_world(args: argparse.Namespace) -> int:
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


SUBVERBS = (
    Subverb(
        "check",
        "say what is wrong with a rig, from a few seconds of images in which something moves; exit status 1 if anything is, 3 if"
        " nothing was found but the cameras could not be compared",
        "tracker_node rig check rig.yaml videos/cam01.mp4 videos/cam02.mp4 --output out/check",
        _add_check_arguments,
        _run_check,
    ),
    Subverb(
        "export",
        "write a rig in another program's format, and say what that cannot hold",
        "tracker_node rig export rig.yaml --to pose2sim -o Calib.toml\n"
        "  tracker_node rig export rig.yaml --to camera_info -o lenses/",
        _add_export_arguments,
        _run_export,
    ),
    Subverb(
        "import",
        "turn calibrations of other programs (Pose2Sim, aniposelib, Caliscope, ROS, OpenCV, Qualisys, DLT) into a rig.yaml",
        "tracker_node rig import Calib.toml --sources 'videos/cam{number:02}.mp4' -o rig.yaml\n"
        "  tracker_node rig import intrinsics.yml extrinsics.yml --size 1280x720 --unit mm -o rig.yaml",
        _add_import_arguments,
        _run_import,
    ),
    Subverb(
        "world",
        "set or check origin, axes, scale and vertical of a rig, by a board, points of known place, a wand or a plumb line",
        "tracker_node rig world rig.yaml --points control_points.csv -o rig_world.yaml\n"
        "  tracker_node rig world rig.yaml --board-images left=floor_left.png right=floor_right.png --charuco 4x5 --square 0.054"
        " -o rig_world.yaml\n"
        "  tracker_node rig world rig.yaml --axes axes.csv --wand wand.csv --length 0.5 --plumb plumb.csv -o rig_world.yaml",
        _add_world_arguments,
        _run_world,
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, SUBVERBS)


run = run_subverb
