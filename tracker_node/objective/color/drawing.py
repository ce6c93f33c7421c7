"""Smooth shapes (ellipsoids and cones) drawn in vector instructions, sixteen pixels at a time: first pass of the color kernels.

It keeps, for every pixel, which shape is in front: the inverse depth's bits with the label in the lower eight, so that the
nearest shape is the largest integer. On a row of an undistorted image the pixels that a shape can cover lie between the roots of
a quadratic; a distorted one is searched in the shape's bounding box.

Loops of visibly sixteen rounds with unsigned indices, which store little or nothing, are what the compiler makes vectors of.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import NEAR
from ...compiled.kernels import compiled
from ...model.kinematic_chain import forward_kinematics
from ...render.raycast.coefficients import BIG, LINE, LOWER, ORIGIN, QUADRATIC, UPPER, farthest_depth, pixel_box
from ...render.shape_arrays import CONE, ELLIPSOID

LANES = 16
FAST = {"contract", "nsz", "arcp", "reassoc"}  # but not-a-number keeps its meaning: it is the ray of a pixel that does not exist
LABEL_BITS = 255
_ZERO, _ONE, _FULL = np.float32(0.0), np.float32(1.0), np.float32(255.0)
_FAR = np.float32(0.5 * BIG)
_UPPER_BITS = np.int32(~LABEL_BITS)

# Columns of a surface: what shades a pixel of a shape
NORMAL_0, NORMAL_X, NORMAL_Y, NORMAL_ROOT, CAP, COLOR, N_SURFACE = 0, 3, 6, 9, 12, 15, 18

_N = np.uint64(LANES)

# What prepare_camera says of a camera
ALL_SMOOTH, BEHIND, NOT_SMOOTH = 0, 1, 2

# Columns of a view's integers: where its pixels and rays start in the flat arrays, its size, and whether rays vary along rows
PLANES, XS, YS, WIDTH, HEIGHT, DISTORTED, N_VIEW = 0, 1, 2, 3, 4, 5, 6


@compiled
def box_of_all(boxes):
    """What the ``boxes`` (n, 4) of shapes that cover any pixel span together: (u0, v0, u1, v1), with u1 = 0 where there is none.

    A function of its own because its results are integers without a known value: begun in its callers, 1 << 30 would be part of
    a type, and whatever takes it compiled twice.
    """
    u0, v0, u1, v1 = 1 << 30, 1 << 30, 0, 0
    for s in range(boxes.shape[0]):
        if boxes[s, 2] > boxes[s, 0] and boxes[s, 3] > boxes[s, 1]:
            u0, v0, u1, v1 = min(u0, boxes[s, 0]), min(v0, boxes[s, 1]), max(u1, boxes[s, 2]), max(v1, boxes[s, 3])
    return u0, v0, u1, v1


@compiled(fastmath=FAST)
def pose_shapes(chain, links, Ts_link_shape, T_world_root, joint_positions, Ts_world_link, twists, Ts_world_shape):
    """Poses of all shapes in one state.

    Parameters
    ----------
    chain : what `forward_kinematics` takes of a kinematic chain.
    links, Ts_link_shape : (n,) and (n, 4, 4).
    T_world_root, joint_positions : (4, 4), and (n_axes,).
    Ts_world_link, twists : (n_links, 4, 4) and (n_dof, 6), overwritten.
    Ts_world_shape : (n, 4, 4), overwritten.
    """
    parents, offsets, axis_start, axis_count, directions = chain
    forward_kinematics(
        parents, offsets, axis_start, axis_count, directions, T_world_root, joint_positions, Ts_world_link, twists
    )  # fmt: skip
    for s in range(links.shape[0]):
        for i in range(4):
            for j in range(4):
                value = 0.0
                for k in range(4):
                    value += Ts_world_link[links[s], i, k] * Ts_link_shape[s, k, j]
                Ts_world_shape[s, i, j] = value


@compiled(fastmath=FAST)
def _conic_box(T, first, second, third, ahead, box):
    """Grow ``box`` (x0, y0, x1, y1) by the normalized coordinates of an ellipsoid, or of an ellipse (``third`` = 0), with its
    center ``ahead`` along the shape's z axis. False when it is not wholly in front of the camera.

    A plane n through the camera touches it where n' (e e' - f f' - g g' - h h') n = 0, e the center and f, g, h the half-axes.
    """
    ex, ey, ez = T[0, 3] + ahead * T[0, 2], T[1, 3] + ahead * T[1, 2], T[2, 3] + ahead * T[2, 2]
    f2, g2, h2 = first * first, second * second, third * third
    zz = ez * ez - f2 * T[2, 0] * T[2, 0] - g2 * T[2, 1] * T[2, 1] - h2 * T[2, 2] * T[2, 2]
    if ez < NEAR or zz <= NEAR * NEAR:
        return False
    xz = ex * ez - f2 * T[0, 0] * T[2, 0] - g2 * T[0, 1] * T[2, 1] - h2 * T[0, 2] * T[2, 2]
    yz = ey * ez - f2 * T[1, 0] * T[2, 0] - g2 * T[1, 1] * T[2, 1] - h2 * T[1, 2] * T[2, 2]
    xx = ex * ex - f2 * T[0, 0] * T[0, 0] - g2 * T[0, 1] * T[0, 1] - h2 * T[0, 2] * T[0, 2]
    yy = ey * ey - f2 * T[1, 0] * T[1, 0] - g2 * T[1, 1] * T[1, 1] - h2 * T[1, 2] * T[1, 2]
    x, y = xz / zz, yz / zz
    half_x, half_y = math.sqrt(max(x * x - xx / zz, 0.0)), math.sqrt(max(y * y - yy / zz, 0.0))
    box[0], box[1] = min(box[0], x - half_x), min(box[1], y - half_y)
    box[2], box[3] = max(box[2], x + half_x), max(box[3], y + half_y)
    return True


@compiled(fastmath=FAST)
def _pinhole_box(params, box, region, out):
    """Pixels ``out`` (u0, v0, u1, v1) within ``region`` whose centers lie in the normalized ``box``, of an undistorted camera."""
    out[0] = max(region[0], math.ceil(max(params[0] * box[0] + params[2], -1.0)))
    out[1] = max(region[1], math.ceil(max(params[1] * box[1] + params[3], -1.0)))
    out[2] = max(out[0], min(region[2], math.floor(min(params[0] * box[2] + params[2], 1e6)) + 1))
    out[3] = max(out[1], min(region[3], math.floor(min(params[1] * box[3] + params[3], 1e6)) + 1))


@compiled(fastmath=FAST)
def _bound_by_caps(dims, T, x0, y0, c):
    """Linear bounds of the inverse depth between a cone's two caps; returns which cap the camera sees: -1, 0 or 1.

    Along the axis the camera is at o and a point of the ray at o + d / w, d linear in the pixel.
    """
    o = -(T[0, 2] * T[0, 3] + T[1, 2] * T[1, 3] + T[2, 2] * T[2, 3])
    d0, d1, d2 = T[0, 2] * x0 + T[1, 2] * y0 + T[2, 2], T[0, 2], T[1, 2]
    below, above = o - dims[3], o - dims[4]
    below = below if abs(below) > 1e-12 else 1e-12
    above = above if abs(above) > 1e-12 else -1e-12
    if below > 0.0 and above > 0.0:
        near, far, side = above, below, 1
    elif below < 0.0 and above < 0.0:
        near, far, side = below, above, -1
    else:
        near, far, side = below, above, 0
    c[LOWER], c[LOWER + 1], c[LOWER + 2] = -d0 / far, -d1 / far, -d2 / far
    at = UPPER if side else LOWER + 3
    c[at], c[at + 1], c[at + 2] = -d0 / near, -d1 / near, -d2 / near
    return side


@compiled(fastmath=FAST)
def _smooth_coefficients(kind, dims, T, c, surface):
    """Fill coefficients and surface of one shape at T = T_cam_shape; False when the camera is not outside its (infinite) surface.

    The surface is (p - t)' A (p - t) + 2 a' (p - t) = 1. On the ray p = (x, y, 1) / w this is a quadratic in w; the normal there
    is along A r - g w with g = A t - a. All relative to the image of the shape's middle, so that float32 will do.
    """
    middle = 0.5 * (dims[3] + dims[4]) if kind == CONE else 0.0
    mz = T[2, 2] * middle + T[2, 3]
    x0, y0 = (T[0, 2] * middle + T[0, 3]) / mz, (T[1, 2] * middle + T[1, 3]) / mz
    m0, m1 = 1.0 / (dims[0] * dims[0]), 1.0 / (dims[1] * dims[1])
    m2, k = (-dims[2] * dims[2], -dims[2]) if kind == CONE else (1.0 / (dims[2] * dims[2]), 0.0)
    a00 = T[0, 0] * m0 * T[0, 0] + T[0, 1] * m1 * T[0, 1] + T[0, 2] * m2 * T[0, 2]
    a01 = T[0, 0] * m0 * T[1, 0] + T[0, 1] * m1 * T[1, 1] + T[0, 2] * m2 * T[1, 2]
    a02 = T[0, 0] * m0 * T[2, 0] + T[0, 1] * m1 * T[2, 1] + T[0, 2] * m2 * T[2, 2]
    a11 = T[1, 0] * m0 * T[1, 0] + T[1, 1] * m1 * T[1, 1] + T[1, 2] * m2 * T[1, 2]
    a12 = T[1, 0] * m0 * T[2, 0] + T[1, 1] * m1 * T[2, 1] + T[1, 2] * m2 * T[2, 2]
    a22 = T[2, 0] * m0 * T[2, 0] + T[2, 1] * m1 * T[2, 1] + T[2, 2] * m2 * T[2, 2]
    tx, ty, tz = T[0, 3], T[1, 3], T[2, 3]
    gx = a00 * tx + a01 * ty + a02 * tz - k * T[0, 2]
    gy = a01 * tx + a11 * ty + a12 * tz - k * T[1, 2]
    gz = a02 * tx + a12 * ty + a22 * tz - k * T[2, 2]
    scale = tx * gx + ty * gy + tz * gz - k * (T[0, 2] * tx + T[1, 2] * ty + T[2, 2] * tz) - 1.0
    if scale <= 1e-9:
        return False
    # Rays (x0 + x, y0 + y, 1): constant, x and y parts of A r
    rx, ry, rz = a00 * x0 + a01 * y0 + a02, a01 * x0 + a11 * y0 + a12, a02 * x0 + a12 * y0 + a22
    inverse = 1.0 / scale
    g0 = (gx * x0 + gy * y0 + gz) * inverse
    g1, g2 = gx * inverse, gy * inverse
    c[ORIGIN], c[ORIGIN + 1] = x0, y0
    c[LINE], c[LINE + 1], c[LINE + 2] = g0, g1, g2
    c[QUADRATIC] = g0 * g0 - (x0 * rx + y0 * ry + rz) * inverse
    c[QUADRATIC + 1] = 2.0 * (g0 * g1 - rx * inverse)
    c[QUADRATIC + 2] = 2.0 * (g0 * g2 - ry * inverse)
    c[QUADRATIC + 3] = g1 * g1 - a00 * inverse
    c[QUADRATIC + 4] = 2.0 * (g1 * g2 - a01 * inverse)
    c[QUADRATIC + 5] = g2 * g2 - a11 * inverse
    # With w = g0 + g1 x + g2 y + root the large parts of A r - g w cancel here, in double precision
    surface[NORMAL_0], surface[NORMAL_0 + 1], surface[NORMAL_0 + 2] = rx - gx * g0, ry - gy * g0, rz - gz * g0
    surface[NORMAL_X], surface[NORMAL_X + 1], surface[NORMAL_X + 2] = a00 - gx * g1, a01 - gy * g1, a02 - gz * g1
    surface[NORMAL_Y], surface[NORMAL_Y + 1], surface[NORMAL_Y + 2] = a01 - gx * g2, a11 - gy * g2, a12 - gz * g2
    surface[NORMAL_ROOT], surface[NORMAL_ROOT + 1], surface[NORMAL_ROOT + 2] = -gx, -gy, -gz
    for i in range(UPPER, LOWER + 6):
        c[i] = 0.0
    c[UPPER], c[LOWER], c[LOWER + 3] = BIG, -BIG, -BIG
    side = _bound_by_caps(dims, T, x0, y0, c) if kind == CONE else 0
    for i in range(3):
        surface[CAP + i] = side * T[i, 2]
    return True


@compiled(fastmath=FAST)
def prepare_camera(
    kinds, dims, colors, T_cam_world, Ts_world_shape, params, limits, view, region, used, coefficients, surfaces, boxes
):
    """Fill the coefficients, surfaces and pixel boxes of a camera's shapes.

    Parameters
    ----------
    kinds, dims, colors : (n,), (n, 5), (n, 3).
    T_cam_world, Ts_world_shape : (4, 4), and (n, 4, 4).
    params, limits, view : of the lens and its rays; row of `ColorViews`.
    region : (u0, v0, u1, v1) pixels in which shapes are drawn.
    used : (n,) shapes that are drawn.
    coefficients, surfaces : (n, .), and (n, `N_SURFACE`), overwritten.
    boxes : (n, 4) overwritten; empty for shapes that are not seen or not used.

    Returns
    -------
    `ALL_SMOOTH`, or why the rest is not valid.
    """
    T, box = np.empty((3, 4)), np.empty(4)
    in_front = False
    for s in range(kinds.shape[0]):
        boxes[s, 0], boxes[s, 1], boxes[s, 2], boxes[s, 3] = region[0], region[1], region[0], region[1]
        if not used[s]:
            continue
        for i in range(3):
            for j in range(4):
                T[i, j] = (T_cam_world[i, 0] * Ts_world_shape[s, 0, j] + T_cam_world[i, 1] * Ts_world_shape[s, 1, j]
                           + T_cam_world[i, 2] * Ts_world_shape[s, 2, j])  # fmt: skip
            T[i, 3] += T_cam_world[i, 3]
        if farthest_depth(kinds[s], dims[s], T) < NEAR:
            continue
        in_front = True
        box[0], box[1], box[2], box[3] = BIG, BIG, -BIG, -BIG
        if kinds[s] == ELLIPSOID:
            whole = _conic_box(T, dims[s, 0], dims[s, 1], dims[s, 2], 0.0, box)
        else:
            low, high = 1.0 + dims[s, 2] * dims[s, 3], 1.0 + dims[s, 2] * dims[s, 4]
            whole = _conic_box(T, low * dims[s, 0], low * dims[s, 1], 0.0, dims[s, 3], box)
            whole = whole and _conic_box(T, high * dims[s, 0], high * dims[s, 1], 0.0, dims[s, 4], box)
        if not whole or not _smooth_coefficients(kinds[s], dims[s], T, coefficients[s], surfaces[s]):
            return NOT_SMOOTH
        if view[DISTORTED]:
            pixel_box(params, box, limits, region, boxes[s])
        else:
            _pinhole_box(params, box, region, boxes[s])
        for i in range(3):
            surfaces[s, COLOR + i] = colors[s, i]
    return ALL_SMOOTH if in_front else BEHIND


@compiled(fastmath=FAST)
def find_spans(c, view, rays, box, spans):
    """Columns of each row that a curved surface may cover.

    Without distortion those between the roots of its quadratic along the row, and a margin.

    Parameters
    ----------
    c : its coefficients.
    view, rays : row and rays of `ColorViews`.
    box : (u0, v0, u1, v1) pixels.
    spans : (h, 2) int32; columns [spans[v, 0], spans[v, 1]) of each row v of the box are written.
    """
    first, last = np.float32(box[0]), np.float32(box[2])
    x_of_0, y_of_0 = rays[view[XS]] - c[ORIGIN], rays[view[YS]] - c[ORIGIN + 1]
    per_column, per_row = rays[view[XS] + 1] - rays[view[XS]], rays[view[YS] + LANES] - rays[view[YS]]
    a = c[QUADRATIC + 3]
    if view[DISTORTED] or a >= _ZERO:
        for v in range(box[1], box[3]):
            spans[v, 0], spans[v, 1] = box[0], box[2]
        return
    q00, q10, q01, q11, q02 = c[QUADRATIC], c[QUADRATIC + 1], c[QUADRATIC + 2], c[QUADRATIC + 4], c[QUADRATIC + 5]
    scale, offset = np.float32(0.5) / (a * per_column), -x_of_0 / per_column
    for v in range(box[1], box[3]):
        y = y_of_0 + np.float32(v) * per_row
        b = q10 + q11 * y
        discriminant = b * b - np.float32(4.0) * a * (q00 + y * (q01 + q02 * y))
        root = np.sqrt(discriminant if discriminant > _ZERO else _ZERO)
        low, high = (root - b) * scale + offset, np.float32(2.0) - (root + b) * scale + offset
        low = low if low > first else first
        high = high if high < last else last
        spans[v, 0] = np.int32(low)
        spans[v, 1] = np.int32(high if (discriminant > _ZERO) & (high > low) else low)


@compiled(fastmath=FAST, inline="always")
def _within(line, root, high, low_a, low_b):
    """Inverse depths at which a ray enters and leaves a surface between bounds."""
    enter, leave = line + root, line - root
    leave = leave if leave > low_a else low_a
    return enter if enter < high else high, leave if leave > low_b else low_b


@compiled(fastmath=FAST, inline="always")
def _nearer(enter, hit, tag, before):
    """What a pixel of the buffer holds after a shape: its own depth and label, where it is hit, or those ``before``."""
    packed = (np.float32(enter).view(np.int32) & _UPPER_BITS) | tag
    packed = packed if hit else np.int32(0)
    return packed if packed > before else before


@compiled(fastmath=FAST)
def draw_smooth(c, label, view, rays, box, spans, origin, stride, buffer):
    """First pass of one shape: its depth and label where it is in front.

    Parameters
    ----------
    c : its coefficients.
    label : from 1 on.
    view, rays, box, spans : see `find_spans`.
    origin, stride : (u, v) of the first pixel of the buffer, and the length of its rows.
    buffer : flat int32; depths with the label in the lowest bits, changed where the shape is nearer.
    """
    x0, y0 = c[ORIGIN], c[ORIGIN + 1]
    q00, q10, q01, q20, q11, q02 = (c[QUADRATIC], c[QUADRATIC + 1], c[QUADRATIC + 2], c[QUADRATIC + 3],
                                    c[QUADRATIC + 4], c[QUADRATIC + 5])  # fmt: skip
    l0, l1, l2 = c[LINE], c[LINE + 1], c[LINE + 2]
    h0, h1, h2 = c[UPPER], c[UPPER + 1], c[UPPER + 2]
    a0, a1, a2 = c[LOWER], c[LOWER + 1], c[LOWER + 2]
    b0, b1, b2 = c[LOWER + 3], c[LOWER + 4], c[LOWER + 5]
    tag = np.int32(label)
    distorted, width = view[DISTORTED], view[WIDTH]
    bounded = b0 > -_FAR or a0 > -_FAR
    for v in range(box[1], box[3]):
        x_start = view[XS] + v * (width + LANES) * distorted
        y_start = view[YS] + v * (width + LANES if distorted else LANES)
        row = (v - origin[1]) * stride - origin[0]
        if distorted:
            for u in range(spans[v, 0], spans[v, 1], LANES):
                at_x, at_y, at = np.uint64(x_start + u), np.uint64(y_start + u), np.uint64(row + u)
                for i in range(_N):
                    x, y = rays[at_x + i] - x0, rays[at_y + i] - y0
                    q = q00 + x * (q10 + q20 * x + q11 * y) + y * (q01 + q02 * y)
                    root = np.sqrt(q if q > _ZERO else _ZERO)
                    line = l0 + l1 * x + l2 * y
                    high = h0 + h1 * x + h2 * y
                    low_a, low_b = a0 + a1 * x + a2 * y, b0 + b1 * x + b2 * y
                    enter, leave = _within(line, root, high, low_a, low_b)
                    buffer[at + i] = _nearer(enter, (q > _ZERO) & (enter > leave) & (enter > _ZERO), tag, buffer[at + i])
            continue
        y = rays[y_start] - y0  # the same along the row, and with it all that depends on it alone
        qv0, qv1, lv = q00 + y * (q01 + q02 * y), q10 + q11 * y, l0 + l2 * y
        if bounded:
            hv, av, bv = h0 + h2 * y, a0 + a2 * y, b0 + b2 * y
            for u in range(spans[v, 0], spans[v, 1], LANES):
                at_x, at = np.uint64(x_start + u), np.uint64(row + u)
                for i in range(_N):
                    x = rays[at_x + i] - x0
                    q = qv0 + x * (qv1 + q20 * x)
                    root = np.sqrt(q if q > _ZERO else _ZERO)
                    line, high, low_a, low_b = lv + l1 * x, hv + h1 * x, av + a1 * x, bv + b1 * x
                    enter, leave = _within(line, root, high, low_a, low_b)
                    buffer[at + i] = _nearer(enter, (q > _ZERO) & (enter > leave) & (enter > _ZERO), tag, buffer[at + i])
        else:
            for u in range(spans[v, 0], spans[v, 1], LANES):
                at_x, at = np.uint64(x_start + u), np.uint64(row + u)
                for i in range(_N):
                    x = rays[at_x + i] - x0
                    q = qv0 + x * (qv1 + q20 * x)
                    enter = lv + l1 * x + np.sqrt(q if q > _ZERO else _ZERO)
                    buffer[at + i] = _nearer(enter, q > _ZERO, tag, buffer[at + i])


@compiled(fastmath=FAST)
def draw_body(shapes, colors, T_cam_world, Ts_world_shape, params, limits, view, rays, work, buffer):
    """First pass of a whole body in one camera.

    Parameters
    ----------
    shapes : kinds (n,), dims (n, 5), used (n,), of `prepare_camera`.
    colors, T_cam_world, Ts_world_shape, params, limits, view : see `prepare_camera`.
    rays : of `ColorViews`.
    work : coefficients, surfaces, boxes, of `prepare_camera`, and spans of each shape, of `find_spans`; overwritten.
    buffer : flat int32, as of `draw_smooth`; as much as the body needs is overwritten.

    Returns
    -------
    What `prepare_camera` returns; (u, v) of the first pixel of the buffer; length of its rows, 0 where nothing is seen.
    """
    kinds, dims, used = shapes
    coefficients, surfaces, boxes, spans = work
    region = np.empty(4, dtype=np.int64)
    region[0], region[1], region[2], region[3] = 0, 0, view[WIDTH], view[HEIGHT]
    status = prepare_camera(
        kinds, dims, colors, T_cam_world, Ts_world_shape, params, limits, view, region, used, coefficients, surfaces, boxes
    )
    stride = region[0]
    if status != ALL_SMOOTH:
        return status, (region[0], region[1]), stride
    u0, v0, u1, v1 = box_of_all(boxes)
    if u1 > u0:
        stride = u1 - u0 + LANES
        buffer[: stride * (v1 - v0) + LANES] = 0
        for s in range(kinds.shape[0]):
            if boxes[s, 2] > boxes[s, 0]:
                find_spans(coefficients[s], view, rays, boxes[s], spans[s])
                draw_smooth(coefficients[s], s + 1, view, rays, boxes[s], spans[s], (u0, v0), stride, buffer)
    return status, (u0, v0), stride
