"""From a first guess at a rig to the best one, in rounds: what does not fit is left out, then clocks are sought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry import se3
from .adjustment import BoardAdjustment, BoardAdjustmentOptions, BoardObservations, BoardState, adjust_boards
from .board import Board, BoardView
from .intrinsics import observations_of, outlying
from .start import place_boards
from .views import BoardTimeStep, Progress, velocities

CLOCKS = ("exact", "offset", "free")
_ROUNDS = 4  # of clocks and velocities, which depend on each other
_ROUGH_PX, _FINE_PX = 3.0, 1.0  # robust scales before and after


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
    most_time_steps : image sets used, chosen to be still and to cover the images.
    """

    distortion_model: str = "plumb_bob"
    free_lenses: bool = True
    clocks: str = "free"
    stamp_sigma_s: float = 0.02
    tolerance_s: float | None = None
    most_time_steps: int = 100

    def __post_init__(self):
        if self.clocks not in CLOCKS:
            raise ValueError(f"expected clocks to be one of {CLOCKS}, got {self.clocks!r}")


@dataclass(frozen=True, eq=False)
class Refined:
    """What `refine` has found; see `rig.BoardRig`."""

    time_steps: tuple[BoardTimeStep, ...]
    adjustment: BoardAdjustment
    velocities: np.ndarray
    outliers: tuple[tuple[str, BoardView], ...]


def refine(
    board: Board,
    names: Sequence[str],
    state: BoardState,
    common: Sequence[BoardTimeStep],
    alone: Sequence[BoardTimeStep],
    options: BoardRigOptions,
    tell: Progress,
) -> Refined:
    """The best rig near a first one.

    Parameters
    ----------
    board : the board.
    names : of the cameras, in the order of the state.
    state : of the cameras, and of the board at ``common``.
    common : time steps in which several cameras see the board.
    alone : time steps in which one camera does, for its lens.
    options : what is free, and the model of the clocks.
    tell : called with (what, rounds done, rounds in all).

    Returns
    -------
    Time steps used, the last adjustment, velocities of the board, views left out.
    """
    tell("the rig", 0, _ROUNDS + 1)
    task = _Task(board, list(names), state, list(common))
    task.leave_out(task.unseen())
    task.adjust(BoardAdjustmentOptions(_ROUGH_PX, free_lenses=False))
    task.begin_again(task.time_steps + list(alone))
    task.leave_out(task.unseen())
    fine = BoardAdjustmentOptions(_FINE_PX, free_lenses=options.free_lenses)
    task.adjust(replace(fine, robust_scale_px=_ROUGH_PX))
    if options.clocks != "exact":
        jitter_sigma_s = options.stamp_sigma_s if options.clocks == "free" else 0.0
        fine = replace(fine, free_clocks=True, jitter_sigma_s=jitter_sigma_s)
    for done in range(_ROUNDS):
        tell("the rig", done + 1, _ROUNDS + 1)
        if done == _ROUNDS // 2:
            task.leave_out(task.outlying())
        moving = velocities(task.time_steps, task.state.Ts_world_board)
        adjustment = task.adjust(fine, moving)
        task.set_first_clock_right(moving)
    tell("the rig", _ROUNDS + 1, _ROUNDS + 1)
    return Refined(tuple(task.time_steps), replace(adjustment, state=task.state), moving, tuple(task.left_out))


