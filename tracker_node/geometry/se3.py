"""Rigid transforms: SE(3) as 4x4 matrices, twists (v, omega) with the linear part first (REP-103 order)."""

from __future__ import annotations

import numpy as np

from . import so3


def from_rotation_translation(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Rigid transform with p_target = rotation @ p_source + translation.

    Parameters
    ----------
    rotation, translation : (3, 3); (3,) meters.

    Returns
    -------
    T_target_source (4, 4).
    """
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = translation
    return transform


def inverse(transform: np.ndarray) -> np.ndarray:
    """T_source_target of T_target_source, exact for rigid transforms. Stacks (..., 4, 4) allowed."""
    transform = np.asarray(transform, dtype=np.float64)
    result = np.zeros_like(transform)
    rotation_t = np.swapaxes(transform[..., :3, :3], -1, -2)
    result[..., :3, :3] = rotation_t
    result[..., :3, 3] = -(rotation_t @ transform[..., :3, 3:])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def apply(transform: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points mapped by one transform.

    Parameters
    ----------
    transform, points : T_target_source (4, 4); (..., 3) meters in the source frame.

    Returns
    -------
    (..., 3) meters in the target frame.
    """
    return np.asarray(points, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]


def exp(twist: np.ndarray) -> np.ndarray:
    """T (4, 4) of a twist (6,) = (v, omega)."""
    twist = np.asarray(twist, dtype=np.float64)
    v, w = twist[:3], twist[3:]
    angle_sq = float(w @ w)
    angle = np.sqrt(angle_sq)
    if angle < 1e-4:
        b, c = 0.5 - angle_sq / 24.0, 1.0 / 6.0 - angle_sq / 120.0
    else:
        b, c = (1.0 - np.cos(angle)) / angle_sq, (angle - np.sin(angle)) / (angle_sq * angle)
    k = so3.hat(w)
    return from_rotation_translation(so3.exp(w), (np.eye(3) + b * k + c * (k @ k)) @ v)


def log(transform: np.ndarray) -> np.ndarray:
    """Twist (6,) = (v, omega) of a transform (4, 4), rotation angle in [0, pi]."""
    w = so3.log(transform[:3, :3])
    angle_sq = float(w @ w)
    angle = np.sqrt(angle_sq)
    if angle < 1e-4:
        d = 1.0 / 12.0 + angle_sq / 720.0
    else:  # (1 + cos) / sin = 1 / tan(angle / 2), which is as good at pi as elsewhere
        d = 1.0 / angle_sq - 0.5 / (angle * np.tan(0.5 * angle))
    k = so3.hat(w)
    v = (np.eye(3) - 0.5 * k + d * (k @ k)) @ transform[:3, 3]
    return np.concatenate([v, w])


def is_rigid(transform: np.ndarray, tolerance: float = 1e-6) -> bool:
    """Whether a matrix is a proper rotation with a translation.

    Parameters
    ----------
    transform : of any shape.
    tolerance : of each entry of R R^T and of the last row, which is to be (0, 0, 0, 1).

    Returns
    -------
    False also for other shapes than (4, 4), reflections, and entries that are not finite.
    """
    transform = np.asarray(transform)
    if transform.shape != (4, 4) or not np.all(np.isfinite(transform)):
        return False
    rotation = transform[:3, :3]
    return bool(
        np.allclose(transform[3], [0.0, 0.0, 0.0, 1.0], atol=tolerance)
        and np.allclose(rotation @ rotation.T, np.eye(3), atol=tolerance)
        and np.linalg.det(rotation) > 0.0
    )


def nearest_rigid(transform: np.ndarray) -> np.ndarray:
    """The transform itself if it is rigid, else (rounded digits in a file) the nearest that is."""
    if is_rigid(transform, tolerance=1e-9):
        return transform
    u, _, vt = np.linalg.svd(transform[:3, :3])
    return from_rotation_translation(u @ vt, transform[:3, 3])


def scaled(transforms: np.ndarray, factor: float) -> np.ndarray:
    """Transforms with their translations multiplied: poses in a world of another size.

    Parameters
    ----------
    transforms, factor : (..., 4, 4); a number.

    Returns
    -------
    (..., 4, 4) copies.
    """
    result = np.array(transforms)
    result[..., :3, 3] *= factor
    return result


def rigid_fit(source: np.ndarray, target: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Rigid transform between two point sets, by least squares (Kabsch 1976, proper rotation).

    Parameters
    ----------
    source, target : (n, 3) meters, the same points in two frames.
    weights : (n,) of the points; None: all the same.

    Returns
    -------
    T_target_source (4, 4) with ``T @ source ~ target``.
    """
    source_mean, target_mean = (np.average(points, axis=0, weights=weights) for points in (source, target))
    goal = target - target_mean
    u, _, vt = np.linalg.svd((goal if weights is None else weights[:, None] * goal).T @ (source - source_mean))
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return from_rotation_translation(rotation, target_mean - rotation @ source_mean)
