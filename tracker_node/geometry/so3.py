"""Rotations: SO(3) matrices and rotation vectors (radians).

Everything here is exact near the identity (series below 1e-4 rad) and near pi (the logarithm uses the symmetric part).

Quaternions of files and messages; the order of the components is always in the name.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..compiled.kernels import compiled

_SMALL = 1e-4


def hat(v: np.ndarray) -> np.ndarray:
    """Skew matrix [v]x with [v]x w = v x w. ``v`` (..., 3) -> (..., 3, 3)."""
    v = np.asarray(v, dtype=np.float64)
    m = np.zeros((*v.shape[:-1], 3, 3))
    m[..., 0, 1], m[..., 0, 2], m[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    m[..., 1, 0], m[..., 2, 0], m[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return m


def exp(rotation_vector: npt.ArrayLike) -> np.ndarray:
    """Rotation matrix (3, 3) of a rotation vector (3,), Rodrigues' formula."""
    return exp_kernel(np.ascontiguousarray(rotation_vector, dtype=np.float64))


def log(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) with angle in [0, pi] of a rotation matrix (3, 3)."""
    return log_kernel(np.ascontiguousarray(rotation, dtype=np.float64))


def left_jacobian(rotation_vector: np.ndarray) -> np.ndarray:
    """(3, 3) J with exp(w + d) = exp(J d + O(d^2)) exp(w)."""
    return left_jacobian_kernel(np.ascontiguousarray(rotation_vector, dtype=np.float64))


def left_jacobian_inverse(rotation_vector: np.ndarray) -> np.ndarray:
    """(3, 3) J with log(exp(d) exp(w)) = w + J d + O(d^2), for angles below 2 pi."""
    return left_jacobian_inverse_kernel(np.ascontiguousarray(rotation_vector, dtype=np.float64))


@compiled
def _series(w, a, b):
    """I + a [w]x + b [w]x [w]x."""
    x, y, z = w[0], w[1], w[2]
    m = np.empty((3, 3))
    m[0, 0], m[1, 1], m[2, 2] = 1.0 - b * (y * y + z * z), 1.0 - b * (x * x + z * z), 1.0 - b * (x * x + y * y)
    m[0, 1], m[1, 0] = b * x * y - a * z, b * x * y + a * z
    m[0, 2], m[2, 0] = b * x * z + a * y, b * x * z - a * y
    m[1, 2], m[2, 1] = b * y * z - a * x, b * y * z + a * x
    return m


@compiled
def exp_kernel(w):
    """`exp`, for kernels."""
    angle_sq = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    angle = math.sqrt(angle_sq)
    if angle < _SMALL:
        return _series(w, 1.0 - angle_sq / 6.0, 0.5 - angle_sq / 24.0)
    return _series(w, math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle_sq)


@compiled
def log_kernel(r):
    """`log`, for kernels."""
    v = np.empty(3)  # sin(angle) * axis
    v[0], v[1], v[2] = 0.5 * (r[2, 1] - r[1, 2]), 0.5 * (r[0, 2] - r[2, 0]), 0.5 * (r[1, 0] - r[0, 1])
    sine = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if sine > 1e-5:
        return v * (angle / sine)
    if cosine > 0.0:
        return v * (1.0 + angle * angle / 6.0)
    # Near pi: R + R^T - 2 cos I = 2 (1 - cos) axis axis^T; the largest column gives the axis.
    outer = 0.5 * (r + r.T)
    column = 0
    for i in range(3):
        outer[i, i] -= cosine
        if outer[i, i] > outer[column, column]:
            column = i
    axis = outer[:, column] / math.sqrt(outer[0, column] ** 2 + outer[1, column] ** 2 + outer[2, column] ** 2)
    if axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2] < 0.0:
        angle = -angle
    return angle * axis


@compiled
def left_jacobian_kernel(w):
    """`left_jacobian`, for kernels."""
    angle_sq = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    angle = math.sqrt(angle_sq)
    if angle < _SMALL:
        return _series(w, 0.5 - angle_sq / 24.0, 1.0 / 6.0 - angle_sq / 120.0)
    return _series(w, (1.0 - math.cos(angle)) / angle_sq, (angle - math.sin(angle)) / (angle_sq * angle))


@compiled
def left_jacobian_inverse_kernel(w):
    """`left_jacobian_inverse`, for kernels."""
    angle_sq = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    angle = math.sqrt(angle_sq)
    if angle < _SMALL:
        return _series(w, -0.5, 1.0 / 12.0 + angle_sq / 720.0)
    return _series(w, -0.5, (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / angle_sq)


def from_somersault_tilt_twist(somersault: float, tilt: float, twist: float) -> np.ndarray:
    """Root orientation from successive rotations: R = Ry(somersault) Rx(tilt) Rz(twist).

    Body axes are x forward, y left, z up (REP-103).

    Parameters
    ----------
    somersault, tilt, twist : radians about the lateral, frontal and longitudinal axis; a forward somersault counts up.

    Returns
    -------
    R_world_root (3, 3).
    """
    sy, cy, sx, cx = math.sin(somersault), math.cos(somersault), math.sin(tilt), math.cos(tilt)
    sz, cz = math.sin(twist), math.cos(twist)
    return np.array([
        [cy * cz + sy * sx * sz, sy * sx * cz - cy * sz, sy * cx],
        [cx * sz, cx * cz, -sx],
        [cy * sx * sz - sy * cz, sy * sz + cy * sx * cz, cy * cx],
    ])  # fmt: skip


def to_somersault_tilt_twist(rotation: np.ndarray) -> tuple[float, float, float]:
    """Inverse of `from_somersault_tilt_twist`; tilt in [-pi/2, pi/2], at its ends twist is put to 0."""
    r = np.asarray(rotation, dtype=np.float64)
    tilt = float(np.arctan2(-r[1, 2], np.hypot(r[1, 0], r[1, 1])))
    if np.hypot(r[1, 0], r[1, 1]) < 1e-9:
        return float(np.arctan2(-r[2, 0], r[0, 0])), tilt, 0.0
    return float(np.arctan2(r[0, 2], r[2, 2])), tilt, float(np.arctan2(r[1, 0], r[1, 1]))


def from_roll_pitch_yaw(angles: npt.ArrayLike) -> np.ndarray:
    """Rotation matrix (3, 3) of fixed-axis roll, pitch, yaw (3,) in radians: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = (exp(angle * axis) for angle, axis in zip(np.asarray(angles, dtype=np.float64), np.eye(3), strict=True))
    return yaw @ pitch @ roll


