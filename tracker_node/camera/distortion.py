"""Lens distortion of normalized image coordinates, with derivatives (numba kernels, and their ids).

Models and coefficient orders are those of sensor_msgs/CameraInfo and OpenCV:

=====================  ==============================================
``none``               (no coefficients)
``plumb_bob``          k1 k2 p1 p2 k3
``rational_polynomial``k1 k2 p1 p2 k3 k4 k5 k6
``equidistant``        k1 k2 k3 k4 (fisheye, Kannala-Brandt)
=====================  ==============================================
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import compiled

MODEL_IDS = {"none": 0, "plumb_bob": 1, "rational_polynomial": 1, "equidistant": 2}
COEFFICIENT_COUNTS = {"none": (0,), "plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}
N_PACKED = 8  # coefficients, padded with zeros


def used_coefficients(model: str, coefficients: np.ndarray) -> np.ndarray:
    """Those of a lens, without the zeros that OpenCV has behind them for prisms and tilts (12 or 14 in all).

    Parameters
    ----------
    model, coefficients : one of `MODEL_IDS`; (n,) of it.

    Returns
    -------
    (8,) of a rational polynomial whose others are zero; else as given.
    """
    return coefficients[:N_PACKED] if model == "rational_polynomial" and not coefficients[N_PACKED:].any() else coefficients


@compiled
def distort(model_id, k, x, y):
    """Distorted coordinates of a point, and their derivative.

    Parameters
    ----------
    model_id, k : one of `MODEL_IDS`, and its coefficients (`N_PACKED`,), padded with zeros.
    x, y : normalized image coordinates.

    Returns
    -------
    (xd, yd, xd_x, xd_y, yd_x, yd_y).
    """
    if model_id == 0:
        return x, y, 1.0, 0.0, 0.0, 1.0
    r2 = x * x + y * y
    if model_id == 1:
        top = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
        bottom = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
        radial = top / bottom
        top_r2 = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4])
        bottom_r2 = k[5] + r2 * (2.0 * k[6] + r2 * 3.0 * k[7])
        radial_r2 = (top_r2 - radial * bottom_r2) / bottom
        p1, p2 = k[2], k[3]
        xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        cross = 2.0 * x * y * radial_r2 + 2.0 * p1 * x + 2.0 * p2 * y
        return (
            xd,
            yd,
            radial + 2.0 * x * x * radial_r2 + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            radial + 2.0 * y * y * radial_r2 + 6.0 * p1 * y + 2.0 * p2 * x,
        )
    r = math.sqrt(r2)
    if r < 1e-8:
        return x, y, 1.0, 0.0, 0.0, 1.0
    theta = math.atan(r)
    t2 = theta * theta
    theta_d = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
    theta_d_theta = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])))
    scale = theta_d / r
    scale_r = (theta_d_theta / (1.0 + r2) - scale) / r
    return (
        x * scale,
        y * scale,
        scale + x * x * scale_r / r,
        x * y * scale_r / r,
        x * y * scale_r / r,
        scale + y * y * scale_r / r,
    )


@compiled
def undistort(model_id, k, xd, yd):
    """Newton inverse of `distort`.

    Parameters
    ----------
    model_id, k : one of `MODEL_IDS`, and its coefficients (`N_PACKED`,), padded with zeros.
    xd, yd : distorted normalized coordinates.

    Returns
    -------
    (x, y, converged).
    """
    x, y = xd, yd
    if model_id == 2:  # start from the inverse of the pure equidistant map, since tan() is far from linear
        rd = math.sqrt(xd * xd + yd * yd)
        if rd > 1e-8 and rd < 1.5:
            x, y = xd * math.tan(rd) / rd, yd * math.tan(rd) / rd
    for _ in range(30):
        px, py, a, b, c, d = distort(model_id, k, x, y)
        ex, ey = px - xd, py - yd
        det = a * d - b * c
        if det <= 0.0:
            return x, y, False
        x -= (d * ex - b * ey) / det
        y -= (a * ey - c * ex) / det
        if ex * ex + ey * ey < 1e-24:
            return x, y, True
    px, py, _, _, _, _ = distort(model_id, k, x, y)
    return x, y, (px - xd) ** 2 + (py - yd) ** 2 < 1e-16


def monotonic_radius(model_id: int, k: np.ndarray) -> float:
    """Largest radius up to which distortion keeps points in order; beyond it the polynomial folds back.

    Parameters
    ----------
    model_id, k : one of `MODEL_IDS`, and its coefficients (`N_PACKED`,).

    Returns
    -------
    Radius in normalized coordinates; infinite if nothing folds up to 8.
    """
    if model_id == 0:
        return np.inf
    return float(_first_fold(model_id, k, np.linspace(0.0, 8.0, 4001)[1:]))


@compiled
def _first_fold(model_id, k, radii):
    for i in range(radii.size):
        _, _, slope, _, _, _ = distort(model_id, k, radii[i], 0.0)
        if slope <= 0.02:
            return radii[i]
    return np.inf
