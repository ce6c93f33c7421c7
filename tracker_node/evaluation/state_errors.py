"""A run against true states: errors per degree of freedom as the color paper tells them, and of every segment's pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import N_ROOT, ROOT_NAMES, Configuration, State, variable_names
from ..render.opengl.tessellation import tessellate
from ..runs.data import RunData
from .metrics import Spread, spread_of
from .pose_metrics import add_errors, add_s_errors, mean_rotation, rotation_errors
from .truth.states import TrueStates, unwrapped

# Trewartha, Yeadon & Knight, Table 1: in this order, under these names
ROWS = {"z": "vertical", "x": "A-P", "y": "lateral", "somersault": "somersault", "tilt": "tilt", "twist": "twist"}
_WHOLE_TURN = 360.0


@dataclass(frozen=True, eq=False)
class StateErrors:
    """Signed errors per degree of freedom, n image sets, k variables: those of the root first, in the order of the paper.

    Parameters
    ----------
    names, units : (k,), "mm" or "deg".
    tracked, truth : (n, k) in these units. valid : (n, k).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    tracked: np.ndarray
    truth: np.ndarray
    valid: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """(n, k) tracked minus true."""
        return np.where(self.valid, self.tracked - self.truth, np.nan)

    def range_of_motion(self, k: int) -> float:
        """Of the truth, where it is valid."""
        seen = self.truth[self.valid[:, k], k]
        return float(np.ptp(seen)) if len(seen) else float("nan")

    def offset(self, k: int) -> float:
        """Mean error: the constant that leaves the smallest sum of squares."""
        seen = self.errors[self.valid[:, k], k]
        return float(seen.mean()) if len(seen) else float("nan")

    def spreads(self, k: int) -> tuple[Spread, Spread]:
        """Of a variable's errors, as they are and without their constant offset."""
        errors = self.errors[:, k]
        return spread_of(errors, self.valid[:, k]), spread_of(errors - self.offset(k), self.valid[:, k])


@dataclass(frozen=True, eq=False)
class SegmentErrors:
    """Errors of the poses of l segments: positions (n, l) in mm and angles (n, l) in degrees, where ``valid`` (n,).

    ``free_...``: without one constant pose per segment, fixed in it.
    """

    names: tuple[str, ...]
    valid: np.ndarray
    position_mm: np.ndarray
    angle_deg: np.ndarray
    free_position_mm: np.ndarray
    free_angle_deg: np.ndarray


@dataclass(frozen=True, eq=False)
class RigidErrors:
    """ADD and ADD-S of a body of one segment, (n,) mm, NaN where there is no truth."""

    add_mm: np.ndarray
    add_s_mm: np.ndarray


def state_errors(run: RunData, model: ArticulatedModel, truth: TrueStates) -> StateErrors:
    """Errors of the variables that run and truth both have.

    Parameters
    ----------
    run : states over time.
    model : body of the run.
    truth : a row for every image set of the run.

    Returns
    -------
    In millimeters and degrees.
    """
    have = variable_names(model)
    order = [name for name in (*ROWS, *have[N_ROOT:]) if name in truth.names]
    mine, theirs = [have.index(name) for name in order], [truth.names.index(name) for name in order]
    near: list[np.ndarray | None] = [None] * len(run)
    if set(ROOT_NAMES) <= set(truth.names):
        root = [truth.names.index(name) for name in ROOT_NAMES]
        near = [row[root] if ok else None for row, ok in zip(truth.values, np.all(truth.valid[:, root], axis=1), strict=True)]
    scale = np.array([1e3 if name in "xyz" else np.degrees(1.0) for name in order])
    tracked, true = unwrapped(run.values, near)[:, mine] * scale, truth.values[:, theirs] * scale
    valid = truth.valid[:, theirs] & run.has_state[:, None]
    turns = np.array([name not in "xyz" for name in order])
    tracked -= np.where(turns, _WHOLE_TURN * np.round((tracked - true) / _WHOLE_TURN), 0.0) * valid
    units = tuple("mm" if name in "xyz" else "deg" for name in order)
    return StateErrors(tuple(ROWS.get(name, name) for name in order), units, tracked, true, valid)