class _Task:
    """A state at the time steps that are used, and what was left out."""

    def __init__(self, board: Board, names: list[str], state: BoardState, time_steps: list[BoardTimeStep]):
        self.board, self.names, self.state, self.time_steps = board, names, state, time_steps
        self.residuals_px = np.zeros((0, 2))
        self.left_out: list[tuple[str, BoardView]] = []

    def adjust(self, options: BoardAdjustmentOptions, moving: np.ndarray | None = None) -> BoardAdjustment:
        adjustment = adjust_boards(self.board.corners, rows_of(self.names, self.time_steps), self.state, options, moving)
        self.state, self.residuals_px = adjustment.state, adjustment.residuals_px
        return adjustment

    def begin_again(self, time_steps: list[BoardTimeStep]) -> None:
        """Place the boards of these time steps anew, before the cameras as they are."""
        self.time_steps = time_steps
        boards = place_boards(self.board, self.names, self.state, time_steps)
        self.state = BoardState.at(self.state.lenses, self.state.Ts_cam_world, boards)

    def unseen(self) -> set[tuple[int, str]]:
        """Views (time step, camera) with a corner that the camera could not see in the present state."""
        bad = set()
        for k, time_step in enumerate(self.time_steps):
            for name, view in time_step.views.items():
                i = self.names.index(name)
                T = self.state.Ts_cam_world[i] @ self.state.Ts_world_board[k]
                if not self.state.lenses[i].project(se3.apply(T, self.board.corners[view.ids]))[1].all():
                    bad.add((k, name))
        return bad

    def outlying(self) -> set[tuple[int, str]]:
        """Views that fit much worse than the others."""
        errors = view_errors(self.time_steps, self.residuals_px)
        return {key for key, out in zip(errors, outlying(list(errors.values())), strict=True) if out}

    def leave_out(self, bad: set[tuple[int, str]]) -> None:
        """Go on without some views (time step, camera)."""
        kept, numbers = [], []
        for k, time_step in enumerate(self.time_steps):
            good = {name: view for name, view in time_step.views.items() if (k, name) not in bad}
            self.left_out += [(name, view) for name, view in time_step.views.items() if (k, name) in bad]
            if good:
                kept.append(BoardTimeStep(good))
                numbers.append(k)
        self.time_steps, state = kept, self.state
        self.state = replace(state, Ts_world_board=state.Ts_world_board[numbers], jitter_s=state.jitter_s[numbers])

    def set_first_clock_right(self, moving: np.ndarray) -> None:
        """The same state, to first order, with stamps of each camera that are right on average, and the first clock right.

        What is common to all stamps of a camera is its clock, and what is common to all cameras is where the boards are; images
        hardly tell one from the other, so that the adjustment stops somewhere along the way.
        """
        state, seen = self.state, np.zeros(self.state.jitter_s.shape, dtype=bool)
        for k, time_step in enumerate(self.time_steps):
            seen[k, [self.names.index(name) for name in time_step.views]] = len(time_step.views) > 1
        mean_s = np.where(seen, state.jitter_s, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        clocks_s = state.clocks_s + mean_s
        boards = np.array([T @ se3.exp(v * clocks_s[0]) for T, v in zip(state.Ts_world_board, moving, strict=True)])
        jitter_s = np.where(seen, state.jitter_s - mean_s, 0.0)
        self.state = replace(state, clocks_s=clocks_s - clocks_s[0], jitter_s=jitter_s, Ts_world_board=boards)


def rows_of(names: Sequence[str], time_steps: Sequence[BoardTimeStep]) -> BoardObservations:
    """The corners of all time steps as rows.

    Parameters
    ----------
    names : of the cameras, in the order of their numbers.
    time_steps : with views by camera name.

    Returns
    -------
    One row a corner; how late each image is against its time step comes from the stamps.
    """
    index = {name: i for i, name in enumerate(names)}
    views = [{index[name]: view for name, view in time_step.views.items()} for time_step in time_steps]
    return observations_of(views, [time_step.stamp_ns for time_step in time_steps])


def view_errors(time_steps: Sequence[BoardTimeStep], residuals_px: np.ndarray) -> dict[tuple[int, str], float]:
    """Errors of single views.

    Parameters
    ----------
    time_steps : with views by camera name.
    residuals_px : (m, 2) in the order of `rows_of`.

    Returns
    -------
    (time step, camera) -> rms distance in the image, pixels.
    """
    errors, begin = {}, 0
    for k, time_step in enumerate(time_steps):
        for name, view in time_step.views.items():
            part = residuals_px[begin : begin + len(view.ids)]
            errors[k, name] = float(np.sqrt((part**2).sum(axis=1).mean()))
            begin += len(view.ids)
    return errors
