"""Smooth bodies aligned with images: residuals of colors, their derivatives and the sums of a least-squares problem.

A point X of the surface, seen at a pixel, has the color C that the model gives it there, and the image another, I. The residual
C - I of each channel changes with a twist (v, omega) of the point's link, in camera axes at the optical center:

    dr = -G . d(x, y) + dC,   d(x, y) = (v + omega x X) / z, projected,   dC = color sum I_k (omega x n) . l_k

G is the gradient of the image by normalized coordinates (central differences, through the lens), n the normal and l_k the
direction to each light that reaches the point; how the light of a spot changes with place is left out. All is summed per shape,
sixteen pixels at a time.
"""

from __future__ import annotations

import numpy as np

from ...camera.light import COS_INNER, COS_OUTER, DIRECTION, INTENSITY, N_LIGHT_COLUMNS, POSITION
from ...compiled.kernels import compiled
from ...render.raycast.coefficients import LINE, ORIGIN, QUADRATIC, UPPER
from .drawing import (
    CAP,
    COLOR,
    DISTORTED,
    FAST,
    HEIGHT,
    LABEL_BITS,
    LANES,
    NORMAL_0,
    NORMAL_ROOT,
    NORMAL_X,
    NORMAL_Y,
    PLANES,
    WIDTH,
    XS,
    YS,
    draw_body,
)  # fmt: skip
from .score_kernels import lights_in_camera

# Sums of a shape: the upper triangle of its 6x6 matrix row by row, its gradient, squares, number of pixels; and what the gains of
# images depend on, as of `score_kernels`, with the image as it is
N_TRIANGLE, GRADIENT, SQUARES, PIXELS = 21, 21, 27, 28
SUM_MODEL_SQUARES, SUM_PRODUCTS, SUM_IMAGE_SQUARES, N_SUMS = 29, 30, 33, 36

_N = np.uint64(LANES)
_AT = tuple(np.uint64(LANES * k) for k in range(N_SUMS))
_ZERO, _HALF, _ONE, _FULL = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(255.0)


@compiled(fastmath=FAST, inline="always")
def _row(gx, gy, x, y, w, sx, sy, sz):
    """Derivative of a residual by the twist (v, omega); ``s`` is that of the shading by omega."""
    return (
        -gx * w, -gy * w, w * (gx * x + gy * y),
        gx * x * y + gy * (_ONE + y * y) + sx, sy - gx * (_ONE + x * x) - gy * x * y, gx * y - gy * x + sz,
    )  # fmt: skip


@compiled(fastmath=FAST, inline="always")
def _add_rows(lanes, i, weight, r, g, b, er, eg, eb):
    """Add the residuals of the three channels at a pixel, each with its row of the Jacobian, to lane ``i``."""
    r0, r1, r2, r3, r4, r5 = r
    g0, g1, g2, g3, g4, g5 = g
    b0, b1, b2, b3, b4, b5 = b
    lanes[_AT[0] + i] += weight * (r0 * r0 + g0 * g0 + b0 * b0)
    lanes[_AT[1] + i] += weight * (r0 * r1 + g0 * g1 + b0 * b1)
    lanes[_AT[2] + i] += weight * (r0 * r2 + g0 * g2 + b0 * b2)
    lanes[_AT[3] + i] += weight * (r0 * r3 + g0 * g3 + b0 * b3)
    lanes[_AT[4] + i] += weight * (r0 * r4 + g0 * g4 + b0 * b4)
    lanes[_AT[5] + i] += weight * (r0 * r5 + g0 * g5 + b0 * b5)
    lanes[_AT[6] + i] += weight * (r1 * r1 + g1 * g1 + b1 * b1)
    lanes[_AT[7] + i] += weight * (r1 * r2 + g1 * g2 + b1 * b2)
    lanes[_AT[8] + i] += weight * (r1 * r3 + g1 * g3 + b1 * b3)
    lanes[_AT[9] + i] += weight * (r1 * r4 + g1 * g4 + b1 * b4)
    lanes[_AT[10] + i] += weight * (r1 * r5 + g1 * g5 + b1 * b5)
    lanes[_AT[11] + i] += weight * (r2 * r2 + g2 * g2 + b2 * b2)
    lanes[_AT[12] + i] += weight * (r2 * r3 + g2 * g3 + b2 * b3)
    lanes[_AT[13] + i] += weight * (r2 * r4 + g2 * g4 + b2 * b4)
    lanes[_AT[14] + i] += weight * (r2 * r5 + g2 * g5 + b2 * b5)
    lanes[_AT[15] + i] += weight * (r3 * r3 + g3 * g3 + b3 * b3)
    lanes[_AT[16] + i] += weight * (r3 * r4 + g3 * g4 + b3 * b4)
    lanes[_AT[17] + i] += weight * (r3 * r5 + g3 * g5 + b3 * b5)
    lanes[_AT[18] + i] += weight * (r4 * r4 + g4 * g4 + b4 * b4)
    lanes[_AT[19] + i] += weight * (r4 * r5 + g4 * g5 + b4 * b5)
    lanes[_AT[20] + i] += weight * (r5 * r5 + g5 * g5 + b5 * b5)
    lanes[_AT[21] + i] += weight * (r0 * er + g0 * eg + b0 * eb)
    lanes[_AT[22] + i] += weight * (r1 * er + g1 * eg + b1 * eb)
    lanes[_AT[23] + i] += weight * (r2 * er + g2 * eg + b2 * eb)
    lanes[_AT[24] + i] += weight * (r3 * er + g3 * eg + b3 * eb)
    lanes[_AT[25] + i] += weight * (r4 * er + g4 * eg + b4 * eb)
    lanes[_AT[26] + i] += weight * (r5 * er + g5 * eg + b5 * eb)


