"""Shapes as seen along the rays of one camera: closed forms in the inverse depth w = 1 / z.

A ray is p = (x, y, 1) / w with (x, y) the undistorted normalized coordinates of a pixel. Inside a convex shape w lies between
bounds that are linear in (x, y), plus or minus the square root of a quadratic for a curved surface. All set-up is in float64 and
relative to a point in the middle of the shape's image, so that the pixel loops can do with float32.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import NEAR, project_point
from ...compiled.kernels import compiled
from ..shape_arrays import CONE, ELLIPSOID

BIG = 1e30  # an inverse depth that no bound reaches
BOX = 3  # beyond the kinds of ShapeArrays

# How a curved surface bounds the inverse depth: between both roots; from the upper root on; up to the lower root
BETWEEN, ABOVE, BELOW, INVISIBLE = 0, 1, 2, 3

# Columns of the coefficients: origin (x0, y0), then a quadratic and a line (curved), or lines only (flat)
ORIGIN, QUADRATIC, LINE, UPPER, LOWER = 0, 2, 8, 11, 20
N_COEFFICIENTS = 38
_POLYGON = 16  # corners of the polygons around a cone's end ellipses


@compiled
def _slab(position, low, high, d0, d1, d2, coefficients, upper, lower):
    """Bounds of w from low <= p_j <= high, for a camera at p_j = ``position``: one upper (or none) and two lower ones."""
    e_low, e_high = position - low, position - high
    if e_low == 0.0:
        e_low = 1e-12
    if e_high == 0.0:
        e_high = -1e-12
    if e_low > 0.0 and e_high > 0.0:
        near, far = e_high, e_low
    else:
        near, far = e_low, e_high
    if e_low * e_high > 0.0:
        coefficients[upper], coefficients[upper + 1], coefficients[upper + 2] = -d0 / near, -d1 / near, -d2 / near
        coefficients[lower + 3], coefficients[lower + 4], coefficients[lower + 5] = -BIG, 0.0, 0.0
    else:
        coefficients[upper], coefficients[upper + 1], coefficients[upper + 2] = BIG, 0.0, 0.0
        coefficients[lower + 3] = -d0 / near
        coefficients[lower + 4], coefficients[lower + 5] = -d1 / near, -d2 / near
    coefficients[lower], coefficients[lower + 1], coefficients[lower + 2] = -d0 / far, -d1 / far, -d2 / far


@compiled
def _quadric(camera, ray, signs, coefficients):
    """Line and quadratic with w = line +- sqrt(quadratic) on the surface B(p, p) = 0; returns B of the camera.

    ``camera`` (4,) is the optical center and ``ray`` (3, 4) the direction's constant, x and y parts, both lifted so that the
    surface is the null cone of the diagonal form ``signs``.
    """
    c = 0.0
    b = np.zeros(3)
    a = np.zeros((3, 3))
    for j in range(4):
        c += signs[j] * camera[j] * camera[j]
        for m in range(3):
            b[m] += signs[j] * camera[j] * ray[m, j]
            for n in range(3):
                a[m, n] += signs[j] * ray[m, j] * ray[n, j]
    c = c if abs(c) > 1e-12 else 1e-12
    for m in range(3):
        coefficients[LINE + m] = -b[m] / c
    inverse = 1.0 / (c * c)
    at = QUADRATIC
    for m in range(3):
        for n in range(m, 3):
            value = (b[m] * b[n] - a[m, n] * c) * inverse
            coefficients[at] = value if m == n else 2.0 * value
            at += 1
    return c


@compiled
def shape_coefficients(kind, dims, T, coefficients):
    """Coefficients of one shape in a camera; a shape that the camera is inside of is invisible.

    Parameters
    ----------
    kind : `CONE`, `ELLIPSOID` or `BOX`.
    dims : (5,) as of `ShapeArrays`; of a box its size, meters.
    T : (4, 4) camera from shape.
    coefficients : (`N_COEFFICIENTS`,), filled.

    Returns
    -------
    How its surface bounds the inverse depth: `BETWEEN`, `ABOVE`, `BELOW` or `INVISIBLE`.
    """
    middle = 0.5 * (dims[3] + dims[4]) if kind == CONE else 0.0
    mx, my, mz = T[0, 2] * middle + T[0, 3], T[1, 2] * middle + T[1, 3], T[2, 2] * middle + T[2, 3]
    x0, y0 = (mx / mz, my / mz) if mz > NEAR else (0.0, 0.0)
    coefficients[:] = 0.0
    coefficients[ORIGIN], coefficients[ORIGIN + 1] = x0, y0
    o = np.empty(3)
    d = np.empty((3, 3))  # direction = d[0] + (x - x0) d[1] + (y - y0) d[2]
    for j in range(3):
        o[j] = -(T[0, j] * T[0, 3] + T[1, j] * T[1, 3] + T[2, j] * T[2, 3])
        d[1, j], d[2, j] = T[0, j], T[1, j]
        d[0, j] = T[2, j] + x0 * T[0, j] + y0 * T[1, j]
    if kind == BOX:
        inside = True
        for j in range(3):
            h = 0.5 * dims[j]
            _slab(o[j], -h, h, d[0, j], d[1, j], d[2, j], coefficients, UPPER + 3 * j, LOWER + 6 * j)
            inside = inside and abs(o[j]) < h
        return INVISIBLE if inside else BETWEEN
    camera, ray, signs = np.zeros(4), np.zeros((3, 4)), np.ones(4)
    signs[3] = -1.0
    if kind == ELLIPSOID:
        for j in range(3):
            camera[j] = o[j] / dims[j]
            for m in range(3):
                ray[m, j] = d[m, j] / dims[j]
        camera[3] = 1.0
        coefficients[UPPER], coefficients[LOWER], coefficients[LOWER + 3] = BIG, -BIG, -BIG
        return BETWEEN if _quadric(camera, ray, signs, coefficients) > 0.0 else INVISIBLE
    a, b, k = dims[0], dims[1], dims[2]
    camera[0], camera[1], camera[3] = o[0] / a, o[1] / b, 1.0 + k * o[2]
    for m in range(3):
        ray[m, 0], ray[m, 1], ray[m, 3] = d[m, 0] / a, d[m, 1] / b, k * d[m, 2]
    c = _quadric(camera, ray, signs, coefficients)
    _slab(o[2], dims[3], dims[4], d[0, 2], d[1, 2], d[2, 2], coefficients, UPPER, LOWER)
    if c > 0.0:
        return BETWEEN
    if camera[3] < 0.0:
        return BELOW
    return INVISIBLE if dims[3] < o[2] < dims[4] else ABOVE


@compiled
def _grow(T, x, y, z, box):
    """Grow ``box`` (x0, y0, x1, y1) by the normalized coordinates of a shape's point; False when it is not in front."""
    pz = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
    if pz < NEAR:
        return False
    px = (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) / pz
    py = (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) / pz
    box[0], box[1] = min(box[0], px), min(box[1], py)
    box[2], box[3] = max(box[2], px), max(box[3], py)
    return True


