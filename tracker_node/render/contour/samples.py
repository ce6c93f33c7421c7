"""All contour samples of a body that one camera sees, in one list."""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import NEAR, project_point
from ...compiled.kernels import compiled
from ..shape_arrays import OTHER
from ..solids import NO_HIT, solid_hit, to_shape
from .generators import HIDDEN, N_COLUMNS, NORMAL, OUTER, SAMPLES, P, draw_contour
from .picks import N_PICK_COLUMNS
from .visibility import N_VIEW_COLUMNS, classify_samples, interval, nearby_shapes, view_shapes

# Columns of ``pixels``: u, v, depth, unit normal in the image, derivative of (u, v) by the point in the camera frame (2 x 3)
U, V, DEPTH, NU, NV, JACOBIAN = 0, 1, 2, 3, 4, 5
N_PIXEL_COLUMNS = 11
# Columns of ``info``: index of shape and link, `OUTER` or `INNER`, index of the shape seen just beyond the contour (-1: none)
SHAPE, LINK, CLASS, BEYOND = range(4)
N_INFO_COLUMNS = 4
_BISECTIONS = 6  # of a chord


@compiled
def project_samples(params, R, t, rows, count, outward_px, pixels, outwards):
    """Project contour samples into the image.

    Parameters
    ----------
    params : (`N_PARAMS`,) of the lens.
    R, t : (3, 3) and (3,) camera from world, meters.
    rows : (., `N_COLUMNS`) contour samples in the world.
    count : how many of them are used.
    outward_px : a distance in the image, pixels.
    pixels : (., `N_PIXEL_COLUMNS`), whose first ``count`` rows are filled.
    outwards : (.,) filled with how many meters ``outward_px`` are at each; negative where the camera has no pixel for it.
    """
    plain = params[5] == 0.0  # no distortion: without a call
    for i in range(count):
        px, py, pz, mx, my, mz = (rows[i, P], rows[i, P + 1], rows[i, P + 2], rows[i, NORMAL], rows[i, NORMAL + 1],
                                  rows[i, NORMAL + 2])  # fmt: skip
        x = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0]
        y = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1]
        z = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2]
        if plain and z >= NEAR:
            iz = 1.0 / z
            xn, yn = x * iz, y * iz
            u, v = params[0] * xn + params[4] * yn + params[2], params[1] * yn + params[3]
            ux, uy, vx, vy = params[0] * iz, params[4] * iz, 0.0, params[1] * iz
            uz, vz = -(ux * xn + uy * yn), -vy * yn
        else:
            ok, u, v, ux, uy, uz, vx, vy, vz = project_point(params, x, y, z)
            if not ok:
                outwards[i] = -1.0
                continue
        nx = R[0, 0] * mx + R[0, 1] * my + R[0, 2] * mz
        ny = R[1, 0] * mx + R[1, 1] * my + R[1, 2] * mz
        nz = R[2, 0] * mx + R[2, 1] * my + R[2, 2] * mz
        nu, nv = ux * nx + uy * ny + uz * nz, vx * nx + vy * ny + vz * nz
        scale = 1.0 / math.sqrt(nu * nu + nv * nv)
        outwards[i] = outward_px * z / params[0]
        pixels[i, U], pixels[i, V], pixels[i, DEPTH], pixels[i, NU], pixels[i, NV] = u, v, z, scale * nu, scale * nv
        pixels[i, JACOBIAN], pixels[i, JACOBIAN + 1], pixels[i, JACOBIAN + 2] = ux, uy, uz
        pixels[i, JACOBIAN + 3], pixels[i, JACOBIAN + 4], pixels[i, JACOBIAN + 5] = vx, vy, vz


@compiled
def collect_samples(shapes, Ts, spheres, camera, n_samples, outward_px, rows, pixels, info):
    """Fill one row for every contour sample that the camera sees.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    Ts : (n_shapes, 4, 4) world from shape.
    spheres : (n_shapes, 4) of `generators.world_spheres`.
    camera : (params, R_cam_world, t_cam_world, center).
    n_samples : samples of one generator line.
    outward_px : how far beyond the contour it is decided what lies there.
    rows : (n, `N_COLUMNS`) of `generators`, n from `most_samples`.
    pixels : (n, `N_PIXEL_COLUMNS`).
    info : (n, `N_INFO_COLUMNS`) int32.

    Returns
    -------
    int : how many rows are filled.
    """
    params, R, t, center = camera
    n_shapes, most = shapes[0].shape[0], SAMPLES * n_samples
    picks, n_picks = np.empty((most, N_PICK_COLUMNS)), np.zeros(n_shapes, dtype=np.int64)
    outwards, classes, beyonds = np.empty(most), np.empty(most, dtype=np.uint8), np.empty(most, dtype=np.int64)
    views, nearby = np.empty((n_shapes, N_VIEW_COLUMNS)), np.empty(n_shapes, dtype=np.int64)
    view_shapes(Ts, spheres, center, views)
    n = 0
    for shape in range(n_shapes):
        # Drawn where they are to stay; those that are not seen are overwritten
        found, seen = rows[n:], pixels[n:]
        count = draw_contour(shapes, shape, Ts[shape], center, n_samples, np.bool_(True), picks, n_picks, found)
        if count == 0:
            continue
        n_nearby = nearby_shapes(views, shape, nearby)
        project_samples(params, R, t, found, count, outward_px, seen, outwards)
        classify_samples(
            shapes, views, shape, Ts, nearby, n_nearby, center, found, count, picks, n_picks[shape], outwards, classes, beyonds
        )  # fmt: skip
        link = shapes[2][shape]
        for j in range(count):
            if classes[j] == HIDDEN:
                continue
            info[n, SHAPE], info[n, LINK], info[n, CLASS], info[n, BEYOND] = shape, link, classes[j], beyonds[j]
            for c in range(N_COLUMNS):
                rows[n, c] = found[j, c]
            for c in range(N_PIXEL_COLUMNS):
                pixels[n, c] = seen[j, c]
            n += 1
    return n


