"""Rigs from calibrations of other programs, and from trials of their projects.

Of a trial come lenses, places and videos together, in meters and upright.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..camera.rig import LARGEST_ROOM_M, Camera, CameraRig
from ..errors import FileFormatError
from ..loaders.images.source import open_camera_source_of_any_size
from ..loaders.projects import ProjectTrial, videos_by_camera
from ..loaders.rig.calibration_toml import cameras_in_toml, load_pose2sim
from ..loaders.rig.camera_info import load_camera_info
from ..loaders.rig.control_points import load_dlt
from ..loaders.rig.formats import CAMERA_INFO, DLT, OPENCAP, OPENCV, QUALISYS, RIG, TOML, detect_all
from ..loaders.rig.opencap_pickle import load_opencap
from ..loaders.rig.opencv_storage import load_opencv
from ..loaders.rig.qualisys_xml import cameras_in_qualisys, load_qualisys
from ..loaders.rig.rig_yaml import load_rig
from ..loaders.source_address import last_number
from .points.dlt import camera_of_parameters
from .video_pixels import rig_of_videos
from .world_frame import UP, up_of_cameras, upright

_LARGEST_PLACE_M = 200.0  # a rig that is larger has another unit, unless its unit is stated
_FARTHEST_CENTER = 0.2  # of a lens from the middle of the image, fraction of its sides
_IN_METERS = (CAMERA_INFO, OPENCAP, QUALISYS)  # whatever their files count in
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
    FileFormatError : files that cannot be used, a size that is missing, a unit where places are in meters already, or none where
        they are hardly meters.
    """
    if unit is not None and kind in _IN_METERS:
        raise FileFormatError("command line", "--unit", f"none with {kind} files, whose rig is in meters already", unit)
    rig = _load(kind, files, size, like)
    if kind == DLT:
        _tell_centers(rig, tell)
    if kind == QUALISYS:
        for number, (name, is_active) in enumerate(cameras_in_qualisys(files[0]), start=1):
            if not is_active:
                tell(f"camera {number} ({name}) is inactive: left out")
    return _in_meters(files[0], rig, "m" if kind in _IN_METERS else unit, tell)


def numbers_of_cameras(kind: str, files: Sequence[str], rig: CameraRig, tell: Callable[[str], None]) -> dict[str, int]:
    """Place of each camera in its file, from 1, where those that are left out count too.

    Parameters
    ----------
    kind, files : as of `import_rig`.
    rig : that they make.
    tell : called with a sentence where tables of cameras are numbered otherwise.

    Returns
    -------
    Camera -> number.
    """
    names, keys = list(rig.names), list(rig.names)
    if kind == QUALISYS:
        names = [name for name, _ in cameras_in_qualisys(files[0])]
    elif kind == TOML:
        tables = cameras_in_toml(files[0])
        names, keys = list(tables.values()), list(tables)
    found = {name: number for number, name in enumerate(names, start=1) if name in rig.names}
    stated = [number for key in keys if (number := last_number(key)) is not None]
    if kind == TOML and len(stated) == len(keys) and len({number - place for place, number in enumerate(stated)}) > 1:
        said = ", ".join(f"{name} {found[name]} ([{key}])" for name, key in zip(names, keys, strict=True) if name in found)
        tell(f"note: {{number}} is the place in the file, not the number of the table: {said}; {{name}} is safe")
    return found


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
        came = "a rig.yaml, which needs no import but --sources"
        raise FileFormatError(files[0], "(file)", "another program's calibration", came)
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
    return replace(places or CameraRig(()), cameras=tuple(cameras))


def _rig_of_dlt(file: str, size: tuple[int, int] | None) -> CameraRig:
    if size is None:
        raise FileFormatError(file, "(file)", "the size of the images beside DLT coefficients: give it with --size", "none")
    cameras = [camera_of_parameters(f"cam{i}", values, size) for i, values in enumerate(load_dlt(file), start=1)]
    return CameraRig(tuple(cameras))


