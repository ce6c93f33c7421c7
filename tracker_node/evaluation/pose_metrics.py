"""Measures of poses that the literature compares by, and of a run against true states: degrees of freedom and segments.

The measures are pure functions of arrays. Lengths are meters, angles radians. Arrays over time have the image set first; a mask
(n, m) says where a joint counts. Means over nothing are not-a-number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..model.articulated import ArticulatedModel
from ..model.configuration import N_ROOT, ROOT_NAMES, Configuration, State, variable_names
from ..render.opengl.tessellation import tessellate
from ..runs.data import RunData
from .metrics import Spread, joint_errors, mean_error, spread_of
from .truth.files import TrueStates, unwrapped

PCK_THRESHOLDS_M = (0.050, 0.100, 0.150)
PCK_AUC_M = 0.150  # up to where the area under the PCK curve is taken ...
PCK_AUC_STEPS = 31  # ... at so many thresholds, 0 among them
NEAR_M, NEAR_RAD = 0.05, np.deg2rad(5.0)  # 5 cm, 5 degrees
_MIN_JOINTS = 3  # fewer can be turned onto each other in many ways


def procrustes_aligned(estimate: np.ndarray, truth: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Every set's estimate, moved, turned and resized to lie on its truth as closely as possible.

    The least-squares solution of Umeyama, IEEE PAMI 13 (1991), eq. 40-42; it never mirrors.

    Parameters
    ----------
    estimate, truth : (n, m, 3) meters.
    valid : (n, m); joints that do not count have no part, but are moved with the others.

    Returns
    -------
    (n, m, 3); sets with fewer than three valid joints as they are.
    """
    enough = valid.sum(axis=1) >= _MIN_JOINTS
    weights = np.where(enough[:, None], valid, True).astype(np.float64)
    weights /= weights.sum(axis=1, keepdims=True)
    mean_estimate = np.einsum("nm,nmi->ni", weights, estimate)
    mean_truth = np.einsum("nm,nmi->ni", weights, truth)
    from_, to = estimate - mean_estimate[:, None], truth - mean_truth[:, None]
    U, D, Vt = np.linalg.svd(np.einsum("nm,nmi,nmj->nij", weights, to, from_))
    signs = np.ones_like(D)
    signs[:, 2] = np.where(np.linalg.det(U) * np.linalg.det(Vt) < 0, -1.0, 1.0)
    R = np.einsum("nij,nj,njk->nik", U, signs, Vt)
    variance = np.einsum("nm,nmi,nmi->n", weights, from_, from_)
    size = (D * signs).sum(axis=1) / np.where(variance > 0, variance, 1.0)
    aligned = size[:, None, None] * np.einsum("nij,nmj->nmi", R, from_) + mean_truth[:, None]
    return np.where(enough[:, None, None], aligned, estimate)


def pa_mpjpe(estimate: np.ndarray, truth: np.ndarray, valid: np.ndarray) -> float:
    """Mean joint error after `procrustes_aligned`: what is left is the pose of the joints, without place, heading and size.

    Known as protocol 2 of Human3.6M (Ionescu et al., IEEE PAMI 36, 2014). Sets with fewer than three valid joints do not count.

    Parameters
    ----------
    estimate, truth : (n, m, 3) meters.
    valid : (n, m).

    Returns
    -------
    Meters.
    """
    judged = valid.sum(axis=1) >= _MIN_JOINTS
    estimate, truth, valid = estimate[judged], truth[judged], valid[judged]
    return mean_error(joint_errors(procrustes_aligned(estimate, truth, valid), truth), valid)


