"""Extremal contours: of cones and ellipsoids in closed form, with how they slide; and of all shapes together.

A contour generator is where lines of sight touch a surface. For the truncated elliptical cone it is two straight lines
(Knossow et al., eqs 3-5); for the ellipsoid a planar conic, which becomes a circle when the ellipsoid is scaled to a sphere.

When a body moves with spatial twist (v, omega) at the world origin, a generator point p has the velocity

    p' = v + omega x p + d * (m . (v + omega x C)),

C the camera center, m the surface normal up to scale, and d the sliding direction. The last term is the paper's B, in the
form that is exact for a spatial twist (eq. 9 as printed mixes two twists).
"""

from __future__ import annotations

import math

from ...compiled.kernels import compiled
from ..shape_arrays import CONE, ELLIPSOID, OTHER
from .picks import cap_rows, edge_rows, has_caps, pick_caps, pick_edges

# Columns of a contour sample: position p, unit outward normal m_hat, sliding direction d, normal m (all in the world)
P, NORMAL, SLIDE, M = 0, 3, 6, 9
N_COLUMNS = 12
SAMPLES = 4  # times the samples of one generator line: as many as a shape may have
# Classes of a sample: not seen; of the outline of the whole body; of a contour within it
HIDDEN, OUTER, INNER = 0, 1, 2


@compiled
def _to_world(T, x, y, z, out, at, translate):
    for i in range(3):
        value = T[i, 0] * x + T[i, 1] * y + T[i, 2] * z
        out[at + i] = value + T[i, 3] if translate else value


@compiled
def _unit_normal(row):
    norm = math.sqrt(row[M] ** 2 + row[M + 1] ** 2 + row[M + 2] ** 2)
    for i in range(3):
        row[NORMAL + i] = row[M + i] / norm


@compiled
def _cone_contour(dims, T, center, n_samples, out):
    """Fill ``out`` with 2 * n_samples rows for one cone; returns how many (0 when the camera is inside the cone)."""
    a, b, k, z1, z2 = dims[0], dims[1], dims[2], dims[3], dims[4]
    wx, wy, wz = center[0] - T[0, 3], center[1] - T[1, 3], center[2] - T[2, 3]
    cx = T[0, 0] * wx + T[1, 0] * wy + T[2, 0] * wz
    cy = T[0, 1] * wx + T[1, 1] * wy + T[2, 1] * wz
    cz = T[0, 2] * wx + T[1, 2] * wy + T[2, 2] * wz
    F, G, H = -b * cx, -a * cy, a * b * (1.0 + k * cz)
    amplitude = math.sqrt(F * F + G * G)
    if not abs(H) < amplitude:
        return 0
    middle = math.atan2(G, F)
    half = math.acos(-H / amplitude)
    count = 0
    for side in range(2):
        theta = middle + half if side == 0 else middle - half
        c, s = math.cos(theta), math.sin(theta)
        nx, ny, nz = b * c, a * s, -a * b * k
        # b of the paper: (X - C')^T n_theta; independent of z
        slope = (a * c - cx) * (-b * s) + (b * s - cy) * (a * c)
        for j in range(n_samples):
            z = z1 + (z2 - z1) * (j + 0.5) / n_samples
            scale = 1.0 + k * z
            row = out[count]
            _to_world(T, a * scale * c, b * scale * s, z, row, P, True)
            _to_world(T, nx, ny, nz, row, M, False)
            _to_world(T, a * scale * s / slope, -b * scale * c / slope, 0.0, row, SLIDE, False)  # -X_theta / b
            _unit_normal(row)
            count += 1
    return count


