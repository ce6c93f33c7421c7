"""Round cones: all that a sphere covers whose center goes straight from one point to another while its radius changes evenly.

One is a row of `N_CAPSULE` numbers, meters; where its radius stays, it is a capsule.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

START, START_RADIUS, END, END_RADIUS, N_CAPSULE = 0, 3, 4, 7, 8


@nb.njit(cache=True, nogil=True, error_model="numpy")
def nearest_on(cone, x, y, z):
    """Place on a round cone whose sphere's surface is nearest to a point.

    With t0 the foot of the perpendicular of length h on the axis of length l, and the radius growing by r over it, the distance
    is least at t0 + r h / (l sqrt(l^2 - r^2)).

    Parameters
    ----------
    cone : (`N_CAPSULE`,) meters.
    x, y, z : of the point, meters.

    Returns
    -------
    0 at the cone's start, 1 at its end.
    """
    dx, dy, dz = cone[END] - cone[START], cone[END + 1] - cone[START + 1], cone[END + 2] - cone[START + 2]
    wx, wy, wz = x - cone[START], y - cone[START + 1], z - cone[START + 2]
    grows = cone[END_RADIUS] - cone[START_RADIUS]
    length_sq = dx * dx + dy * dy + dz * dz
    if length_sq <= grows * grows + 1e-18:  # one end's sphere holds all
        return 1.0 if grows > 0.0 else 0.0
    foot = (wx * dx + wy * dy + wz * dz) / length_sq
    height = math.sqrt(max(wx * wx + wy * wy + wz * wz - foot * foot * length_sq, 0.0))
    return min(max(foot + grows * height / math.sqrt(length_sq * (length_sq - grows * grows)), 0.0), 1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def point_gap(cone, x, y, z):
    """Distance of a point from the surface of a round cone.

    Parameters
    ----------
    cone : (`N_CAPSULE`,) meters.
    x, y, z : of the point, meters.

    Returns
    -------
    Meters; negative within it.
    """
    t, square = nearest_on(cone, x, y, z), 0.0
    for i, value in enumerate((x, y, z)):
        d = cone[START + i] + t * (cone[END + i] - cone[START + i]) - value
        square += d * d
    return math.sqrt(square) - cone[START_RADIUS] - t * (cone[END_RADIUS] - cone[START_RADIUS])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def point_gaps(cones, points, out):
    """Fill ``out`` with the distance of each point from the nearest of some round cones.

    Parameters
    ----------
    cones, points : (n_cones, `N_CAPSULE`) and (n_points, 3), meters.
    out : (n_points,) meters, negative within a cone.
    """
    for j in range(points.shape[0]):
        out[j] = np.inf
        for i in range(cones.shape[0]):
            out[j] = min(out[j], point_gap(cones[i], points[j, 0], points[j, 1], points[j, 2]))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def count_held(cones, points, out):
    """Fill ``out`` with the number of points within each round cone.

    Parameters
    ----------
    cones, points : (n_cones, `N_CAPSULE`) and (n_points, 3), meters.
    out : (n_cones,) integers.
    """
    for i in range(cones.shape[0]):
        out[i] = 0
        for j in range(points.shape[0]):
            if point_gap(cones[i], points[j, 0], points[j, 1], points[j, 2]) < 0.0:
                out[i] += 1