def pck(errors: np.ndarray, valid: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """Percentage of correct keypoints: fraction of the valid errors that are at most each of some thresholds.

    In three dimensions with 150 mm: Mehta et al., 3DV 2017.

    Parameters
    ----------
    errors : (n, m) meters.
    valid : (n, m).
    thresholds : (k,) meters.

    Returns
    -------
    (k,), 0..1.
    """
    judged = np.sort(errors[valid])
    if not len(judged):
        return np.full(len(thresholds), np.nan)
    return np.searchsorted(judged, thresholds, side="right") / len(judged)


def pck_auc(errors: np.ndarray, valid: np.ndarray) -> float:
    """Mean of `pck` over thresholds from 0 to 150 mm in steps of 5 (Mehta et al., 3DV 2017).

    Parameters
    ----------
    errors : (n, m) meters.
    valid : (n, m).

    Returns
    -------
    0..1; 1 is perfect.
    """
    return float(pck(errors, valid, np.linspace(0.0, PCK_AUC_M, PCK_AUC_STEPS)).mean())


def direction_errors(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Angles between vectors.

    Parameters
    ----------
    estimate, truth : (..., 3) of any length.

    Returns
    -------
    (...) radians; NaN for a vector of no length.
    """
    cross = np.linalg.norm(np.cross(estimate, truth), axis=-1)
    dot = (estimate * truth).sum(axis=-1)
    angles = np.arctan2(cross, dot)
    return np.where((cross == 0.0) & (dot == 0.0), np.nan, angles)


def rotation_errors(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Angles of the rotations that lead from one to the other: |A - B|_F = 2 sqrt(2) sin(angle / 2).

    Parameters
    ----------
    estimate, truth : (..., 3, 3).

    Returns
    -------
    (...) radians.
    """
    chord = np.linalg.norm(estimate - truth, axis=(-2, -1))
    return 2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))


def add_errors(estimate: np.ndarray, truth: np.ndarray, points: np.ndarray) -> np.ndarray:
    """ADD: mean distance of the model's points in the estimated pose to the same points in the true one.

    Hinterstoisser et al., ACCV 2012, eq. 3.

    Parameters
    ----------
    estimate, truth : (n, 4, 4) poses of the model.
    points : (k, 3) on its surface, in its own frame, meters.

    Returns
    -------
    (n,) meters.
    """
    return np.array([joint_errors(_moved(a, points), _moved(b, points)).mean() for a, b in zip(estimate, truth, strict=True)])


def add_s_errors(estimate: np.ndarray, truth: np.ndarray, points: np.ndarray) -> np.ndarray:
    """ADD-S: the same to the nearest point, for bodies that look alike from several sides.

    Hinterstoisser et al., ACCV 2012, eq. 4: from every point in the true pose to the nearest one in the estimated pose.

    Parameters
    ----------
    estimate, truth, points : as of `add_errors`.

    Returns
    -------
    (n,) meters.
    """
    tree = cKDTree(points)
    back = [np.linalg.inv(a) @ b for a, b in zip(estimate, truth, strict=True)]
    return np.array([tree.query(_moved(T, points))[0].mean() for T in back])


def fraction_near(position_errors: np.ndarray, rotation_errors: np.ndarray) -> float:
    """Fraction of the poses within 5 cm and 5 degrees of truth (Shotton et al., CVPR 2013).

    Parameters
    ----------
    position_errors : (n,) meters.
    rotation_errors : (n,) radians.

    Returns
    -------
    0..1; NaN without poses.
    """
    if not len(position_errors):
        return float("nan")
    return float(((position_errors <= NEAR_M) & (rotation_errors <= NEAR_RAD)).mean())


def mean_rotation(rotations: np.ndarray) -> np.ndarray:
    """(3, 3) the rotation with the least sum of squared distances to (n, 3, 3) (chordal mean; Hartley et al., IJCV 103, 2013)."""
    U, _, Vt = np.linalg.svd(rotations.mean(axis=0))
    return U @ np.diag([1.0, 1.0, np.linalg.det(U) * np.linalg.det(Vt)]) @ Vt


def _moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ T[:3, :3].T + T[:3, 3]


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

    @property
    def misfit(self) -> float:
        """Mean over the variables of what is left without constant offsets; infinite where nothing is in common."""
        left = [self.spreads(k)[1].rms for k in range(len(self.names)) if self.valid[:, k].any()]
        return float(np.mean(left)) if left else float("inf")


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
    turns = np.array([name not in "xyz" and name not in model.chain.slides for name in order])
    scale = np.where(turns, np.degrees(1.0), 1e3)
    tracked, true = unwrapped(run.values, near)[:, mine] * scale, truth.values[:, theirs] * scale
    valid = truth.valid[:, theirs] & run.has_state[:, None]
    tracked -= np.where(turns, _WHOLE_TURN * np.round((tracked - true) / _WHOLE_TURN), 0.0) * valid
    units = tuple("deg" if turn else "mm" for turn in turns)
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
