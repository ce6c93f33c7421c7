"""Measures of poses that the literature compares by: pure functions of arrays.

Lengths are meters, angles radians. Arrays over time have the image set first; a mask (n, m) says where a joint counts. Means over
nothing are not-a-number.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .metrics import joint_errors, mean_error

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