@compiled
def _ellipsoid_box(dims, T, box):
    """Exact: a plane n through the camera is tangent where n' (c c' - S) n = 0, S the ellipsoid's matrix."""
    dual = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            value = T[i, 3] * T[j, 3]
            for m in range(3):
                value -= T[i, m] * T[j, m] * dims[m] * dims[m]
            dual[i, j] = value
    if T[2, 3] < 0.0 or dual[2, 2] <= NEAR * NEAR:
        return False
    for i in range(2):
        middle = dual[i, 2] / dual[2, 2]
        half = math.sqrt(max(middle * middle - dual[i, i] / dual[2, 2], 0.0))
        box[i], box[2 + i] = middle - half, middle + half
    return True


@compiled
def farthest_depth(kind, dims, T):
    """Largest depth of a shape's points.

    Parameters
    ----------
    kind, dims, T : as of `shape_coefficients`.

    Returns
    -------
    z in the camera frame, meters.
    """
    depth = T[2, 3]
    if kind == ELLIPSOID:
        return depth + math.sqrt((T[2, 0] * dims[0]) ** 2 + (T[2, 1] * dims[1]) ** 2 + (T[2, 2] * dims[2]) ** 2)
    if kind == BOX:
        return depth + 0.5 * (abs(T[2, 0]) * dims[0] + abs(T[2, 1]) * dims[1] + abs(T[2, 2]) * dims[2])
    rim = math.sqrt((T[2, 0] * dims[0]) ** 2 + (T[2, 1] * dims[1]) ** 2)
    low, high = dims[3], dims[4]
    return depth + max(T[2, 2] * low + (1.0 + dims[2] * low) * rim, T[2, 2] * high + (1.0 + dims[2] * high) * rim)


