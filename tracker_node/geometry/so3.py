"""Rotations: SO(3) matrices and rotation vectors (radians).

Everything here is exact near the identity (series below 1e-4 rad) and near pi (the logarithm uses the symmetric part).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

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
    w = np.asarray(rotation_vector, dtype=np.float64)
    angle_sq = float(w @ w)
    angle = np.sqrt(angle_sq)
    if angle < _SMALL:
        a, b = 1.0 - angle_sq / 6.0, 0.5 - angle_sq / 24.0
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle_sq
    k = hat(w)
    return np.eye(3) + a * k + b * (k @ k)


def log(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) with angle in [0, pi] of a rotation matrix (3, 3)."""
    r = np.asarray(rotation, dtype=np.float64)
    v = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])  # sin(angle) * axis
    sine = float(np.linalg.norm(v))
    cosine = 0.5 * (float(np.trace(r)) - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > 1e-5:
        return v * (angle / sine)
    if cosine > 0.0:
        return v * (1.0 + angle * angle / 6.0)
    # Near pi: R + R^T - 2 cos I = 2 (1 - cos) axis axis^T; the largest column gives the axis.
    outer = 0.5 * (r + r.T) - cosine * np.eye(3)
    column = int(np.argmax(np.diag(outer)))
    axis = outer[:, column] / np.linalg.norm(outer[:, column])
    if axis @ v < 0.0:
        axis = -axis
    return angle * axis


def left_jacobian(rotation_vector: np.ndarray) -> np.ndarray:
    """(3, 3) J with exp(w + d) = exp(J d + O(d^2)) exp(w)."""
    w = np.asarray(rotation_vector, dtype=np.float64)
    angle_sq = float(w @ w)
    angle = np.sqrt(angle_sq)
    if angle < _SMALL:
        b, c = 0.5 - angle_sq / 24.0, 1.0 / 6.0 - angle_sq / 120.0
    else:
        b, c = (1.0 - np.cos(angle)) / angle_sq, (angle - np.sin(angle)) / (angle_sq * angle)
    k = hat(w)
    return np.eye(3) + b * k + c * (k @ k)


def left_jacobian_inverse(rotation_vector: np.ndarray) -> np.ndarray:
    """(3, 3) J with log(exp(d) exp(w)) = w + J d + O(d^2), for angles below 2 pi."""
    w = np.asarray(rotation_vector, dtype=np.float64)
    angle_sq = float(w @ w)
    angle = np.sqrt(angle_sq)
    k = hat(w)
    d = 1.0 / 12.0 + angle_sq / 720.0 if angle < _SMALL else (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle_sq
    return np.eye(3) - 0.5 * k + d * (k @ k)


def from_axis_angle(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation matrix about a unit ``axis`` (3,) by ``angle`` radians."""
    return exp(np.asarray(axis, dtype=np.float64) * angle)


def from_somersault_tilt_twist(somersault: float, tilt: float, twist: float) -> np.ndarray:
    """Root orientation from successive rotations about the lateral (y), frontal (x) and longitudinal (z) axes.

    Radians; R = Ry(somersault) Rx(tilt) Rz(twist), body axes x forward, y left, z up (REP-103). With a rotation of +1 rad
    the somersault is forward (the head moves along +x).
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