@compiled(fastmath=FAST)
def _linearize_smooth(form, c, surface, label, view, rays, planes, box, spans, origin, stride, buffer, lights, base, weights,
                      image_gains, lanes, sums):  # fmt: skip
    """Sums (`N_SUMS`,) of one shape; ``lanes`` (16 `N_SUMS`,) float32 is work space."""
    lanes[:] = _ZERO
    x0, y0 = c[ORIGIN], c[ORIGIN + 1]
    q00, q10, q01, q20, q11, q02 = (c[QUADRATIC], c[QUADRATIC + 1], c[QUADRATIC + 2], c[QUADRATIC + 3],
                                    c[QUADRATIC + 4], c[QUADRATIC + 5])  # fmt: skip
    l0, l1, l2 = c[LINE], c[LINE + 1], c[LINE + 2]
    h0, h1, h2 = c[UPPER], c[UPPER + 1], c[UPPER + 2]
    n0x, n0y, n0z = surface[NORMAL_0], surface[NORMAL_0 + 1], surface[NORMAL_0 + 2]
    nxx, nxy, nxz = surface[NORMAL_X], surface[NORMAL_X + 1], surface[NORMAL_X + 2]
    nyx, nyy, nyz = surface[NORMAL_Y], surface[NORMAL_Y + 1], surface[NORMAL_Y + 2]
    nwx, nwy, nwz = surface[NORMAL_ROOT], surface[NORMAL_ROOT + 1], surface[NORMAL_ROOT + 2]
    cx, cy, cz = surface[CAP], surface[CAP + 1], surface[CAP + 2]
    red, green, blue = surface[COLOR], surface[COLOR + 1], surface[COLOR + 2]
    base_r, base_g, base_b = base[0], base[1], base[2]
    raw_weight, normalized_weight = weights[0], weights[1]
    tag, low_bits = np.int32(label), np.int32(LABEL_BITS)
    distorted, width, height = view[DISTORTED], view[WIDTH], view[HEIGHT]
    size = width * height
    per_column = rays[view[XS] + 1] - rays[view[XS]]
    per_row = rays[view[YS] + LANES] - rays[view[YS]]
    table_row = width + LANES
    last_column = min(box[2], width - 1)
    n_directional, n_lights = len(form[0]), len(form[0]) + len(form[1])
    raw, normalized = len(form[3]) > 0, len(form[4]) > 0
    gained = raw and len(form[5]) > 0
    gain_r, gain_g, gain_b = image_gains[0], image_gains[1], image_gains[2]
    for v in range(max(box[1], 1), min(box[3], height - 1)):
        x_start = view[XS] + v * table_row * distorted
        y_start = view[YS] + v * (table_row if distorted else LANES)
        row = (v - origin[1]) * stride - origin[0]
        pixel = view[PLANES] + v * width
        for u in range(max(spans[v, 0], 1), min(spans[v, 1], last_column), LANES):
            at_x, at_y, at = np.uint64(x_start + u), np.uint64(y_start + u * distorted), np.uint64(row + u)
            shown = False
            for i in range(_N):
                shown |= (buffer[at + i] & low_bits) == tag
            if not shown:
                continue
            at_red, at_green = np.uint64(pixel + u), np.uint64(pixel + size + u)
            at_blue = np.uint64(pixel + 2 * size + u)
            line = np.uint64(width)
            up_red, up_green, up_blue = at_red - line, at_green - line, at_blue - line
            down_red, down_green, down_blue = at_red + line, at_green + line, at_blue + line
            one, room = np.uint64(1), np.uint64(last_column - u)
            step = np.uint64(table_row)
            for i in range(_N):
                own = _ONE if ((buffer[at + i] & low_bits) == tag) & (i < room) else _ZERO
                mine = own > _ZERO
                xn, yn = rays[at_x + i], rays[at_y + i]
                xn, yn = xn if mine else x0, yn if mine else y0  # where there is no ray, it is not a number
                x, y = xn - x0, yn - y0
                q = q00 + x * (q10 + q20 * x + q11 * y) + y * (q01 + q02 * y)
                root = np.sqrt(q if q > _ZERO else _ZERO)
                curved = l0 + l1 * x + l2 * y + root
                high = h0 + h1 * x + h2 * y
                cap = high < curved
                w = high if cap else curved
                r, g, b = base_r, base_g, base_b
                rx, ry, rz, gx, gy, gz, bx, by, bz = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
                if n_lights > 0:
                    nx = n0x + nxx * x + nyx * y + nwx * root
                    ny = n0y + nxy * x + nyy * y + nwy * root
                    nz = n0z + nxz * x + nyz * y + nwz * root
                    inverse = _ONE / np.sqrt(nx * nx + ny * ny + nz * nz)
                    nx, ny, nz = cx if cap else nx * inverse, cy if cap else ny * inverse, cz if cap else nz * inverse
                    for k in range(n_lights):
                        m = k * N_LIGHT_COLUMNS
                        edge = _ONE
                        lx, ly, lz = -lights[m + DIRECTION], -lights[m + DIRECTION + 1], -lights[m + DIRECTION + 2]
                        if k >= n_directional:
                            z = _ONE / w
                            px, py = lights[m + POSITION] - xn * z, lights[m + POSITION + 1] - yn * z
                            pz = lights[m + POSITION + 2] - z
                            near = _ONE / np.sqrt(px * px + py * py + pz * pz)
                            px, py, pz = px * near, py * near, pz * near
                            edge = (px * lx + py * ly + pz * lz - lights[m + COS_OUTER]) * lights[m + COS_INNER]
                            edge = edge if edge > _ZERO else _ZERO
                            edge = edge if edge < _ONE else _ONE
                            lx, ly, lz = px, py, pz
                        f = nx * lx + ny * ly + nz * lz
                        edge = edge if f > _ZERO else _ZERO
                        f = f * edge
                        ir, ig, ib = lights[m + INTENSITY], lights[m + INTENSITY + 1], lights[m + INTENSITY + 2]
                        r, g, b = r + ir * f, g + ig * f, b + ib * f
                        tx, ty, tz = edge * (ny * lz - nz * ly), edge * (nz * lx - nx * lz), edge * (nx * ly - ny * lx)
                        rx, ry, rz = rx + ir * tx, ry + ir * ty, rz + ir * tz
                        gx, gy, gz = gx + ig * tx, gy + ig * ty, gz + ig * tz
                        bx, by, bz = bx + ib * tx, by + ib * ty, bz + ib * tz
                    # A channel that is at its limit stays there
                    open_r = red if red * r < _FULL else _ZERO
                    open_g = green if green * g < _FULL else _ZERO
                    open_b = blue if blue * b < _FULL else _ZERO
                    rx, ry, rz = open_r * rx, open_r * ry, open_r * rz
                    gx, gy, gz = open_g * gx, open_g * gy, open_g * gz
                    bx, by, bz = open_b * bx, open_b * by, open_b * bz
                r, g, b = red * r, green * g, blue * b
                r, g, b = r if r < _FULL else _FULL, g if g < _FULL else _FULL, b if b < _FULL else _FULL
                tr, tg, tb = np.float32(planes[at_red + i]), np.float32(planes[at_green + i]), np.float32(planes[at_blue + i])
                # Image gradients by column and row, then by normalized coordinates
                ur = _HALF * (np.float32(planes[at_red + i + one]) - np.float32(planes[at_red + i - one]))
                ug = _HALF * (np.float32(planes[at_green + i + one]) - np.float32(planes[at_green + i - one]))
                ub = _HALF * (np.float32(planes[at_blue + i + one]) - np.float32(planes[at_blue + i - one]))
                vr = _HALF * (np.float32(planes[down_red + i]) - np.float32(planes[up_red + i]))
                vg = _HALF * (np.float32(planes[down_green + i]) - np.float32(planes[up_green + i]))
                vb = _HALF * (np.float32(planes[down_blue + i]) - np.float32(planes[up_blue + i]))
                if distorted:
                    xu = _HALF * (rays[at_x + i + one] - rays[at_x + i - one])
                    xv = _HALF * (rays[at_x + i + step] - rays[at_x + i - step])
                    yu = _HALF * (rays[at_y + i + one] - rays[at_y + i - one])
                    yv = _HALF * (rays[at_y + i + step] - rays[at_y + i - step])
                    xu, xv, yu, yv = xu if mine else _ONE, xv if mine else _ZERO, yu if mine else _ZERO, yv if mine else _ONE
                    det = _ONE / (xu * yv - xv * yu)
                    a, d, e, h = yv * det, -yu * det, -xv * det, xu * det
                else:
                    a, d, e, h = _ONE / per_column, _ZERO, _ZERO, _ONE / per_row
                ur, vr = ur * a + vr * d, ur * e + vr * h
                ug, vg = ug * a + vg * d, ug * e + vg * h
                ub, vb = ub * a + vb * d, ub * e + vb * h
                square = _ZERO
                if raw:
                    r0, r1, r2, r3, r4, r5 = _row(gain_r * ur, gain_r * vr, xn, yn, w, rx, ry, rz)
                    g0, g1, g2, g3, g4, g5 = _row(gain_g * ug, gain_g * vg, xn, yn, w, gx, gy, gz)
                    b0, b1, b2, b3, b4, b5 = _row(gain_b * ub, gain_b * vb, xn, yn, w, bx, by, bz)
                    er, eg, eb = r - gain_r * tr, g - gain_g * tg, b - gain_b * tb
                    square += raw_weight * (er * er + eg * eg + eb * eb)
                if normalized:
                    in_model, in_image = r + g + b, tr + tg + tb
                    in_model = _FULL / (in_model if in_model > _ONE else _ONE)
                    in_image = _FULL / (in_image if in_image > _ONE else _ONE)
                    fr, fg, fb = r * in_model - tr * in_image, g * in_model - tg * in_image, b * in_model - tb * in_image
                    square += normalized_weight * (fr * fr + fg * fg + fb * fb)
                    # 255 c / s changes by 255 / s (dc - c ds / s)
                    share = in_image / _FULL
                    su, sv = (ur + ug + ub) * share, (vr + vg + vb) * share
                    urn, vrn = in_image * (ur - tr * su), in_image * (vr - tr * sv)
                    k0, k1, k2, k3, k4, k5 = _row(urn, vrn, xn, yn, w, _ZERO, _ZERO, _ZERO)
                    ugn, vgn = in_image * (ug - tg * su), in_image * (vg - tg * sv)
                    m0, m1, m2, m3, m4, m5 = _row(ugn, vgn, xn, yn, w, _ZERO, _ZERO, _ZERO)
                    ubn, vbn = in_image * (ub - tb * su), in_image * (vb - tb * sv)
                    p0, p1, p2, p3, p4, p5 = _row(ubn, vbn, xn, yn, w, _ZERO, _ZERO, _ZERO)
                if raw:
                    _add_rows(
                        lanes, i, own * raw_weight, (r0, r1, r2, r3, r4, r5), (g0, g1, g2, g3, g4, g5), (b0, b1, b2, b3, b4, b5),
                        er, eg, eb,
                    )  # fmt: skip
                if normalized:
                    _add_rows(
                        lanes, i, own * normalized_weight, (k0, k1, k2, k3, k4, k5), (m0, m1, m2, m3, m4, m5),
                        (p0, p1, p2, p3, p4, p5), fr, fg, fb,
                    )  # fmt: skip
                if gained:
                    lanes[_AT[SUM_MODEL_SQUARES] + i] += own * (r * r + g * g + b * b)
                    lanes[_AT[SUM_PRODUCTS] + i] += own * r * tr
                    lanes[_AT[SUM_PRODUCTS + 1] + i] += own * g * tg
                    lanes[_AT[SUM_PRODUCTS + 2] + i] += own * b * tb
                    lanes[_AT[SUM_IMAGE_SQUARES] + i] += own * tr * tr
                    lanes[_AT[SUM_IMAGE_SQUARES + 1] + i] += own * tg * tg
                    lanes[_AT[SUM_IMAGE_SQUARES + 2] + i] += own * tb * tb
                lanes[_AT[SQUARES] + i] += own * square
                lanes[_AT[PIXELS] + i] += own
    for k in range(N_SUMS):
        total = 0.0
        for i in range(LANES):
            total += lanes[k * LANES + i]
        sums[k] = total


