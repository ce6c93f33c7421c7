"""A rig from recordings of a board: lenses, places, and by how much clocks disagree.

First each lens by itself; then the places along the tree of the pairs of cameras that saw the board together most often; then all
at once, `adjustment`. Views that fit much worse than the others are left out and named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...errors import CalibrationError, TrackerError
from ...geometry import se3
from ...loaders.images.source import ImageSource, size_contradiction
from .adjustment import BoardAdjustment, BoardState
from .board import Board, BoardView
from .intrinsics import calibrate_lens
from .refinement import BoardRigOptions, refine
from .start import common_time_steps, groups, initial_state
from .views import LEAST_COMMON, BoardTimeStep, CameraViews, Progress, chosen, group_views, speeds, with_neighbors


@dataclass(frozen=True, eq=False)
class BoardRig:
    """What has been found.

    Attributes
    ----------
    rig : the world is the first camera's place, with z up where that camera is level (x forward, y to the left).
    board, time_steps : what was used; one camera alone sees the board in some of them.
    adjustment : the last one; its observations are those of ``time_steps``. Cameras are in the order of the rig.
    velocities : (n, 6) of the board, see `adjust_boards`.
    outliers : (camera, view) left out.
    """

    rig: CameraRig
    board: Board
    time_steps: tuple[BoardTimeStep, ...]
    adjustment: BoardAdjustment
    velocities: np.ndarray
    outliers: tuple[tuple[str, BoardView], ...]

    @property
    def state(self) -> BoardState:
        return self.adjustment.state


def calibrate_rig(
    board: Board,
    seen: Mapping[str, CameraViews],
    options: BoardRigOptions | None = None,
    lenses: Mapping[str, CameraModel] | None = None,
    progress: Progress | None = None,
) -> BoardRig:
    """Lenses and places of cameras (by name) from what they saw of a board.

    Parameters
    ----------
    board : the board.
    seen : what each camera saw, in the order of the rig.
    options : clocks, distortion, selection of time steps.
    lenses : known beforehand, by camera; with ``free_lenses`` only a start.
    progress : called with (what, steps done, steps in all).

    Returns
    -------
    The rig, in the world of its first camera, and what was used.

    Raises
    ------
    TrackerError : fewer than two cameras, a board that looks the same upside down, or cameras that do not hang together by
        boards that two of them saw at once; names the groups.
    CalibrationError : a camera with too few views for its lens.
    """
    options, names = options or BoardRigOptions(), list(seen)
    if len(names) < 2:
        raise TrackerError(f"expected at least two cameras for a rig, got {len(names)}; `calibrate intrinsics` is for one")
    check_for_rig(board)
    time_steps = _time_steps(seen, options)
    tell = progress or (lambda what, done, total: None)
    known, singles = _lenses(board, seen, lenses or {}, options, tell)
    shared = [time_step for time_step in time_steps if len(time_step.views) > 1]
    common = chosen(shared, _paces(seen), options.most_time_steps)
    if options.clocks != "exact":
        common = with_neighbors(common, shared)
    _check_linked(names, common)
    used = {(name, view.image) for time_step in common for name, view in time_step.views.items()}
    alone = [BoardTimeStep({name: view}) for name, views in singles.items() for view in views if (name, view.image) not in used]
    found = refine(board, names, initial_state(board, names, known, common), common, alone, options, tell)
    _check_linked(names, found.time_steps)
    state = found.adjustment.state
    cameras = tuple(
        Camera(name, lens, se3.inverse(T)) for name, lens, T in zip(names, state.lenses, state.Ts_cam_world, strict=True)
    )
    rig = first_camera_world(CameraRig(cameras))
    return BoardRig(rig, board, found.time_steps, found.adjustment, found.velocities, found.outliers)


def check_for_rig(board: Board) -> None:
    """Raise a `TrackerError` for a board on whose corners cameras cannot agree."""
    if board.turns_unseen:
        raise TrackerError(
            f"a chessboard of {board.columns}x{board.rows} inner corners looks the same upside down, so cameras cannot agree on"
            " its corners: use one with an even and an odd side, or a ChArUco board"
        )


def first_camera_world(rig: CameraRig) -> CameraRig:
    """The same rig in the world of its first camera: origin there, x forward, y to the left, z up."""
    axes = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T = se3.from_rotation_translation(axes, np.zeros(3)) @ rig.cameras[0].T_cam_world
    return replace(rig, cameras=tuple(replace(camera, T_world_cam=T @ camera.T_world_cam) for camera in rig))


def _time_steps(seen: Mapping[str, CameraViews], options: BoardRigOptions) -> list[BoardTimeStep]:
    """Views brought together.

    Raises
    ------
    TrackerError : cameras that do not hang together.
    """
    time_steps = group_views({name: found.views for name, found in seen.items()}, _tolerance_s(seen, options))
    _check_linked(list(seen), time_steps)
    return time_steps


def given_lenses(rig: CameraRig, sources: Mapping[str, ImageSource]) -> dict[str, CameraModel]:
    """Lenses of the cameras that have recordings, by name.

    Parameters
    ----------
    rig : with their lenses.
    sources : recordings by camera.

    Returns
    -------
    Camera -> lens.

    Raises
    ------
    TrackerError : a camera that the rig lacks, or a lens for images of another size.
    """
    lenses = {name: rig[name].model for name in sources}
    for name, source in sources.items():
        expected, size = (lenses[name].width, lenses[name].height), (source.width, source.height)
        if expected != size:
            raise CalibrationError(name, size_contradiction(expected, size, source.path))
    return lenses


def with_clocks(rig: CameraRig, late_s: Mapping[str, float]) -> CameraRig:
    """The rig with time offsets of cameras whose clock is off.

    Parameters
    ----------
    rig : of the cameras.
    late_s : camera -> by how many seconds its images are later than they say; of the others 0.

    Returns
    -------
    A copy.
    """
    return replace(rig, cameras=tuple(replace(c, time_offset_ns=round(1e9 * late_s.get(c.name, 0.0))) for c in rig))


def _check_linked(names: Sequence[str], time_steps: Sequence[BoardTimeStep]) -> None:
    parts = groups(names, common_time_steps(names, time_steps), LEAST_COMMON)
    if len(parts) > 1:
        text = " and ".join("{" + ", ".join(part) + "}" for part in parts)
        what = "the board was never seen by two cameras together" if all(len(p) == 1 for p in parts) else "the cameras fall apart"
        raise TrackerError(
            f"{what}: {text} are not linked by at least {LEAST_COMMON} images of one time step with the board in both;"
            " hold it where cameras of both see it, and check that their stamps are of one clock"
        )


def _tolerance_s(seen: Mapping[str, CameraViews], options: BoardRigOptions) -> float:
    if options.tolerance_s is not None:
        return options.tolerance_s
    periods = [np.diff([view.stamp_ns for view in found.views]) for found in seen.values() if len(found.views) > 1]
    return 0.5e-9 * min(float(np.percentile(period, 10)) for period in periods) if periods else 0.02


def _paces(seen: Mapping[str, CameraViews]) -> dict[tuple[str, int], float]:
    """(camera, image) -> px/s."""
    paces = {}
    for name, found in seen.items():
        for view, pace in zip(found.views, speeds(found.views), strict=True):
            paces[name, view.image] = float(pace)
    return paces


def _lenses(
    board: Board, seen: Mapping[str, CameraViews], given: Mapping[str, CameraModel], options: BoardRigOptions, tell: Progress
) -> tuple[dict[str, CameraModel], dict[str, tuple[BoardView, ...]]]:
    """A lens for each camera, and the views from which those were found that are not given."""
    lenses, views = dict(given), {}
    for done, (name, found) in enumerate(seen.items()):
        tell("lenses one by one", done, len(seen))
        if name not in lenses:
            calibration = calibrate_lens(name, board, found.views, found.image_size, options.distortion_model)
            lenses[name], views[name] = calibration.lens, calibration.views
    tell("lenses one by one", len(seen), len(seen))
    return lenses, views
