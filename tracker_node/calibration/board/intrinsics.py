"""The lens of one camera from views of a board: image by image, without regard to time or other cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.model import CameraModel
from ...errors import CalibrationError
from .adjustment import N_PLACE, BoardAdjustmentOptions, BoardObservations, BoardState, adjust_boards
from .board import Board, BoardView
from .start import board_poses, initial_lens
from .views import BoardTimeStep, chosen, place_of

LEAST_VIEWS = 4  # each gives two constraints to a lens of some five parameters and its distortion
_UNLIKE = 0.05  # of the board's own size, by which a view must differ from others to say something of its own
_MOST_PX, _KNOWN = 3.0, 0.03  # rms of a board that is the one meant; sigma of a focal length that means something, over that
_FRONTAL_DEG = 5.0  # boards all within this of parallel to the image do not tell the focal length


@dataclass(frozen=True, eq=False)
class LensCalibration:
    """A lens and how well it is known.

    Attributes
    ----------
    sigma : (4 + n,) standard deviations of the `lens_vector`, from the residuals.
    views : those used; ``outliers`` those left out, since they fit much worse than the others.
    residuals_px : per view (k, 2).
    """

    lens: CameraModel
    sigma: np.ndarray
    views: tuple[BoardView, ...]
    outliers: tuple[BoardView, ...]
    residuals_px: tuple[np.ndarray, ...]

    @property
    def rms_px(self) -> float:
        squares = np.concatenate([(r**2).sum(axis=1) for r in self.residuals_px])
        return float(np.sqrt(squares.mean()))

    @property
    def doubt(self) -> str:
        """Why it should not be used unseen; empty for one that is well known."""
        focal_px, sigma_px = self.lens.K[0, 0], self.sigma[0]
        if sigma_px <= _KNOWN * focal_px:
            return ""
        return f"the focal length is {focal_px:.0f} ± {sigma_px:.0f} px: show the board in more places, and tilted in other ways"


def calibrate_lens(
    name: str,
    board: Board,
    views: Sequence[BoardView],
    image_size: tuple[int, int],
    distortion_model: str = "plumb_bob",
    most_views: int = 80,
) -> LensCalibration:
    """The lens that explains the views best; the board may be anywhere in each.

    Parameters
    ----------
    name : of the camera, for messages.
    board : the board.
    views : of one camera.
    image_size : (width, height).
    distortion_model : of `camera.distortion`.
    most_views : views used, the most varied ones.

    Returns
    -------
    Lens, standard deviations, views used and left out.

    Raises
    ------
    CalibrationError : too few views, all alike, or the board parallel to the image in all of them; corners that do not fit.
    """
    if len(views) < LEAST_VIEWS:
        raise CalibrationError(name, f"expected the board in at least {LEAST_VIEWS} sharp images, got {len(views)}")
    if (unlike := _unlike(views)) < LEAST_VIEWS:
        raise CalibrationError(name, f"expected {LEAST_VIEWS} views of the board that are unlike, got {unlike} of {len(views)}")
    used = [time_step.views[name] for time_step in chosen([BoardTimeStep({name: view}) for view in views], {}, most_views)]
    lens = initial_lens(board, used, image_size, distortion_model)
    used, poses = _posed(board, lens, used)
    if len(used) < LEAST_VIEWS:
        raise CalibrationError(name, f"only {len(used)} of {len(views)} views of the board make sense: is it the board you gave?")
    _check_tilt(name, poses)
    state, outliers = BoardState.at((lens,), np.eye(4)[None], poses), []
    for scale_px in (3.0, 1.0):
        seen = observations_of([{0: view} for view in used])
        adjustment = adjust_boards(board.corners, seen, state, BoardAdjustmentOptions(robust_scale_px=scale_px))
        residuals = np.split(adjustment.residuals_px, np.cumsum([len(view.ids) for view in used])[:-1])
        keep = ~outlying([float(np.sqrt((r**2).sum(axis=1).mean())) for r in residuals])
        outliers += [view for view, good in zip(used, keep, strict=True) if not good]
        used = [view for view, good in zip(used, keep, strict=True) if good]
        residuals = [r for r, good in zip(residuals, keep, strict=True) if good]
        state = BoardState.at(adjustment.state.lenses, np.eye(4)[None], adjustment.state.Ts_world_board[keep])
    noise = float(np.sqrt(np.concatenate(residuals).var()))
    sigma = noise * adjustment.sigmas[0][N_PLACE:]
    found = LensCalibration(state.lenses[0], sigma, tuple(used), tuple(outliers), tuple(residuals))
    if found.rms_px > _MOST_PX:
        asked = f"is it the board you gave, and a lens of {distortion_model}?"
        raise CalibrationError(name, f"corners of the board fit to {found.rms_px:.1f} px only: {asked}")
    return found


def observations_of(views: Sequence[dict[int, BoardView]], stamps_ns: Sequence[int] | None = None) -> BoardObservations:
    """Corners of the views as rows.

    Parameters
    ----------
    views : per time step, camera number -> view.
    stamps_ns : of the time steps; None: time does not matter.

    Returns
    -------
    One row a corner.
    """
    columns: list[list[np.ndarray]] = [[], [], [], [], []]
    for k, seen in enumerate(views):
        for camera, view in seen.items():
            n = len(view.ids)
            late_s = 0.0 if stamps_ns is None else 1e-9 * (view.stamp_ns - stamps_ns[k])
            for column, value in zip(
                columns, (np.full(n, camera), np.full(n, k), view.ids, view.pixels, np.full(n, late_s)), strict=True
            ):
                column.append(value)
    return BoardObservations(*(np.concatenate(column) for column in columns))


def outlying(rms_px: Sequence[float]) -> np.ndarray:
    """(n,) True for views whose error is far beyond what is usual: above four times the median, and a pixel."""
    rms = np.asarray(rms_px)
    return rms > max(1.0, 4.0 * float(np.median(rms)))


def _unlike(views: Sequence[BoardView]) -> int:
    """How many views are unlike each other; counting ends where they suffice."""
    found: list[np.ndarray] = []
    for place in map(place_of, views):
        if all(np.linalg.norm(place - other) > _UNLIKE for other in found):
            found.append(place)
        if len(found) == LEAST_VIEWS:
            break
    return len(found)


def _posed(board: Board, lens: CameraModel, views: Sequence[BoardView]) -> tuple[list[BoardView], np.ndarray]:
    found = [(view, board_poses(board, lens, view)[0]) for view in views]
    kept = [(view, poses[0]) for view, poses in found if poses]
    return [view for view, _ in kept], np.array([pose for _, pose in kept]).reshape(-1, 4, 4)


def _check_tilt(name: str, poses: np.ndarray) -> None:
    """The board's normal must not point at the camera in every view."""
    tilt = np.degrees(np.arccos(np.clip(np.abs(poses[:, 2, 2]), 0.0, 1.0)))
    if np.percentile(tilt, 90) < _FRONTAL_DEG:
        raise CalibrationError(name, "the board is parallel to the image in all views; tilt it, or the focal length is not seen")