@compiled(fastmath=FAST)
def linearize_camera(form, shapes, camera, pixels, lights, weights, image_gains, Ts_world_shape, work, sums):
    """Sums of one camera's shapes.

    Parameters
    ----------
    form : of `score_kernels.form_of`.
    shapes : kinds, dims, used (n,), colors (n, 3).
    camera : params, limits, T_cam_world, gain, base.
    pixels : view, rays, planes.
    lights : packed, those with a direction.
    weights : of the raw and the normalized difference.
    image_gains : (3,) float32, factors of the image's channels.
    Ts_world_shape : (n, 4, 4).
    work : coefficients, surfaces, boxes, spans, lights in camera axes, buffer, lanes.
    sums : (n, `N_SUMS`), overwritten.

    Returns
    -------
    What `prepare_camera` returns; the sums hold where it is `ALL_SMOOTH`.
    """
    kinds, dims, used, colors = shapes
    params, limits, T_cam_world, gain, base = camera
    view, rays, planes = pixels
    coefficients, surfaces, boxes, spans, camera_lights, buffer, lanes = work
    sums[:] = 0.0
    status, origin, stride = draw_body(
        (kinds, dims, used), colors, T_cam_world, Ts_world_shape, params, limits, view, rays,
        (coefficients, surfaces, boxes, spans), buffer,
    )  # fmt: skip
    if stride == 0:
        return status
    lights_in_camera(lights, T_cam_world, gain, camera_lights)
    for s in range(kinds.shape[0]):
        if boxes[s, 2] > boxes[s, 0]:
            _linearize_smooth(form, coefficients[s], surfaces[s], s + 1, view, rays, planes, boxes[s], spans[s], origin, stride,
                             buffer, camera_lights, base, weights, image_gains, lanes, sums[s])  # fmt: skip
    return status


