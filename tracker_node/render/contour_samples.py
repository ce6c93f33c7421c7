"""All contour samples of a body that one camera sees, in one list."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from ..camera.camera_model import project_point
from .contour import (
    HIDDEN,
    N_COLUMNS,
    NORMAL,
    OUTER,
    SAMPLES,
    P,
    classify_sample_beyond,
    draw_contour,
    nearby_shapes,
    solid_interval,
)
from .contour_picks import IS_CREASE, N_PICK_COLUMNS

# Columns of ``pixels``: u, v, depth, unit normal in the image, derivative of (u, v) by the point in the camera frame (2 x 3)
U, V, DEPTH, NU, NV, JACOBIAN = 0, 1, 2, 3, 4, 5
N_PIXEL_COLUMNS = 11
# Columns of ``info``: index of shape and link, `OUTER` or `INNER`, index of the shape seen just beyond the contour (-1: none)
SHAPE, LINK, CLASS, BEYOND = range(4)
N_INFO_COLUMNS = 4


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_sample(params, R, t, row, pixel):
    """Fill ``pixel`` (`N_PIXEL_COLUMNS`,) for a contour sample ``row``; False where the camera cannot see that far aside."""
    x = R[0, 0] * row[P] + R[0, 1] * row[P + 1] + R[0, 2] * row[P + 2] + t[0]
    y = R[1, 0] * row[P] + R[1, 1] * row[P + 1] + R[1, 2] * row[P + 2] + t[1]
    z = R[2, 0] * row[P] + R[2, 1] * row[P + 1] + R[2, 2] * row[P + 2] + t[2]
    ok, u, v, ux, uy, uz, vx, vy, vz = project_point(params, x, y, z)
    if not ok:
        return False
    nx = R[0, 0] * row[NORMAL] + R[0, 1] * row[NORMAL + 1] + R[0, 2] * row[NORMAL + 2]
    ny = R[1, 0] * row[NORMAL] + R[1, 1] * row[NORMAL + 1] + R[1, 2] * row[NORMAL + 2]
    nz = R[2, 0] * row[NORMAL] + R[2, 1] * row[NORMAL + 1] + R[2, 2] * row[NORMAL + 2]
    nu, nv = ux * nx + uy * ny + uz * nz, vx * nx + vy * ny + vz * nz
    norm = math.sqrt(nu * nu + nv * nv)
    pixel[U], pixel[V], pixel[DEPTH], pixel[NU], pixel[NV] = u, v, z, nu / norm, nv / norm
    pixel[JACOBIAN], pixel[JACOBIAN + 1], pixel[JACOBIAN + 2] = ux, uy, uz
    pixel[JACOBIAN + 3], pixel[JACOBIAN + 4], pixel[JACOBIAN + 5] = vx, vy, vz
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def collect_samples(shapes, Ts, spheres, camera, n_samples, outward_px, rows, pixels, info):
    """Fill one row for every contour sample that the camera sees; returns their number.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    Ts : (n_shapes, 4, 4) world from shape. spheres : (n_shapes, 4) of `contour.world_spheres`.
    camera : (params, R_cam_world, t_cam_world, center).
    n_samples : samples of one generator line.
    outward_px : how far beyond the contour it is decided what lies there.
    rows : (n, `N_COLUMNS`) of `contour`. pixels : (n, `N_PIXEL_COLUMNS`). info : (n, `N_INFO_COLUMNS`) int32.
    """
    params, R, t, center = camera
    n_shapes = shapes[0].shape[0]
    found, picks = np.empty((SAMPLES * n_samples, N_COLUMNS)), np.empty((SAMPLES * n_samples, N_PICK_COLUMNS))
    n_picks, nearby = np.zeros(n_shapes, dtype=np.int64), np.empty(n_shapes, dtype=np.int64)
    n = 0
    for shape in range(n_shapes):
        count = draw_contour(shapes, shape, Ts[shape], center, n_samples, True, picks, n_picks, found)
        if count == 0:
            continue
        n_nearby = nearby_shapes(spheres, center, shape, nearby)
        for j in range(count):
            row, pixel = found[j], pixels[n]
            if not project_sample(params, R, t, row, pixel):
                continue
            outward = outward_px * pixel[DEPTH] / params[0]
            crease = j < n_picks[shape] and picks[j, IS_CREASE] != 0.0
            kind, beyond = classify_sample_beyond(shapes, shape, Ts, spheres, nearby, n_nearby, center, row, crease, outward)
            if kind == HIDDEN:
                continue
            rows[n] = row
            info[n, SHAPE], info[n, LINK], info[n, CLASS], info[n, BEYOND] = shape, shapes[2][shape], kind, beyond
            n += 1
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy")
def chord_px(shapes, shape, T, camera, row, pixel, side, reach_px):
    """How far a shape reaches from a contour sample along its normal (``side`` 1) or against it (-1): pixels up to ``reach_px``.

    To an eighth of the reach; for a shape that is not convex: where lines of sight at some distances miss it.
    """
    _, R, _, center = camera
    nx = R[0, 0] * row[NORMAL] + R[0, 1] * row[NORMAL + 1] + R[0, 2] * row[NORMAL + 2]
    ny = R[1, 0] * row[NORMAL] + R[1, 1] * row[NORMAL + 1] + R[1, 2] * row[NORMAL + 2]
    nz = R[2, 0] * row[NORMAL] + R[2, 1] * row[NORMAL + 1] + R[2, 2] * row[NORMAL + 2]
    along_u = pixel[JACOBIAN] * nx + pixel[JACOBIAN + 1] * ny + pixel[JACOBIAN + 2] * nz
    along_v = pixel[JACOBIAN + 3] * nx + pixel[JACOBIAN + 4] * ny + pixel[JACOBIAN + 5] * nz
    per_pixel = side / math.sqrt(along_u * along_u + along_v * along_v)
    low, high, at = 0.0, reach_px, reach_px
    for _ in range(4):
        step = at * per_pixel
        hit, _, t_out = solid_interval(
            shapes, shape, T, center, row[P] + step * row[NORMAL] - center[0], row[P + 1] + step * row[NORMAL + 1] - center[1],
            row[P + 2] + step * row[NORMAL + 2] - center[2],
        )  # fmt: skip
        if hit and t_out > 0.0:
            low = at
            if at == reach_px:
                return reach_px
        else:
            high = at
        at = 0.5 * (low + high)
    return at


def most_samples(shapes, n_samples: int) -> int:
    """How many rows `collect_samples` may fill."""
    return SAMPLES * n_samples * len(shapes[0])


__all__ = ["BEYOND", "CLASS", "LINK", "OUTER", "SHAPE", "chord_px", "collect_samples", "most_samples", "project_sample"]