@compiled
def normalized_box(kind, dims, T, box):
    """A rectangle of rays that encloses a shape.

    Parameters
    ----------
    kind, dims, T : as of `shape_coefficients`.
    box : (4,) filled with x0, y0, x1, y1 in normalized coordinates.

    Returns
    -------
    bool : False when part of the shape is not in front of the camera, and ``box`` says nothing.
    """
    if kind == ELLIPSOID:
        return _ellipsoid_box(dims, T, box)
    box[0], box[1], box[2], box[3] = BIG, BIG, -BIG, -BIG
    if kind == BOX:
        for corner in range(8):
            x = (0.5 if corner & 1 else -0.5) * dims[0]
            y = (0.5 if corner & 2 else -0.5) * dims[1]
            z = (0.5 if corner & 4 else -0.5) * dims[2]
            if not _grow(T, x, y, z, box):
                return False
        return True
    around = 1.0 / math.cos(math.pi / _POLYGON)
    for end in range(2):
        z = dims[3 + end]
        scale = (1.0 + dims[2] * z) * around
        for i in range(_POLYGON):
            angle = 2.0 * math.pi * i / _POLYGON
            if not _grow(T, dims[0] * scale * math.cos(angle), dims[1] * scale * math.sin(angle), z, box):
                return False
    return True


@compiled
def pixel_box(params, box, limits, region, out):
    """Pixels that see into a rectangle of rays, rather too many than too few.

    A lens bends the edges of the rectangle: they are sampled, with a margin from how much the samples bend.

    Parameters
    ----------
    params : (`N_PARAMS`,) of the lens.
    box : (4,) x0, y0, x1, y1, normalized coordinates.
    limits : (4,) of `RayTable`, which enclose the rays of the image.
    region : (4,) u0, v0, u1, v1, within which pixels count.
    out : (4,) filled with u0, v0, u1, v1; the upper left corner of the region twice where there are none.
    """
    x0, y0, x1, y1 = max(box[0], limits[0]), max(box[1], limits[1]), min(box[2], limits[2]), min(box[3], limits[3])
    out[0], out[1], out[2], out[3] = region[0], region[1], region[0], region[1]
    if not (x0 <= x1 and y0 <= y1):
        return
    steps = 1 if params[5] == 0.0 else 8
    u_min, v_min, u_max, v_max, bend = BIG, BIG, -BIG, -BIG, 0.0
    for side in range(4):
        u1, v1, u2, v2 = 0.0, 0.0, 0.0, 0.0
        for i in range(steps + 1):
            s = i / steps
            x = x0 + s * (x1 - x0) if side < 2 else (x0 if side == 2 else x1)
            y = y0 + s * (y1 - y0) if side >= 2 else (y0 if side == 0 else y1)
            result = project_point(params, x, y, 1.0)
            if not result[0]:
                out[2], out[3] = region[2], region[3]
                return
            u, v = result[1], result[2]
            if i >= 2:
                bend = max(bend, abs(u - 2.0 * u1 + u2), abs(v - 2.0 * v1 + v2))
            u2, v2, u1, v1 = u1, v1, u, v
            u_min, v_min, u_max, v_max = min(u_min, u), min(v_min, v), max(u_max, u), max(v_max, v)
    margin = 0.5 + bend
    out[0] = max(region[0], math.floor(max(u_min - margin, -1.0)))
    out[1] = max(region[1], math.floor(max(v_min - margin, -1.0)))
    out[2] = min(region[2], math.ceil(min(u_max + margin, 1e6)) + 1)
    out[3] = min(region[3], math.ceil(min(v_max + margin, 1e6)) + 1)
    if out[2] <= out[0] or out[3] <= out[1]:  # no rows either, since loops widen what columns there are
        out[0], out[1], out[2], out[3] = region[0], region[1], region[0], region[1]