def _tell_centers(rig: CameraRig, tell: Callable[[str], None]) -> None:
    """A note where most lenses have their centers far from the middle of images of the given size."""
    width, height = rig.cameras[0].model.width, rig.cameras[0].model.height
    u, v = np.median([camera.model.K[:2, 2] for camera in rig], axis=0)
    if max(abs(u / width - 0.5), abs(v / height - 0.5)) > _FARTHEST_CENTER:
        told = f"note: the lenses' centers are near pixel ({u:.0f}, {v:.0f}), far from the middle of images of {width}x{height}"
        tell(f"{told}; is --size that of the images?")


def _in_meters(path: str, rig: CameraRig, unit: str | None, tell: Callable[[str], None]) -> CameraRig:
    cameras = []
    for camera in rig:
        T_world_cam = camera.T_world_cam.copy()
        T_world_cam[:3, 3] *= UNITS[unit or "m"]
        cameras.append(replace(camera, T_world_cam=T_world_cam))
    centers = np.array([camera.center for camera in cameras])
    apart = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    if unit is None and apart.max(initial=0.0) > _LARGEST_PLACE_M:
        got = f"cameras {apart.max():.0f} m apart; say their unit: --unit mm, cm or m"
        raise FileFormatError(path, "(places)", f"cameras within {_LARGEST_PLACE_M:.0f} m of each other", got)
    if apart.max(initial=0.0) > LARGEST_ROOM_M:
        tell(f"note: the cameras are {apart.max():.0f} m apart; if the file is in millimeters, say --unit mm")
    return replace(rig, cameras=tuple(cameras))


_LEAST_APART_M = 0.02


@dataclass(frozen=True, eq=False)
class TrialRig:
    """``rig`` of the cameras that have a video; ``period_s`` between two images, of most of them."""

    rig: CameraRig
    period_s: float


def rig_of_trial(
    trial: ProjectTrial,
    calibration: Path | None = None,
    unit: str | None = None,
    tell: Callable[[str], None] = print,
    pixels: Mapping[str, str] | None = None,
) -> TrialRig:
    """The rig of a trial.

    Parameters
    ----------
    trial : of `loaders.projects.programs.find_trials`.
    calibration : file in place of that which was found.
    unit : of places in TOML files, see `UNITS`; None: that of the program.
    tell : called with a sentence on what was decided here.
    pixels : camera -> how its images have got another size than its calibration's, of `video_pixels.KINDS`, where that is open.

    Returns
    -------
    The rig, in meters, with z up where the cameras tell what is up, and its videos as sources.

    Raises
    ------
    TrackerError : no calibration or several, one that cannot be read, videos that fit no cameras or cannot be opened.
    """
    files = [str(path) for path in (trial.calibration if calibration is None else (calibration,))]
    kind = detect_all(files) if files else TOML
    if len(files) != 1 and kind != OPENCAP:
        found = ", ".join(files) or "none"
        raise FileFormatError(trial.folder, "(calibration)", "one for these videos; --calibration says which", found)
    rig = import_rig(kind, files, None, (unit or trial.unit) if kind == TOML else unit, None, tell)
    videos = videos_by_camera(trial, rig.names, tell)
    stamps = None if trial.stamp_file is None else str(trial.stamp_file)
    cameras = [replace(camera, source=str(videos[camera.name]), stamp_file=stamps) for camera in rig if camera.name in videos]
    periods = [1.0 / open_camera_source_of_any_size(camera).rate_hz for camera in cameras]
    with_videos = rig_of_videos(replace(rig, cameras=tuple(cameras)), pixels or {}, tell)
    return TrialRig(_upright(with_videos, tell), float(np.median(periods)))


def _upright(rig: CameraRig, tell: Callable[[str], None]) -> CameraRig:
    centers = np.array([camera.center for camera in rig])
    apart = float(np.linalg.norm(centers[:, None] - centers[None], axis=2).max())
    if apart < _LEAST_APART_M:
        tell(f"note: the cameras are at most {1000.0 * apart:.2f} mm apart; say with --unit what the calibration's unit is")
    up = up_of_cameras(rig)
    if up is None:
        tell("note: the cameras do not tell which axis of the world is up, and z should be: see `tracker_node rig world`")
        return rig
    if up @ UP > 0.5:
        return rig
    axis = int(np.argmax(np.abs(up)))
    tell(f"the world is turned: its axis {'-' if up[axis] < 0.0 else ''}{'xyz'[axis]}, which is up for the cameras, is z now")
    return upright(up).rig(rig)