@compiled
def _ellipsoid_contour(dims, T, center, n_samples, out):
    """Fill ``out`` with n_samples rows for one ellipsoid; returns how many (0 when the camera is inside)."""
    rx, ry, rz = dims[0], dims[1], dims[2]
    wx, wy, wz = center[0] - T[0, 3], center[1] - T[1, 3], center[2] - T[2, 3]
    cx = (T[0, 0] * wx + T[1, 0] * wy + T[2, 0] * wz) / rx
    cy = (T[0, 1] * wx + T[1, 1] * wy + T[2, 1] * wz) / ry
    cz = (T[0, 2] * wx + T[1, 2] * wy + T[2, 2] * wz) / rz
    length_sq = cx * cx + cy * cy + cz * cz
    if not length_sq > 1.0:
        return 0
    length = math.sqrt(length_sq)
    hx, hy, hz = cx / length, cy / length, cz / length
    # A basis of the plane across the line to the camera, from the axis least along it
    if abs(hx) <= abs(hy) and abs(hx) <= abs(hz):
        ex, ey, ez = 0.0, -hz, hy
    elif abs(hy) <= abs(hz):
        ex, ey, ez = hz, 0.0, -hx
    else:
        ex, ey, ez = -hy, hx, 0.0
    norm = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / norm, ey / norm, ez / norm
    fx, fy, fz = hy * ez - hz * ey, hz * ex - hx * ez, hx * ey - hy * ex
    lift, radius = 1.0 / length, math.sqrt(1.0 - 1.0 / length_sq)
    for j in range(n_samples):
        angle = 2.0 * math.pi * (j + 0.5) / n_samples
        c, s = math.cos(angle), math.sin(angle)
        x = lift * hx + radius * (c * ex + s * fx)
        y = lift * hy + radius * (c * ey + s * fy)
        z = lift * hz + radius * (c * ez + s * fz)
        # On the unit sphere the point slides towards the camera's pole: direction g = h - (h.x) x, with h.x = lift
        gx, gy, gz = hx - lift * x, hy - lift * y, hz - lift * z
        slope = gx * cx + gy * cy + gz * cz
        row = out[j]
        _to_world(T, rx * x, ry * y, rz * z, row, P, True)
        _to_world(T, x / rx, y / ry, z / rz, row, M, False)
        _to_world(T, rx * gx / slope, ry * gy / slope, rz * gz / slope, row, SLIDE, False)
        _unit_normal(row)
    return n_samples


@compiled
def _shape_contour(kind, dims, T, center, n_samples, out):
    """Sliding contour samples of one shape; ``out`` (>= 2 n_samples, `N_COLUMNS`). Returns their number."""
    if kind == CONE:
        return _cone_contour(dims, T, center, n_samples, out)
    if kind == ELLIPSOID:
        return _ellipsoid_contour(dims, T, center, 2 * n_samples, out)
    return 0


@compiled
def world_spheres(Ts_world_shape, bounds, out):
    """Bounding spheres of all shapes in the world.

    Parameters
    ----------
    Ts_world_shape : (n, 4, 4) world from shape, meters.
    bounds : (n, 4) center in the frame of the shape and radius, meters, as of `ShapeArrays`.
    out : (n, 4), filled with center in the world and radius.
    """
    for i in range(bounds.shape[0]):
        for r in range(3):
            out[i, r] = (
                Ts_world_shape[i, r, 0] * bounds[i, 0]
                + Ts_world_shape[i, r, 1] * bounds[i, 1]
                + Ts_world_shape[i, r, 2] * bounds[i, 2]
                + Ts_world_shape[i, r, 3]
            )
        out[i, 3] = bounds[i, 3]


@compiled
def draw_contour(shapes, shape, T, center, n_samples, anew, picks, n_picks, out):
    """All contour samples of a shape of any kind: first those that are fixed to it, then those that slide.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    shape : index of the shape.
    T : (4, 4) world from shape.
    center : (3,) of the camera, world, meters.
    n_samples : samples of one generator line.
    anew : whether ``picks`` are made now (see `picks`), or used as they were made for a body nearby.
    picks : (`SAMPLES` * n_samples, `N_PICK_COLUMNS`).
    n_picks : (n_shapes,) how many of ``picks`` are in use, by shape.
    out : (`SAMPLES` * n_samples, `N_COLUMNS`), filled from its first row on.

    Returns
    -------
    int : how many rows are filled.
    """
    kind, dims, surfaces = shapes[0][shape], shapes[1][shape], shapes[3]
    if kind == OTHER:
        if anew:
            n_picks[shape] = pick_edges(surfaces, shape, T, center, SAMPLES * n_samples, picks)
        edge_rows(surfaces, T, center, picks, n_picks[shape], out)
        return n_picks[shape]
    n = 0
    if has_caps(surfaces, shape):
        if anew:
            n_picks[shape] = pick_caps(dims, T, center, n_samples, picks)
        n = n_picks[shape]
        cap_rows(dims, T, center, picks, n, out)
        return n + _shape_contour(kind, dims, T, center, n_samples, out[n:])
    n_picks[shape] = 0
    return _shape_contour(kind, dims, T, center, n_samples, out)
