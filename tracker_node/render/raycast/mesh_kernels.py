"""Triangles of meshes into the ray-caster's buffers.

Relative to a point in the middle of its image, a triangle is four lines in (x, y): three that are positive inside and together
make the fourth, the inverse depth w. A line divided by w is the weight of the corner that it belongs to, with perspective.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import NEAR, project_point
from ...compiled.kernels import compiled
from .coefficients import pixel_box
from .kernels import LABEL_BITS, LANES, pixel_function, pixel_loop

# Columns of a triangle: origin (x0, y0), three lines, the line of the inverse depth, 1 seen from outside and -1 from behind
ORIGIN, LINES, INVERSE_DEPTH, SIDE = 0, 2, 11, 14
N_TRIANGLE_COLUMNS = 15
_ZERO = np.float32(0.0)

_MARGIN = 1e-3  # pixels: rounding
_EDGE = 1e-7  # of x, y: triangles reach that far over their edges, so that no ray on a common edge passes between by rounding
_SHORT_BEND = 0.25  # pixels, of edges too short to sample
_NARROW = 8  # pixels: narrower triangles are drawn one pixel at a time


@compiled
def mesh_box(points, params, limits, region, out):
    """Pixels that may see a mesh; all of the region if some of its points are not in front of the camera.

    Parameters
    ----------
    points : (n, 3) of `pose_vertices`.
    params, limits, region : as of `coefficients.pixel_box`.
    out : (4,) u0, v0, u1, v1, changed unless all points are behind the camera.
    """
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


@compiled
def pose_vertices(vertices, T_cam_world, T_world_shape, params, points, pixels):
    """Vertices of a mesh as a camera sees them.

    Parameters
    ----------
    vertices : (n, 3) in the frame of the shape, meters.
    T_cam_world, T_world_shape : (4, 4).
    params : (`N_PARAMS`,) of the lens.
    points : (n, 3), filled: camera frame, meters.
    pixels : (n, 2), filled; not a number where a vertex is behind the camera, or the lens has no pixel for it.
    """
    T = np.zeros((3, 4))
    for i in range(3):
        for j in range(4):
            for m in range(4):
                T[i, j] += T_cam_world[i, m] * T_world_shape[m, j]
    for i in range(vertices.shape[0]):
        a, b, c = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        x, y, z = (T[0, 0] * a + T[0, 1] * b + T[0, 2] * c + T[0, 3], T[1, 0] * a + T[1, 1] * b + T[1, 2] * c + T[1, 3],
                   T[2, 0] * a + T[2, 1] * b + T[2, 2] * c + T[2, 3])  # fmt: skip
        points[i, 0], points[i, 1], points[i, 2] = x, y, z
        result = project_point(params, x, y, z)
        pixels[i, 0], pixels[i, 1] = (result[1], result[2]) if result[0] else (np.nan, np.nan)


@pixel_function
def _bend(params, points, pixels, a, b):
    """How far in pixels the image of an edge is from the straight line between its ends."""
    if params[5] == 0.0:
        return 0.0
    du, dv = pixels[b, 0] - pixels[a, 0], pixels[b, 1] - pixels[a, 1]
    if du * du + dv * dv < 16.0:
        return _SHORT_BEND
    x, y, u, v = points[a, 0] / points[a, 2], points[a, 1] / points[a, 2], pixels[a, 0], pixels[a, 1]
    dx, dy = points[b, 0] / points[b, 2] - x, points[b, 1] / points[b, 2] - y
    bend = 0.0
    for i in range(1, 4):
        fraction = 0.25 * i
        between = project_point(params, x + fraction * dx, y + fraction * dy, 1.0)
        bend = max(bend, math.hypot(between[1] - u - fraction * du, between[2] - v - fraction * dv))
    return 1.5 * bend + _SHORT_BEND


@pixel_function
def _cross(points, a, b):
    return (
        points[a, 1] * points[b, 2] - points[a, 2] * points[b, 1],
        points[a, 2] * points[b, 0] - points[a, 0] * points[b, 2],
        points[a, 0] * points[b, 1] - points[a, 1] * points[b, 0],
    )


@pixel_function
def _low_and_high(values, column, i, j, k):
    a, b, c = values[i, column], values[j, column], values[k, column]
    return min(a, b, c), max(a, b, c)


@pixel_loop
def draw_mesh(
    points, pixels, faces, closed, params, region, label, first, xs, ys, row_offset, column_offset, rows, buffer, numbers
):  # fmt: skip
    """Draw the triangles of a mesh into a buffer, also those that reach behind the camera.

    Parameters
    ----------
    points, pixels : of `pose_vertices`.
    faces : (m, 3) indices of vertices.
    closed : leave the triangles out that face away.
    params : (`N_PARAMS`,) of the lens.
    region : (u0, v0, u1, v1) the pixels to draw.
    label : 1 + index of the shape.
    first : number of the first triangle.
    xs, ys : of `RayTable`.
    row_offset, column_offset : the pixel of the image at the corner of the buffer.
    rows : (m, `N_TRIANGLE_COLUMNS`) float32, filled for the triangles that may be seen.
    buffer : (h, w) int32 of `kernels`, changed in place.
    numbers : (h, w) int32, receives the number of the triangle that is in front.
    """
    for t in range(faces.shape[0]):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        normal = _cross(points, j, k)
        volume = points[i, 0] * normal[0] + points[i, 1] * normal[1] + points[i, 2] * normal[2]
        if volume == 0.0 or (closed and volume > 0.0):
            continue
        (low_u, high_u), (low_v, high_v) = _low_and_high(pixels, 0, i, j, k), _low_and_high(pixels, 1, i, j, k)
        x0, y0, u0, v0, u1, v1 = 0.0, 0.0, region[0], region[1], region[2], region[3]
        if not math.isnan(pixels[i, 0] + pixels[j, 0] + pixels[k, 0]):
            bend = max(
                _bend(params, points, pixels, i, j), _bend(params, points, pixels, j, k), _bend(params, points, pixels, k, i)
            )
            margin = _MARGIN + bend
            u0, u1 = max(u0, math.ceil(max(low_u - margin, -1.0))), min(u1, math.floor(min(high_u + margin, 1e6)) + 1)
            v0, v1 = max(v0, math.ceil(max(low_v - margin, -1.0))), min(v1, math.floor(min(high_v + margin, 1e6)) + 1)
            if u1 <= u0 or v1 <= v0:
                continue
            x0, y0 = points[i, 0] / points[i, 2], points[i, 1] / points[i, 2]
        w0, w1, w2 = 0.0, 0.0, 0.0
        column = LINES
        for nx, ny, nz in (normal, _cross(points, k, i), _cross(points, i, j)):
            lx, ly = nx / volume, ny / volume
            line = nz / volume + x0 * lx + y0 * ly
            rows[t, column], rows[t, column + 1], rows[t, column + 2] = line + _EDGE * math.hypot(lx, ly), lx, ly
            w0, w1, w2 = w0 + line, w1 + lx, w2 + ly
            column += 3
        rows[t, ORIGIN], rows[t, ORIGIN + 1] = x0, y0
        rows[t, INVERSE_DEPTH], rows[t, INVERSE_DEPTH + 1], rows[t, INVERSE_DEPTH + 2] = w0, w1, w2
        rows[t, SIDE] = 1.0 if volume < 0.0 else -1.0
        if u1 - u0 <= _NARROW:
            _draw_narrow(rows, t, label, first + t, xs, ys, u0, v0, u1, v1, row_offset, column_offset, buffer, numbers)
        else:
            _draw_wide(rows, t, label, first + t, xs, ys, u0, v0, u1, v1, row_offset, column_offset, buffer, numbers)


@pixel_function
def _draw_narrow(c, t, label, number, xs, ys, u0, v0, u1, v1, row_offset, column_offset, buffer, numbers):
    x0, y0, d = c[t, ORIGIN], c[t, ORIGIN + 1], INVERSE_DEPTH
    tag, upper_bits = np.int32(label), np.int32(~LABEL_BITS)
    for v in range(v0, v1):
        for u in range(u0, u1):
            x, y = xs[v, u] - x0, ys[v, u] - y0
            e, f, g = (c[t, 2] + c[t, 3] * x + c[t, 4] * y, c[t, 5] + c[t, 6] * x + c[t, 7] * y,
                       c[t, 8] + c[t, 9] * x + c[t, 10] * y)  # fmt: skip
            w = c[t, d] + c[t, d + 1] * x + c[t, d + 2] * y
            packed = (np.float32(w).view(np.int32) & upper_bits) | tag
            row, column = v - row_offset, u - column_offset
            if e >= _ZERO and f >= _ZERO and g >= _ZERO and w > _ZERO and packed > buffer[row, column]:
                buffer[row, column] = packed
                numbers[row, column] = number


@compiled
def _draw_wide(c, t, label, number, xs, ys, u0, v0, u1, v1, row_offset, column_offset, buffer, numbers):
    x0, y0 = c[t, ORIGIN], c[t, ORIGIN + 1]
    e0, e1, e2, f0, f1, f2, g0, g1, g2 = (c[t, 2], c[t, 3], c[t, 4], c[t, 5], c[t, 6], c[t, 7], c[t, 8], c[t, 9],
                                          c[t, 10])  # fmt: skip
    w0, w1, w2 = c[t, INVERSE_DEPTH], c[t, INVERSE_DEPTH + 1], c[t, INVERSE_DEPTH + 2]
    tag, upper_bits, own = np.int32(label), np.int32(~LABEL_BITS), np.int32(number)
    for v in range(v0, v1):
        for u in range(u0 // LANES * LANES, u1, LANES):
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
