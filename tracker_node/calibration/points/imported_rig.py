"""Rigs from calibrations of other programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import LARGEST_ROOM_M, Camera, CameraRig
from ...errors import FileFormatError
from ...loaders.rig.calibration_toml import load_pose2sim
from ...loaders.rig.camera_info import load_camera_info
from ...loaders.rig.dlt_text import load_dlt
from ...loaders.rig.formats import CAMERA_INFO, DLT, OPENCAP, OPENCV, QUALISYS, RIG, TOML
from ...loaders.rig.opencap_pickle import load_opencap
from ...loaders.rig.opencv_storage import load_opencv
from ...loaders.rig.qualisys_xml import load_qualisys
from ...loaders.rig.rig_yaml import load_rig
from .dlt import camera_of_parameters

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def import_rig(
    kind: str,
    files: Sequence[str],
    size: tuple[int, int] | None,
    unit: str | None,
    like: str | None,
    tell: Callable[[str], None],
) -> CameraRig:
    """The rig in files that belong together.

    Parameters
    ----------
    kind : format, see `loaders.rig.formats.detect_all`.
    files : of that format.
    size : (width, height) of the images, for files that do not say it.
    unit : of the places in the file, one of `UNITS`; None: meters, or as the file says.
    like : rig.yaml with the cameras' places, for lenses of ROS; None: all stand at the world's origin.
    tell : called with a sentence where the places are unlikely to be meters.

    Returns
    -------
    rig : in meters, without sources.

    Raises
    ------
    FileFormatError : files that cannot be used, a size that is missing, or a unit where places are in meters already.
    """
    if unit is not None and kind in (CAMERA_INFO, OPENCAP, QUALISYS):
        raise FileFormatError("command line", "--unit", f"none with {kind} files, whose rig is in meters already", unit)
    return _in_meters(_load(kind, files, size, like), UNITS[unit or "m"], tell)


def _load(kind: str, files: Sequence[str], size: tuple[int, int] | None, like: str | None) -> CameraRig:
    if kind == CAMERA_INFO:
        return _rig_of_lenses(files, like)
    if kind == OPENCV:
        return load_opencv(files, size)
    if kind == OPENCAP:
        return load_opencap(files)
    if len(files) > 1:
        raise FileFormatError(files[1], "(file)", f"one file with all cameras ({kind})", f"{len(files)} files")
    if kind == DLT:
        return _rig_of_dlt(files[0], size)
    if kind == RIG:
        raise FileFormatError(files[0], "(file)", "another program's calibration", "a rig.yaml, which needs no import")
    return {TOML: load_pose2sim, QUALISYS: load_qualisys}[kind](files[0])


def _rig_of_lenses(files: Sequence[str], like: str | None) -> CameraRig:
    places = load_rig(like) if like else None
    cameras: list[Camera] = []
    for file in files:
        name, model = load_camera_info(file)
        if name in [camera.name for camera in cameras]:
            raise FileFormatError(file, "camera_name", "a different name for each camera", name)
        T_world_cam = places[name].T_world_cam if places is not None else np.eye(4)
        cameras.append(Camera(name, model, T_world_cam))
    return CameraRig(tuple(cameras), places.world_frame if places is not None else "world")


def _rig_of_dlt(file: str, size: tuple[int, int] | None) -> CameraRig:
    if size is None:
        raise FileFormatError(file, "(file)", "the size of the images beside DLT coefficients: give it with --size", "none")
    cameras = [camera_of_parameters(f"cam{i}", values, size) for i, values in enumerate(load_dlt(file), start=1)]
    return CameraRig(tuple(cameras))


def _in_meters(rig: CameraRig, unit: float, tell: Callable[[str], None]) -> CameraRig:
    cameras = []
    for camera in rig:
        T_world_cam = camera.T_world_cam.copy()
        T_world_cam[:3, 3] *= unit
        cameras.append(replace(camera, T_world_cam=T_world_cam))
    centers = np.array([camera.center for camera in cameras])
    apart = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    if apart.max(initial=0.0) > LARGEST_ROOM_M:
        tell(f"note: the cameras are {apart.max():.0f} m apart; if the file is in millimeters, say --unit mm")
    return replace(rig, cameras=tuple(cameras))
