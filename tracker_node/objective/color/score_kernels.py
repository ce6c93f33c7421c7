"""Smooth bodies scored against images without an image being written: second pass of the color kernels, and all of a score.

The first pass has left, for every pixel, which shape is in front (see `drawing`). The second comes back to the pixels that
each shape has kept, shades them and compares them with the image. One kernel is compiled for each number of lights and each way
to compare, with the loops over lights unrolled: a pixel then is straight-line code, and sixteen go at a time. What it is compiled
for comes as the lengths of tuples, which are part of their types.
"""

from __future__ import annotations

import numpy as np

from ...camera.light import COS_INNER, COS_OUTER, DIRECTION, INTENSITY, N_LIGHT_COLUMNS, POSITION
from ...compiled.kernels import compiled
from ...render.raycast.coefficients import BIG, LINE, ORIGIN, QUADRATIC, UPPER
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
    pose_shapes,
)

# Of a camera: squared differences, pixels, status; of images that have a gain: squares of the model's colors (all channels),
# their products with the image's, and squares of the image's (each channel by itself)
MODEL_SQUARES, PRODUCTS, IMAGE_SQUARES, N_TOTALS = 3, 4, 7, 10

N_LIGHT_WORK = N_LIGHT_COLUMNS + 3  # of a light in camera axes, with its products with a normal's terms

_N = np.uint64(LANES)
_ZERO, _ONE, _TWO, _FULL = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(255.0)
_TINY = np.float32(1e-30)
_UNSEEN = np.float32(0.5 * BIG)  # upper bound of a surface whose caps are not seen


@compiled(fastmath=FAST)
def lights_in_camera(lights, T_cam_world, gain, out):
    """Lights with a direction in the axes of one camera.

    Parameters
    ----------
    lights : (n, .) packed, world.
    T_cam_world : (4, 4).
    gain : (3,) of the camera, taken into the intensities.
    out : flat, `N_LIGHT_COLUMNS` a light, overwritten; in place of a spot's inner cosine what its fall-off is multiplied by.
    """
    for k in range(lights.shape[0]):
        at = k * N_LIGHT_COLUMNS
        for i in range(3):
            place, along = T_cam_world[i, 3], 0.0
            for j in range(3):
                place += T_cam_world[i, j] * lights[k, POSITION + j]
                along += T_cam_world[i, j] * lights[k, DIRECTION + j]
            out[at + INTENSITY + i] = lights[k, INTENSITY + i] * gain[i]
            out[at + POSITION + i], out[at + DIRECTION + i] = place, along
        out[at + COS_OUTER] = lights[k, COS_OUTER]
        out[at + COS_INNER] = 1.0 / max(lights[k, COS_INNER] - lights[k, COS_OUTER], 1e-9)


def form_of(
    n_directional: int, n_spots: int, gamma: bool, raw: bool, normalized: bool, gained: bool = False, capped: bool = False
) -> tuple:
    """What the kernels are compiled for.

    Parameters
    ----------
    n_directional, n_spots : lights, in this order in what the kernel is given (a point light is a spot of every direction).
    gamma : whether any camera has a gamma other than one.
    raw, normalized : which differences count.
    gained : whether raw differences are those from images times a gain, see `gains`.
    capped : whether the squares of a pixel count up to a limit; not with gains.

    Returns
    -------
    Tuples whose lengths are the arguments: lengths are part of a compiled function's types. The last is there only if capped.
    """
    lengths = (n_directional, n_spots, gamma, raw, normalized, gained)
    return tuple((0,) * int(n) for n in (*lengths, *((1,) if capped else ())))