def segment_errors(run: RunData, model: ArticulatedModel, truth: Sequence[State | None]) -> SegmentErrors:
    """Errors of the segments' poses.

    Parameters
    ----------
    run : states over time.
    model : body of the run.
    truth : (n,) the true state of each image set of the run, or None.

    Returns
    -------
    In millimeters and degrees, with and without one constant pose per segment.
    """
    valid = np.array([state is not None for state in truth])
    links = model.chain.links
    shape = (len(run), len(links))
    position, angle, free_position, free_angle = (np.full(shape, np.nan) for _ in range(4))
    tracked, true = link_poses(run, model, truth)
    for k in range(len(links)):
        T, B = tracked[:, k], true[:, k]
        position[valid, k] = 1e3 * np.linalg.norm(T[:, :3, 3] - B[:, :3, 3], axis=1)
        angle[valid, k] = np.degrees(rotation_errors(T[:, :3, :3], B[:, :3, :3]))
        moved = _without_offset(T, B)
        free_position[valid, k] = 1e3 * np.linalg.norm(moved[:, :3, 3] - B[:, :3, 3], axis=1)
        free_angle[valid, k] = np.degrees(rotation_errors(moved[:, :3, :3], B[:, :3, :3]))
    return SegmentErrors(links, valid, position, angle, free_position, free_angle)


def rigid_errors(run: RunData, model: ArticulatedModel, truth: Sequence[State | None]) -> RigidErrors | None:
    """ADD and ADD-S over the points of the surface.

    Parameters
    ----------
    run, model, truth : as of `segment_errors`.

    Returns
    -------
    None for a body of several segments.
    """
    if len(model.chain.links) != 1:
        return None
    valid = np.array([state is not None for state in truth])
    tracked, true = (poses[:, 0] for poses in link_poses(run, model, truth))
    add, add_s = np.full(len(run), np.nan), np.full(len(run), np.nan)
    points = surface_points(model)
    add[valid], add_s[valid] = 1e3 * add_errors(tracked, true, points), 1e3 * add_s_errors(tracked, true, points)
    return RigidErrors(add, add_s)


def link_poses(run: RunData, model: ArticulatedModel, truth: Sequence[State | None]) -> tuple[np.ndarray, np.ndarray]:
    """Poses of all links in the image sets that have a true state.

    Parameters
    ----------
    run, model, truth : as of `segment_errors`.

    Returns
    -------
    tracked, true : (k, n_links, 4, 4) world from link.
    """
    pairs = [(run.configuration(model, i), Configuration(model, state)) for i, state in enumerate(truth) if state is not None]
    empty = np.zeros((0, len(model.chain.links), 4, 4))
    poses = [[pair[side].Ts_world_link for pair in pairs] for side in (0, 1)]
    return (np.array(poses[0]), np.array(poses[1])) if pairs else (empty, empty)


def surface_points(model: ArticulatedModel) -> np.ndarray:
    """(k, 3) points on the surface of a body of one segment, in its frame."""
    points = []
    for shape in model.shapes:
        vertices = np.concatenate([patch.vertices for patch in tessellate(shape.primitive, (0, 0, 0))])
        points.append(vertices @ shape.T_link_shape[:3, :3].T + shape.T_link_shape[:3, 3])
    return np.unique(np.concatenate(points).round(9), axis=0)


def _without_offset(tracked: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """``tracked`` (n, 4, 4) times the constant pose that brings it nearest to ``truth``: mean rotation, then mean translation."""
    if not len(tracked):
        return tracked
    offset = np.eye(4)
    turned = np.swapaxes(tracked[:, :3, :3], 1, 2)
    offset[:3, :3] = mean_rotation(turned @ truth[:, :3, :3])
    offset[:3, 3] = np.einsum("nij,nj->ni", turned, truth[:, :3, 3] - tracked[:, :3, 3]).mean(axis=0)
    return tracked @ offset
