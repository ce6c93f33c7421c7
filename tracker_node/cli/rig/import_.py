"""``tracker_node rig import``: other programs' calibrations as ``rig.yaml``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import without_password
from ...loaders.source_address import sources_by_name
from ..arguments.run_images import refuse_to_overwrite
from ..arguments.sizes import size_option
from ..arguments.sources import add_sources_argument

SUMMARY = "turn calibrations of other programs (Pose2Sim, aniposelib, Caliscope, ROS, OpenCV, Qualisys, DLT) into a rig.yaml"
EXAMPLE = (
    "tracker_node rig import Calib.toml --sources 'videos/cam{number:02}.mp4' -o rig.yaml\n"
    "  tracker_node rig import intrinsics.yml extrinsics.yml --size 1280x720 --unit mm -o rig.yaml"
)
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


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
    parser.add_argument("--unit", choices=tuple(UNITS), help="unit of the places in the file, where that may be any (default: m)")
    add_sources_argument(parser)
    parser.add_argument("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...loaders.rig.formats import CAMERA_INFO, TOML, detect_all
    from ...loaders.rig.rig_yaml import build_rig, rig_file_of, write_rig_file

    refuse_to_overwrite(args, args.output)
    files = args.files or args.camera_info or ([args.pose2sim] if args.pose2sim else [])
    _check_files(args, files)
    kind = CAMERA_INFO if args.camera_info else TOML if args.pose2sim else detect_all(files)
    _check_unit(args.unit, kind)
    rig = _in_metres(_load(kind, files, args), UNITS[args.unit or "m"])
    sources = sources_by_name(args.sources, rig.names)
    rig_file = rig_file_of(replace(rig, cameras=tuple(replace(camera, source=sources[camera.name]) for camera in rig)))
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


def _check_unit(unit: str | None, kind: str) -> None:
    """Refuse a unit where places are in metres already: Qualisys files say theirs, and ROS lenses take those of a rig.yaml."""
    from ...errors import FileFormatError
    from ...loaders.rig.formats import CAMERA_INFO, QUALISYS

    if unit is not None and kind in (CAMERA_INFO, QUALISYS):
        raise FileFormatError("command line", "--unit", f"none with {kind} files, whose rig is in metres already", unit)


def _load(kind: str, files: list[str], args: argparse.Namespace):
    """The rig of files of a kind."""
    from ...errors import FileFormatError
    from ...loaders.rig import formats as rig_formats
    from ...loaders.rig.calibration_toml import load_pose2sim
    from ...loaders.rig.opencv_storage import load_opencv
    from ...loaders.rig.qualisys_xml import load_qualisys

    size = None if args.size is None else size_option("--size", args.size)
    if kind == rig_formats.CAMERA_INFO:
        return _rig_of_lenses(files, args.like)
    if kind == rig_formats.OPENCV:
        return load_opencv(files, size)
    if len(files) > 1:
        raise FileFormatError(files[1], "(file)", f"one file with all cameras ({kind})", f"{len(files)} files")
    if kind == rig_formats.DLT:
        return _rig_of_dlt(files[0], size)
    if kind == rig_formats.RIG:
        raise FileFormatError(files[0], "(file)", "another program's calibration", "a rig.yaml, which needs no import")
    return load_pose2sim(files[0]) if kind == rig_formats.TOML else load_qualisys(files[0])


def _rig_of_lenses(files: list[str], like: str | None):
    from ...camera.rig import Camera, CameraRig
    from ...errors import FileFormatError
    from ...loaders.rig.camera_info import load_camera_info
    from ...loaders.rig.rig_yaml import load_rig

    places = load_rig(like) if like else None
    cameras: list[Camera] = []
    for file in files:
        name, model = load_camera_info(file)
        if name in [camera.name for camera in cameras]:
            raise FileFormatError(file, "camera_name", "a different name for each camera", name)
        T_world_cam = places[name].T_world_cam if places is not None else np.eye(4)
        cameras.append(Camera(name, model, T_world_cam))
    return CameraRig(tuple(cameras), places.world_frame if places is not None else "world")


def _rig_of_dlt(file: str, size: tuple[int, int] | None):
    from ...calibration.points.dlt import camera_of_parameters
    from ...camera.rig import CameraRig
    from ...errors import FileFormatError
    from ...loaders.rig.dlt_text import load_dlt

    if size is None:
        raise FileFormatError(file, "(file)", "the size of the images beside DLT coefficients: give it with --size", "none")
    cameras = [camera_of_parameters(f"cam{i}", values, size) for i, values in enumerate(load_dlt(file), start=1)]
    return CameraRig(tuple(cameras))


def _in_metres(rig, unit: float):
    """The rig with its places multiplied; those that then cannot be metres are told."""
    from ...camera.rig_unit import LARGEST_ROOM_M

    cameras = []
    for camera in rig:
        T_world_cam = camera.T_world_cam.copy()
        T_world_cam[:3, 3] *= unit
        cameras.append(replace(camera, T_world_cam=T_world_cam))
    centers = np.array([camera.center for camera in cameras])
    apart = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    if apart.max(initial=0.0) > LARGEST_ROOM_M:
        print(f"note: the cameras are {apart.max():.0f} m apart; if the file is in millimetres, say --unit mm")
    return replace(rig, cameras=tuple(cameras))


def _report(rig) -> None:
    print(f"{'camera':12} {'pixels':>11} {'focal px':>9} {'lens':20} center in the world (m)")
    for camera in rig:
        model = camera.model
        center = " ".join(f"{v:7.3f}" for v in camera.center)
        size = f"{model.width}x{model.height}"
        print(f"{camera.name:12} {size:>11} {model.K[0, 0]:9.1f} {model.distortion_model:20} {center}")
        if camera.source and not Path(camera.source).exists():
            print(f"{'':12} note: {without_password(camera.source)} does not exist")