@compiled
def keep_inside(rows, pixels, info, n, width, height):
    """Keep those samples that lie on the image, in their order.

    Parameters
    ----------
    rows, pixels, info : of `collect_samples`, changed in place.
    n : how many of them are in use.
    width, height : of the image, pixels.

    Returns
    -------
    int : how many are left.
    """
    kept = 0
    for j in range(n):
        if -0.5 <= pixels[j, U] < width - 0.5 and -0.5 <= pixels[j, V] < height - 0.5:
            if kept < j:
                for k in range(rows.shape[1]):
                    rows[kept, k] = rows[j, k]
                for k in range(pixels.shape[1]):
                    pixels[kept, k] = pixels[j, k]
                for k in range(info.shape[1]):
                    info[kept, k] = info[j, k]
            kept += 1
    return kept


@compiled
def chords_px(shapes, Ts, camera, rows, pixels, info, n, reach_px, chords):
    """How far its shape reaches from each contour sample, in the image.

    For a shape that is not convex: to where lines of sight at some distances miss it.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    Ts : (n_shapes, 4, 4) world from shape.
    camera : (params, R_cam_world, t_cam_world, center).
    rows, pixels, info : of `collect_samples`.
    n : how many of them are used.
    reach_px : largest distance; results are good to a sixtieth of it.
    chords : (., 2) pixels, filled: against the normal and, for creases only, along it.
    """
    _, R, _, center = camera
    kinds, dims, surfaces = shapes[0], shapes[1], shapes[3]
    for i in range(n):
        s, nx, ny, nz = info[i, SHAPE], rows[i, NORMAL], rows[i, NORMAL + 1], rows[i, NORMAL + 2]
        dx, dy, dz = rows[i, P] - center[0], rows[i, P + 1] - center[1], rows[i, P + 2] - center[2]
        cx = R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz
        cy = R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz
        cz = R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz
        u = pixels[i, JACOBIAN] * cx + pixels[i, JACOBIAN + 1] * cy + pixels[i, JACOBIAN + 2] * cz
        v = pixels[i, JACOBIAN + 3] * cx + pixels[i, JACOBIAN + 4] * cy + pixels[i, JACOBIAN + 5] * cz
        per_pixel = 1.0 / math.sqrt(u * u + v * v)
        solid = kinds[s] == OTHER
        ox, oy, oz, ux, uy, uz = to_shape(Ts[s], center, dx, dy, dz)
        _, _, _, mx, my, mz = to_shape(Ts[s], center, nx, ny, nz)
        for side in range(2 if info[i, BEYOND] == s else 1):
            low, high, at = 0.0, reach_px, reach_px
            for _ in range(_BISECTIONS):
                step = at * per_pixel if side == 1 else -at * per_pixel
                if solid:
                    hit = solid_hit(
                        surfaces, s, Ts[s], center, dx + step * nx, dy + step * ny, dz + step * nz, NO_HIT, True
                    ) < NO_HIT  # fmt: skip
                else:
                    hit, _, _ = interval(kinds[s], dims, s, ox, oy, oz, ux + step * mx, uy + step * my, uz + step * mz)
                if hit:
                    low = at
                    if at == reach_px:
                        break
                else:
                    high = at
                at = 0.5 * (low + high)
            chords[i, side] = at


def most_samples(shapes, n_samples: int) -> int:
    """How many rows `collect_samples` may fill.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    n_samples : samples of one generator line.

    Returns
    -------
    int : a bound, whatever the pose.
    """
    return SAMPLES * n_samples * len(shapes[0])


__all__ = ["BEYOND", "CLASS", "LINK", "OUTER", "SHAPE", "chords_px", "collect_samples", "keep_inside", "most_samples"]
