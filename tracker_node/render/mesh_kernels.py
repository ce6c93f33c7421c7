"""Triangles of meshes into the ray-caster's buffers.

Relative to a point in the middle of its image, a triangle is four lines in (x, y): three that are positive inside and together
make the fourth, the inverse depth w. A line divided by w is the weight of the corner that it belongs to, with perspective.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from ..camera.camera_model import NEAR
from .ray_coefficients import pixel_box
from .ray_kernels import LABEL_BITS, LANES

# Columns of a triangle: origin (x0, y0), three lines, the line of the inverse depth, 1 seen from outside and -1 from behind
ORIGIN, LINES, INVERSE_DEPTH, SIDE = 0, 2, 11, 14
N_TRIANGLE_COLUMNS = 15
_ZERO = np.float32(0.0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mesh_box(points, params, limits, region, out):
    """Pixel box ``out`` (4,) within ``region`` of points (n, 3) in the camera frame; the region if some are not in front."""
    box = np.array([1e30, 1e30, -1e30, -1e30])
    nearest, farthest = 1e30, -1e30
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        nearest, farthest = min(nearest, z), max(farthest, z)
        if z >= NEAR:
            box[0], box[1], box[2], box[3] = min(box[0], x / z), min(box[1], y / z), max(box[2], x / z), max(box[3], y / z)
    if farthest < NEAR:
        return
    if nearest >= NEAR:
        pixel_box(params, box, limits, region, out)
    else:
        out[2], out[3] = region[2], region[3]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def draw_mesh(points, faces, params, limits, region, label, first, xs, ys, row_offset, column_offset, rows, buffer, numbers):
    """Triangles of ``points`` (n, 3) in the camera frame, also those that reach behind the camera.

    ``rows`` (m, `N_TRIANGLE_COLUMNS`) float32 receives the triangles, and ``numbers`` (like ``buffer``) the number, from
    ``first`` on, of the one that is in front.
    """
    box, pixels = np.empty(4), np.empty(4, dtype=np.int64)
    n = np.empty((3, 3))
    for t in range(faces.shape[0]):
        x0, y0, in_front = 0.0, 0.0, True
        box[0], box[1], box[2], box[3] = 1e30, 1e30, -1e30, -1e30
        for i in range(3):
            p = points[faces[t, i]]
            in_front = in_front and p[2] >= NEAR
            if in_front:
                x0, y0 = p[0] / p[2], p[1] / p[2]
                box[0], box[1], box[2], box[3] = min(box[0], x0), min(box[1], y0), max(box[2], x0), max(box[3], y0)
            a, b = points[faces[t, (i + 1) % 3]], points[faces[t, (i + 2) % 3]]
            n[i, 0], n[i, 1], n[i, 2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        corner = points[faces[t, 0]]
        volume = corner[0] * n[0, 0] + corner[1] * n[0, 1] + corner[2] * n[0, 2]
        if volume == 0.0:
            continue
        if not in_front:
            x0, y0 = 0.0, 0.0
            pixels[0], pixels[1], pixels[2], pixels[3] = region[0], region[1], region[2], region[3]
        else:
            pixel_box(params, box, limits, region, pixels)
        c = rows[t]
        c[ORIGIN], c[ORIGIN + 1] = x0, y0
        c[INVERSE_DEPTH], c[INVERSE_DEPTH + 1], c[INVERSE_DEPTH + 2] = 0.0, 0.0, 0.0
        for i in range(3):
            lx, ly, lz = n[i, 0] / volume, n[i, 1] / volume, n[i, 2] / volume
            line = lz + x0 * lx + y0 * ly, lx, ly
            for j in range(3):
                c[LINES + 3 * i + j] = line[j]
                c[INVERSE_DEPTH + j] += np.float32(line[j])
        c[SIDE] = 1.0 if volume < 0.0 else -1.0
        _draw_triangle(c, label, first + t, xs, ys, pixels, row_offset, column_offset, buffer, numbers)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _draw_triangle(c, label, number, xs, ys, box, row_offset, column_offset, buffer, numbers):
    x0, y0 = c[ORIGIN], c[ORIGIN + 1]
    e0, e1, e2, f0, f1, f2, g0, g1, g2 = c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10]
    w0, w1, w2 = c[INVERSE_DEPTH], c[INVERSE_DEPTH + 1], c[INVERSE_DEPTH + 2]
    tag, upper_bits, own = np.int32(label), np.int32(~LABEL_BITS), np.int32(number)
    for v in range(box[1], box[3]):
        for u in range(box[0] // LANES * LANES, box[2], LANES):
            x_row, y_row = xs[v, u : u + LANES], ys[v, u : u + LANES]
            at = u - column_offset
            out, out_numbers = buffer[v - row_offset, at : at + LANES], numbers[v - row_offset, at : at + LANES]
            for i in range(LANES):
                x, y = x_row[i] - x0, y_row[i] - y0
                e, f, g = e0 + e1 * x + e2 * y, f0 + f1 * x + f2 * y, g0 + g1 * x + g2 * y
                w = w0 + w1 * x + w2 * y
                packed = (np.float32(w).view(np.int32) & upper_bits) | tag
                hit = (e >= _ZERO) & (f >= _ZERO) & (g >= _ZERO) & (w > _ZERO)
                packed = packed if hit else np.int32(0)
                wins = packed > out[i]
                out[i] = packed if wins else out[i]
                out_numbers[i] = own if wins else out_numbers[i]