@compiled(fastmath=FAST)
def _score_smooth(form, straight, c, surface, label, view, rays, planes, box, spans, origin, stride, buffer, lights, base,
                  weights, total):  # fmt: skip
    """Add the squared differences of one shape's pixels to ``total[0]``, their number to ``total[1]``.

    Where images have a gain, raw differences are left out, and the products that they depend on added from `MODEL_SQUARES` on.
    ``base`` (4,) is what every pixel gets before the lights with a direction, and 1 / gamma; ``weights`` of the raw and the
    normalized difference, and the most that the squares of a pixel count.

    With a ``straight`` of length one no ray is distorted, no cap is seen and all lights are directional: all that does not vary
    along a row is found once for it, and of the normal only its length and its products with the lights, polynomials in x and
    the root.
    """
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
    base_r, base_g, base_b, inverse_gamma = base[0], base[1], base[2], base[3]
    raw_weight, normalized_weight, most = weights[0], weights[1], weights[2]
    tag, low_bits = np.int32(label), np.int32(LABEL_BITS)
    distorted, width = view[DISTORTED], view[WIDTH]
    size = width * view[HEIGHT]
    all_squares, all_kept = np.float64(0.0), np.float64(0.0)
    n_directional, n_spots = len(form[0]), len(form[1])
    gamma, raw, normalized = len(form[2]) > 0, len(form[3]) > 0, len(form[4]) > 0
    gained, capped = raw and len(form[5]) > 0, len(form) > 6
    by_row = len(straight) > 0
    n_lights = n_directional + n_spots
    all_mm, all_rr, all_gg, all_bb = np.float64(0.0), np.float64(0.0), np.float64(0.0), np.float64(0.0)
    all_mr, all_mg, all_mb = np.float64(0.0), np.float64(0.0), np.float64(0.0)
    along = n_lights * N_LIGHT_COLUMNS  # after the lights: of each its products with the normal's terms in 1, x and the root
    p2, s1 = nxx * nxx + nxy * nxy + nxz * nxz, _TWO * (nxx * nwx + nxy * nwy + nxz * nwz)
    ww = nwx * nwx + nwy * nwy + nwz * nwz
    qv0, qv1, p0, p1, s0 = q00, q10, _ZERO, _ZERO, _ZERO
    for v in range(box[1], box[3]):
        if spans[v, 1] <= spans[v, 0]:
            continue
        x_start = view[XS] + v * (width + LANES) * distorted
        y_start = view[YS] + v * (width + LANES if distorted else LANES)
        row = (v - origin[1]) * stride - origin[0]
        pixel = view[PLANES] + v * width
        if by_row and n_lights > 0:
            y = rays[y_start] - y0
            qv0, qv1 = q00 + y * (q01 + q02 * y), q10 + q11 * y
            ax, ay, az = n0x + nyx * y, n0y + nyy * y, n0z + nyz * y
            p0, p1 = ax * ax + ay * ay + az * az, _TWO * (ax * nxx + ay * nxy + az * nxz)
            s0 = _TWO * (ax * nwx + ay * nwy + az * nwz)
            for k in range(n_directional):
                dx, dy, dz = (lights[k * N_LIGHT_COLUMNS + DIRECTION], lights[k * N_LIGHT_COLUMNS + DIRECTION + 1],
                              lights[k * N_LIGHT_COLUMNS + DIRECTION + 2])  # fmt: skip
                lights[along + 3 * k] = -(dx * ax + dy * ay + dz * az)
                lights[along + 3 * k + 1] = -(dx * nxx + dy * nxy + dz * nxz)
                lights[along + 3 * k + 2] = -(dx * nwx + dy * nwy + dz * nwz)
        for u in range(spans[v, 0], spans[v, 1], LANES):
            at_x, at_y, at = np.uint64(x_start + u), np.uint64(y_start + u * distorted), np.uint64(row + u)
            at_red, at_green, at_blue = np.uint64(pixel + u), np.uint64(pixel + size + u), np.uint64(pixel + 2 * size + u)
            shown = False
            for i in range(_N):
                shown |= (buffer[at + i] & low_bits) == tag
            if not shown:
                continue
            squares, kept = _ZERO, _ZERO
            mm, mr, mg, mb, rr, gg, bb = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
            for i in range(_N):
                own = _ONE if (buffer[at + i] & low_bits) == tag else _ZERO
                r, g, b = base_r, base_g, base_b
                if n_lights > 0:
                    xn = rays[at_x + i]
                    xn = xn if own > _ZERO else x0  # where there is no ray, it is not a number
                    x = xn - x0
                    if by_row:
                        q = qv0 + x * (qv1 + q20 * x)
                        q = q if q > _ZERO else _ZERO
                        root = np.sqrt(q)
                        length = p0 + x * (p1 + p2 * x) + root * (s0 + s1 * x) + ww * q
                        inverse = _ONE / np.sqrt(length if length > _TINY else _TINY)
                        for k in range(n_directional):
                            f = lights[along + 3 * k] + lights[along + 3 * k + 1] * x + lights[along + 3 * k + 2] * root
                            f = f if f > _ZERO else _ZERO
                            f = f * inverse
                            m = k * N_LIGHT_COLUMNS
                            r += lights[m + INTENSITY] * f
                            g += lights[m + INTENSITY + 1] * f
                            b += lights[m + INTENSITY + 2] * f
                    else:
                        yn = rays[at_y + i]
                        y = yn - y0
                        q = q00 + x * (q10 + q20 * x + q11 * y) + y * (q01 + q02 * y)
                        root = np.sqrt(q if q > _ZERO else _ZERO)
                        curved = l0 + l1 * x + l2 * y + root
                        high = h0 + h1 * x + h2 * y
                        cap = high < curved
                        w = high if cap else curved
                        nx = n0x + nxx * x + nyx * y + nwx * root
                        ny = n0y + nxy * x + nyy * y + nwy * root
                        nz = n0z + nxz * x + nyz * y + nwz * root
                        inverse = _ONE / np.sqrt(nx * nx + ny * ny + nz * nz)
                        nx, ny, nz = cx if cap else nx * inverse, cy if cap else ny * inverse, cz if cap else nz * inverse
                        for k in range(n_directional):
                            m = k * N_LIGHT_COLUMNS
                            f = -(nx * lights[m + DIRECTION] + ny * lights[m + DIRECTION + 1] + nz * lights[m + DIRECTION + 2])
                            f = f if f > _ZERO else _ZERO
                            r += lights[m + INTENSITY] * f
                            g += lights[m + INTENSITY + 1] * f
                            b += lights[m + INTENSITY + 2] * f
                        if n_spots > 0:
                            z = _ONE / w
                            for k in range(n_directional, n_lights):
                                m = k * N_LIGHT_COLUMNS
                                lx, ly = lights[m + POSITION] - xn * z, lights[m + POSITION + 1] - yn * z
                                lz = lights[m + POSITION + 2] - z
                                near = _ONE / np.sqrt(lx * lx + ly * ly + lz * lz)
                                f = (nx * lx + ny * ly + nz * lz) * near
                                f = f if f > _ZERO else _ZERO
                                away = lx * lights[m + DIRECTION] + ly * lights[m + DIRECTION + 1]
                                away += lz * lights[m + DIRECTION + 2]
                                edge = (-away * near - lights[m + COS_OUTER]) * lights[m + COS_INNER]
                                edge = edge if edge > _ZERO else _ZERO
                                f = f * (edge if edge < _ONE else _ONE)
                                r += lights[m + INTENSITY] * f
                                g += lights[m + INTENSITY + 1] * f
                                b += lights[m + INTENSITY + 2] * f
                    if gamma:
                        r, g, b = r**inverse_gamma, g**inverse_gamma, b**inverse_gamma
                r, g, b = red * r, green * g, blue * b
                r, g, b = r if r < _FULL else _FULL, g if g < _FULL else _FULL, b if b < _FULL else _FULL
                tr, tg, tb = np.float32(planes[at_red + i]), np.float32(planes[at_green + i]), np.float32(planes[at_blue + i])
                square = _ZERO
                if gained:
                    mm += own * (r * r + g * g + b * b)
                    mr, mg, mb = mr + own * r * tr, mg + own * g * tg, mb + own * b * tb
                    rr, gg, bb = rr + own * tr * tr, gg + own * tg * tg, bb + own * tb * tb
                elif raw:
                    dr, dg, db = r - tr, g - tg, b - tb
                    square = raw_weight * (dr * dr + dg * dg + db * db)
                if normalized:
                    in_model, in_image = r + g + b, tr + tg + tb
                    in_model = _FULL / (in_model if in_model > _ONE else _ONE)
                    in_image = _FULL / (in_image if in_image > _ONE else _ONE)
                    dr, dg, db = r * in_model - tr * in_image, g * in_model - tg * in_image, b * in_model - tb * in_image
                    square += normalized_weight * (dr * dr + dg * dg + db * db)
                if capped:
                    square = square if square < most else most
                squares += square * own
                kept += own
            all_squares += squares
            all_kept += kept
            if gained:
                all_mm, all_mr, all_mg, all_mb = all_mm + mm, all_mr + mr, all_mg + mg, all_mb + mb
                all_rr, all_gg, all_bb = all_rr + rr, all_gg + gg, all_bb + bb
    total[0] += all_squares
    total[1] += all_kept
    if gained:
        total[MODEL_SQUARES] += all_mm
        total[PRODUCTS] += all_mr
        total[PRODUCTS + 1] += all_mg
        total[PRODUCTS + 2] += all_mb
        total[IMAGE_SQUARES] += all_rr
        total[IMAGE_SQUARES + 1] += all_gg
        total[IMAGE_SQUARES + 2] += all_bb