def to_roll_pitch_yaw(rotation: np.ndarray) -> np.ndarray:
    """Inverse of `from_roll_pitch_yaw`, accurate at a pitch of 90 degrees too (then roll is arbitrary)."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    rest = rotation @ exp([-roll, 0.0, 0.0])  # = Rz Ry: the second column is that of Rz
    return np.array([roll, pitch, np.arctan2(-rest[0, 1], rest[1, 1])])


def xyzw_from_matrix(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion (x, y, z, w), w >= 0, of a rotation matrix (3, 3): the order of geometry_msgs/Quaternion."""
    r = np.asarray(rotation, dtype=np.float64)
    # The largest of the four squared components decides the branch, so no division is by a small number.
    squares = (
        1.0 + r[0, 0] + r[1, 1] + r[2, 2],
        1.0 + r[0, 0] - r[1, 1] - r[2, 2],
        1.0 - r[0, 0] + r[1, 1] - r[2, 2],
        1.0 - r[0, 0] - r[1, 1] + r[2, 2],
    )
    rows = (
        (r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], squares[0]),
        (squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]),
        (r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]),
        (r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3], r[1, 0] - r[0, 1]),
    )
    q = np.array(rows[int(np.argmax(squares))])
    q /= np.linalg.norm(q)
    return -q if q[3] < 0.0 else q


def matrix_from_xyzw(q_xyzw: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion (x, y, z, w), normalized first. Raises ValueError on zero length."""
    q = np.asarray(q_xyzw, dtype=np.float64)
    norm = np.linalg.norm(q)
    if not np.isfinite(norm) or norm < 1e-12:
        raise ValueError(f"expected a quaternion of non-zero finite length, got {q_xyzw}")
    x, y, z, w = q / norm
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
