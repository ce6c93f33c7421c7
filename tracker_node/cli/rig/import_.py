"""``tracker_node rig import``: other programs' calibrations as ``rig.yaml``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from ...errors import without_password
from ..arguments.cameras import add_pixel_map_argument, add_sources_argument, size_option, sources_of_cameras
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "turn calibrations of other programs (Pose2Sim, aniposelib, Caliscope, ROS, OpenCV, Qualisys, DLT) into a rig.yaml"
EXAMPLE = (
    "tracker_node rig import Calib.toml --sources 'videos/cam{number:02}.mp4' -o rig.yaml\n"
    "  tracker_node rig import intrinsics.yml extrinsics.yml --size 1280x720 --unit mm -o rig.yaml"
)
UNITS = ("m", "cm", "mm")  # of `calibration.points.imported_rig`


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
    from ...calibration.points.imported_rig import import_rig
    from ...calibration.video_pixels import parsed_choices, rig_of_videos
    from ...loaders.rig.formats import CAMERA_INFO, TOML, detect_all
    from ...loaders.rig.rig_yaml import build_rig, rig_file_of, write_rig_file

    refuse_to_overwrite(args, args.output)
    files = args.files or args.camera_info or ([args.pose2sim] if args.pose2sim else [])
    _check_files(args, files)
    kind = CAMERA_INFO if args.camera_info else TOML if args.pose2sim else detect_all(files)
    size = None if args.size is None else size_option("--size", args.size)
    rig = import_rig(kind, files, size, args.unit, args.like, print)
    sources = sources_of_cameras(args.sources, rig.names, print)
    with_sources = tuple(replace(camera, source=sources[camera.name]) for camera in rig if camera.name in sources)
    rig = rig_of_videos(replace(rig, cameras=with_sources), parsed_choices("--pixel-map", args.pixel_map), print)
    rig_file = rig_file_of(rig)
    write_rig_file(rig_file, args.output, base_dir=".")
    _report(build_rig(rig_file, "."))
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


def _report(rig) -> None:
    print(f"{'camera':12} {'pixels':>11} {'focal px':>9} {'lens':20} center in the world (m)")
    for camera in rig:
        model = camera.model
        center = " ".join(f"{v:7.3f}" for v in camera.center)
        size = f"{model.width}x{model.height}"
        print(f"{camera.name:12} {size:>11} {model.K[0, 0]:9.1f} {model.distortion_model:20} {center}")
        if camera.source and not Path(camera.source).exists():
            print(f"{'':12} note: {without_password(camera.source)} does not exist")
