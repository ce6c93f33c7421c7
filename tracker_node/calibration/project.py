"""A trial of another program's project as a rig: lenses, places and videos together, in meters and upright."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError
from ..loaders.images.source import open_camera_source_of_any_size
from ..loaders.projects.trial import ProjectTrial, videos_by_camera
from ..loaders.rig.formats import OPENCAP, TOML, detect_all
from .points.imported_rig import import_rig
from .video_pixels import rig_of_videos
from .world_frame import UP, up_of_cameras, upright

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
    unit : of places in TOML files, see `points.imported_rig.UNITS`; None: that of the program.
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
