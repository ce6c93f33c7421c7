"""``tracker_node import_rig``: other programs' calibrations as ``rig.yaml``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

SUMMARY = "turn calibrations of other programs (Pose2Sim, aniposelib, Caliscope, ROS camera_info) into a rig.yaml"
EXAMPLE = "tracker_node import_rig --pose2sim Calib.toml --sources 'videos/cam{number:02}.mp4' -o rig.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("--pose2sim", metavar="TOML", help="Pose2Sim, aniposelib or Caliscope calibration (lenses and places)")
    kind.add_argument("--camera-info", metavar="YAML", nargs="+", help="ROS camera_info files, one a camera (lenses only)")
    parser.add_argument(
        "--like",
        metavar="RIG",
        help="with --camera-info: take the cameras' places from this rig.yaml; without it all stand at the world's origin",
    )
    parser.add_argument(
        "--sources",
        metavar="PATTERN",
        help="video or image folder of each camera; {name} is its name, {number} counts from 1, as in 'videos/{name}.mp4'",
    )
    parser.add_argument("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")


def run(args: argparse.Namespace) -> int:
    from ..loaders.pose2sim_toml import load_pose2sim
    from ..loaders.rig_yaml import CameraEntry, build_rig, rig_file_of, write_rig_file

    if args.pose2sim:
        rig_file = rig_file_of(load_pose2sim(args.pose2sim))
    else:
        rig_file = rig_file_of(_rig_of_lenses(args.camera_info, args.like))
    if args.sources:
        entries: dict[str, CameraEntry] = {}
        for number, (name, entry) in enumerate(rig_file.cameras.items(), start=1):
            entries[name] = entry.model_copy(update={"source": _source(args.sources, name, number)})
        rig_file = rig_file.model_copy(update={"cameras": entries})
    write_rig_file(rig_file, args.output, base_dir=".")
    _report(build_rig(rig_file, "."))
    print(f"wrote {args.output}")
    if args.camera_info and not args.like:
        print("The cameras' places are not known yet: put each T_world_cam into the file, or give a rig with --like.")
    return 0


def _source(pattern: str, name: str, number: int) -> str:
    from ..errors import SourceError

    try:
        return pattern.format(name=name, number=number)
    except (KeyError, IndexError, ValueError, AttributeError) as error:
        raise SourceError(pattern, "expected a pattern with {name} or {number}, e.g. 'videos/cam{number:02}.mp4'") from error


def _rig_of_lenses(files: list[str], like: str | None):
    from ..camera.camera_rig import Camera, CameraRig
    from ..errors import FileFormatError
    from ..loaders.camera_info_yaml import load_camera_info
    from ..loaders.rig_yaml import load_rig

    places = load_rig(like) if like else None
    cameras: list[Camera] = []
    for file in files:
        name, model = load_camera_info(file)
        if name in [camera.name for camera in cameras]:
            raise FileFormatError(file, "camera_name", "a different name for each camera", name)
        T_world_cam = places[name].T_world_cam if places is not None else np.eye(4)
        cameras.append(Camera(name, model, T_world_cam))
    return CameraRig(tuple(cameras), places.world_frame if places is not None else "world")


def _report(rig) -> None:
    print(f"{'camera':12} {'pixels':>11} {'focal px':>9} {'lens':20} center in the world (m)")
    for camera in rig:
        model = camera.model
        center = " ".join(f"{v:7.3f}" for v in camera.center)
        size = f"{model.width}x{model.height}"
        print(f"{camera.name:12} {size:>11} {model.K[0, 0]:9.1f} {model.distortion_model:20} {center}")
        if camera.source and not Path(camera.source).exists():
            print(f"{'':12} note: {camera.source} does not exist")
