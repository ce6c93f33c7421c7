"""A rig from recordings of a board: lenses, places, and by how much clocks disagree.

First each lens by itself; then the places along the tree of the pairs of cameras that saw the board together most often; then all
at once, `board_adjustment`. Views that fit much worse than the others are left out and named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..camera.camera_model import CameraModel
from ..camera.camera_rig import Camera, CameraRig
from ..errors import TrackerError
from ..geometry import se3
from .board import Board, BoardView
from .board_adjustment import BoardAdjustment, BoardAdjustmentOptions, BoardObservations, BoardState, adjust_boards
from .board_detection import CameraViews, Progress
from .board_instants import BoardInstant, chosen, group_views, speeds, velocities, with_neighbors
from .board_intrinsics import calibrate_lens, observations_of, outlying
from .board_start import common_instants, groups, initial_state, place_boards

CLOCKS = ("exact", "offset", "free")
LEAST_COMMON = 2  # instants that link two cameras


@dataclass(frozen=True)
class BoardRigOptions:
    """How a rig is found.

    Parameters
    ----------
    distortion_model : of the lenses that are not given.
    free_lenses : refine the lenses together with the places.
    clocks : ``exact``: stamps are right; ``offset``: each camera has a constant error; ``free``: and so has each stamp, with
        the standard deviation ``stamp_sigma_s``. The last two need a board that moves, filmed at some images a second.
    tolerance_s : images with stamps so near belong together; None: half the shortest period.
    most_instants : image sets used, chosen to be still and to cover the images.
    """

    distortion_model: str = "plumb_bob"
    free_lenses: bool = True
    clocks: str = "free"
    stamp_sigma_s: float = 0.02
    tolerance_s: float | None = None
    most_instants: int = 100

    def __post_init__(self):
        if self.clocks not in CLOCKS:
            raise ValueError(f"expected clocks to be one of {CLOCKS}, got {self.clocks!r}")


@dataclass(frozen=True, eq=False)
class BoardRig:
    """What has been found.

    Attributes
    ----------
    rig : the world is the first camera's place, with z up where that camera is level (x forward, y to the left).
    board, instants : what was used; one camera alone sees the board in some of them.
    adjustment : the last one; its observations are those of ``instants``. Cameras are in the order of the rig.
    velocities : (n, 6) of the board, see `adjust_boards`; None where the clocks are exact.
    outliers : (camera, view) left out.
    """

    rig: CameraRig
    board: Board
    instants: tuple[BoardInstant, ...]
    adjustment: BoardAdjustment
    velocities: np.ndarray | None
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
    lenses : known beforehand, by camera; with ``free_lenses`` only a start.
    progress : told (what, steps done, steps in all).

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
    instants = _instants(seen, options)
    tell = progress or (lambda what, done, total: None)
    known, singles = _lenses(board, seen, lenses or {}, options, tell)
    shared = [instant for instant in instants if len(instant.views) > 1]
    common = chosen(shared, _paces(seen), options.most_instants)
    if options.clocks != "exact":
        common = with_neighbors(common, shared)
    used = {(name, view.image) for instant in common for name, view in instant.views.items()}
    alone = [BoardInstant({name: view}) for name, views in singles.items() for view in views if (name, view.image) not in used]
    state = initial_state(board, names, known, common)
    return _Refinement(board, names, options, tell).run(state, common, alone)


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


def _instants(seen: Mapping[str, CameraViews], options: BoardRigOptions) -> list[BoardInstant]:
    """Views brought together.

    Raises
    ------
    TrackerError : cameras that do not hang together.
    """
    names = list(seen)
    instants = group_views({name: found.views for name, found in seen.items()}, _tolerance_s(seen, options))
    parts = groups(names, common_instants(names, instants), LEAST_COMMON)
    if len(parts) > 1:
        text = " and ".join("{" + ", ".join(part) + "}" for part in parts)
        what = "the board was never seen by two cameras together" if all(len(p) == 1 for p in parts) else "the cameras fall apart"
        raise TrackerError(
            f"{what}: {text} are not linked by at least {LEAST_COMMON} images of one instant with the board in both;"
            " hold it where cameras of both see it, and check that their stamps are of one clock"
        )
    return instants


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


class _Refinement:
    """From a first state to the last one, in rounds, with ever less tolerance for what does not fit."""

    ROUNDS = 5

    def __init__(self, board: Board, names: Sequence[str], options: BoardRigOptions, tell: Progress):
        self.board, self.names, self.options, self.tell = board, list(names), options, tell
        self.outliers: list[tuple[str, BoardView]] = []

    def run(self, state: BoardState, common: list[BoardInstant], alone: list[BoardInstant]) -> BoardRig:
        self.tell("the rig", 0, self.ROUNDS)
        state = self._adjust(state, common, None, BoardAdjustmentOptions(3.0, free_lenses=False)).state
        instants = common + alone
        boards = place_boards(self.board, self.names, state, instants)
        state = BoardState.at(state.lenses, state.Ts_cam_world, boards)
        options = BoardAdjustmentOptions(1.0, free_lenses=self.options.free_lenses)
        adjustment, moving = self._adjust(state, instants, None, replace(options, robust_scale_px=3.0)), None
        for done in range(1, self.ROUNDS):
            self.tell("the rig", done, self.ROUNDS)
            if done == self.ROUNDS - 2:
                instants, state = self._without_outliers(adjustment, instants)
            else:
                state = adjustment.state
            if self.options.clocks != "exact":
                free = self.options.clocks == "free"
                options = replace(options, free_clocks=True, jitter_sigma_s=self.options.stamp_sigma_s if free else 0.0)
            moving = velocities(instants, state.Ts_world_board)
            adjustment = self._adjust(state, instants, moving, options)
            adjustment = replace(adjustment, state=self._with_first_clock_right(adjustment.state, instants, moving))
        self.tell("the rig", self.ROUNDS, self.ROUNDS)
        cameras = tuple(
            Camera(name, lens, se3.inverse(T))
            for name, lens, T in zip(self.names, adjustment.state.lenses, adjustment.state.Ts_cam_world, strict=True)
        )
        rig = first_camera_world(CameraRig(cameras))
        return BoardRig(rig, self.board, tuple(instants), adjustment, moving, tuple(self.outliers))

    def _adjust(
        self, state: BoardState, instants: list[BoardInstant], moving: np.ndarray | None, options: BoardAdjustmentOptions
    ) -> BoardAdjustment:
        return adjust_boards(self.board.corners, rows_of(self.names, instants), state, options, moving)

    def _with_first_clock_right(self, state: BoardState, instants: list[BoardInstant], moving: np.ndarray) -> BoardState:
        """The same state, to first order, with stamps of each camera that are right on average, and the first clock right.

        What is common to all stamps of a camera is its clock, and what is common to all cameras is where the boards are; images
        hardly tell one from the other, so that the adjustment stops somewhere along the way.
        """
        index = {name: i for i, name in enumerate(self.names)}
        seen = np.zeros(state.jitter_s.shape, dtype=bool)
        for k, instant in enumerate(instants):
            seen[k, [index[name] for name in instant.views]] = len(instant.views) > 1
        mean_s = np.where(seen, state.jitter_s, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        clocks_s = state.clocks_s + mean_s
        boards = np.array([T @ se3.exp(v * clocks_s[0]) for T, v in zip(state.Ts_world_board, moving, strict=True)])
        return replace(
            state, clocks_s=clocks_s - clocks_s[0], jitter_s=state.jitter_s - mean_s, Ts_world_board=boards
        )

    def _without_outliers(
        self, adjustment: BoardAdjustment, instants: list[BoardInstant]
    ) -> tuple[list[BoardInstant], BoardState]:
        """Instants without the views that do not fit, and the state at those that are left."""
        errors = view_errors(self.names, instants, adjustment.residuals_px)
        bad = {key for key, out in zip(errors, outlying(list(errors.values())), strict=True) if out}
        kept, numbers = [], []
        for k, instant in enumerate(instants):
            good = {name: view for name, view in instant.views.items() if (k, name) not in bad}
            self.outliers += [(name, view) for name, view in instant.views.items() if (k, name) in bad]
            if good:
                kept.append(BoardInstant(good))
                numbers.append(k)
        state = adjustment.state
        return kept, replace(state, Ts_world_board=state.Ts_world_board[numbers], jitter_s=state.jitter_s[numbers])


def rows_of(names: Sequence[str], instants: Sequence[BoardInstant]) -> BoardObservations:
    """The corners of all instants."""
    index = {name: i for i, name in enumerate(names)}
    views = [{index[name]: view for name, view in instant.views.items()} for instant in instants]
    return observations_of(views, [instant.stamp_ns for instant in instants])


def view_errors(names: Sequence[str], instants: Sequence[BoardInstant], residuals_px: np.ndarray) -> dict[tuple[int, str], float]:
    """(instant, camera) -> rms distance in the image, from residuals (m, 2) in the order of `rows_of`."""
    errors, begin = {}, 0
    for k, instant in enumerate(instants):
        for name, view in instant.views.items():
            part = residuals_px[begin : begin + len(view.ids)]
            errors[k, name] = float(np.sqrt((part**2).sum(axis=1).mean()))
            begin += len(view.ids)
    return errors