@compiled(fastmath=FAST)
def _score_camera(form, model, view, params, limits, T_cam_world, gain, base, colors, Ts_world_shape, rays, planes, lights,
                  weights, work, total):  # fmt: skip
    """Squares, pixels, status and the rest of one camera into ``total`` (`N_TOTALS`,)."""
    coefficients, surfaces, boxes, spans, camera_lights, buffer = work
    total[:] = 0.0
    status, origin, stride = draw_body(
        model, colors, T_cam_world, Ts_world_shape, params, limits, view, rays, (coefficients, surfaces, boxes, spans), buffer
    )
    total[2] = status
    if stride == 0:
        return
    lights_in_camera(lights, T_cam_world, gain, camera_lights)
    for s in range(boxes.shape[0]):
        if boxes[s, 2] > boxes[s, 0]:
            given = (coefficients[s], surfaces[s], s + 1, view, rays, planes, boxes[s], spans[s], origin, stride, buffer,
                     camera_lights, base, weights, total)  # fmt: skip
            if len(form[1]) == 0 and not view[DISTORTED] and coefficients[s, UPPER] > _UNSEEN:
                _score_smooth(form, (0,), *given)
            else:
                _score_smooth(form, (), *given)


@compiled(fastmath=FAST)
def score_states(form, chain, shapes, cameras, images, options, roots, joints, camera_indices, work, totals):
    """Squares, pixels and status of states in some cameras.

    Parameters
    ----------
    form : of `form_of`.
    chain : what `forward_kinematics` takes of a kinematic chain.
    shapes : kinds, dims, links (n,), Ts_link_shape (n, 4, 4), used (n,).
    cameras : params, limits, T_cam_world, gain, base, colors (n_shapes, 3), each stacked over the cameras.
    images : views (n_cameras, `N_VIEW`), rays and planes (flat).
    options : packed lights with a direction, weights (3,).
    roots, joints : (n_states, 4, 4), (n_states, n_axes).
    camera_indices : of the cameras that are scored.
    work : coefficients, surfaces, boxes, spans, lights in camera axes (flat, `N_LIGHT_WORK` each), buffer.
    totals : (n_states, n_cameras, `N_TOTALS`), overwritten in these cameras; the status is what `prepare_camera` returns.
    """
    kinds, dims, links, Ts_link_shape, used = shapes
    params, limits, T_cam_world, gain, base, colors = cameras
    views, rays, planes = images
    lights, weights = options
    Ts_world_link, Ts_world_shape = np.empty((chain[0].shape[0], 4, 4)), np.empty((kinds.shape[0], 4, 4))
    twists = np.empty((6 + joints.shape[1], 6))
    for n in range(roots.shape[0]):
        pose_shapes(chain, links, Ts_link_shape, roots[n], joints[n], Ts_world_link, twists, Ts_world_shape)
        for index in range(camera_indices.shape[0]):
            at = camera_indices[index]
            _score_camera(form, (kinds, dims, used), views[at], params[at], limits[at], T_cam_world[at], gain[at], base[at],
                         colors[at], Ts_world_shape, rays, planes, lights, weights, work, totals[n, at])  # fmt: skip