@compiled
def add_to_links(sums, links, T_cam_world, link_normal, link_gradient):
    """Add the sums of one camera's shapes to those of their links.

    Twists are in world axes at the world's origin: v_cam = R v + t x R omega, omega_cam = R omega.

    Parameters
    ----------
    sums : (n_shapes, `N_SUMS`).
    links : (n_shapes,).
    T_cam_world : (4, 4).
    link_normal, link_gradient : (n_links, 6, 6) and (n_links, 6), added to.
    """
    A, N, NA = np.zeros((6, 6)), np.empty((6, 6)), np.empty((6, 6))
    tx, ty, tz = T_cam_world[0, 3], T_cam_world[1, 3], T_cam_world[2, 3]
    for j in range(3):
        for i in range(3):
            A[i, j] = A[3 + i, 3 + j] = T_cam_world[i, j]
        A[0, 3 + j] = ty * T_cam_world[2, j] - tz * T_cam_world[1, j]
        A[1, 3 + j] = tz * T_cam_world[0, j] - tx * T_cam_world[2, j]
        A[2, 3 + j] = tx * T_cam_world[1, j] - ty * T_cam_world[0, j]
    for s in range(sums.shape[0]):
        if sums[s, PIXELS] == 0.0:
            continue
        k = 0
        for i in range(6):
            for j in range(i, 6):
                N[i, j] = N[j, i] = sums[s, k]
                k += 1
        for i in range(6):
            for j in range(6):
                NA[i, j] = 0.0
                for m in range(6):
                    NA[i, j] += N[i, m] * A[m, j]
        for i in range(6):
            for m in range(6):
                link_gradient[links[s], i] += A[m, i] * sums[s, GRADIENT + m]
            for j in range(6):
                for m in range(6):
                    link_normal[links[s], i, j] += A[m, i] * NA[m, j]
