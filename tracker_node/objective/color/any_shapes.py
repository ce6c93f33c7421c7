"""Bodies of any shapes against the image of one camera: pixel by pixel from what the ray-caster says is in front.

For boxes and meshes, and for whatever the kernels of smooth shapes leave out (a camera within a cone's wedge). The same law, the
same sums; slower.
"""

from __future__ import annotations

import numpy as np

from ...camera.rig import Camera
from ...compiled.kernels import compiled
from ...model.configuration import Configuration
from ...render.raycast.kernels import LABEL_BITS, pixel_function, pixel_loop
from ...render.raycast.lighting import (
    AXIS,
    CONSTANT,
    FLOOR,
    INTENSITY,
    NEARNESS,
    PLACE,
    SLOPE,
    displayed,
    irradiance,
    lights_in_camera,
)
from ...render.raycast.raycaster import cast
from ...render.raycast.shading import COLORS, number_at, surface_at
from ...render.raycast.surface_arrays import surface_arrays
from .alignment_kernels import GRADIENT, PIXELS, SQUARES, SUM_IMAGE_SQUARES, SUM_MODEL_SQUARES, SUM_PRODUCTS
from .drawing import HEIGHT, PLANES, WIDTH
from .score_kernels import IMAGE_SQUARES, MODEL_SQUARES, PRODUCTS
from .views import ColorConstants, ColorViews

_NO_GAINS = np.ones(3, dtype=np.float32)
_ZERO, _HALF, _ONE, _FULL = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(255.0)


@compiled
def _recolor(frames, colors):
    """Give every shape one of ``colors`` (n, 3), whatever its faces had."""
    for s in range(colors.shape[0]):
        for face in range(6):
            for i in range(3):
                frames[s, COLORS + 3 * face + i] = colors[s, i]


@pixel_loop
def _score_any(
    buffer, numbers, column, xs, ys, u0, v0, u1, coefficients, frames, triangles, corners, levels, texels,
    lights, gain, power, planes, view, weights, image_gains, gained, total,
):  # fmt: skip
    """Squared differences and number of the pixels of a `raycaster.Cast` (whose fields come first), into ``total``
    (`score_kernels.N_TOTALS`,)."""
    width, size = view[WIDTH], view[WIDTH] * view[HEIGHT]
    squares, count = 0.0, 0
    for i in range(buffer.shape[0]):
        for j in range(u1 - u0):
            packed = buffer[i, column + j]
            if packed <= 0:
                continue
            x, y = xs[v0 + i, u0 + j], ys[v0 + i, u0 + j]
            px, py, pz, nx, ny, nz, r, g, b = surface_at(
                coefficients, frames, triangles, corners, levels, texels, (packed & LABEL_BITS) - 1,
                number_at(numbers, i, column + j), x, y,
            )  # fmt: skip
            lr, lg, lb = irradiance(lights, px, py, pz, nx, ny, nz)
            r, g, b = displayed(r, lr, gain[0], power), displayed(g, lg, gain[1], power), displayed(b, lb, gain[2], power)
            at = view[PLANES] + (v0 + i) * width + u0 + j
            tr, tg, tb = np.float32(planes[at]), np.float32(planes[at + size]), np.float32(planes[at + 2 * size])
            before = squares
            if gained:
                total[MODEL_SQUARES] += r * r + g * g + b * b
                total[PRODUCTS], total[IMAGE_SQUARES] = total[PRODUCTS] + r * tr, total[IMAGE_SQUARES] + tr * tr
                total[PRODUCTS + 1], total[IMAGE_SQUARES + 1] = total[PRODUCTS + 1] + g * tg, total[IMAGE_SQUARES + 1] + tg * tg
                total[PRODUCTS + 2], total[IMAGE_SQUARES + 2] = total[PRODUCTS + 2] + b * tb, total[IMAGE_SQUARES + 2] + tb * tb
            else:
                dr, dg, db = r - tr, g - tg, b - tb
                squares += weights[0] * (dr * dr + dg * dg + db * db)
            if weights[1] > _ZERO:
                m, t = _FULL / max(r + g + b, _ONE), _FULL / max(tr + tg + tb, _ONE)
                dr, dg, db = r * m - tr * t, g * m - tg * t, b * m - tb * t
                squares += weights[1] * (dr * dr + dg * dg + db * db)
            squares = min(squares, before + weights[2])
            count += 1
    total[0], total[1] = squares, count


@pixel_function
def _turning_light(lights, channel, x, y, z, nx, ny, nz):
    """How `irradiance` of one channel changes as the surface turns: sum of I (n x l) over the lights that reach it."""
    sx, sy, sz = _ZERO, _ZERO, _ZERO
    for i in range(lights.shape[0]):
        h = lights[i, NEARNESS]
        lx, ly, lz = lights[i, PLACE] - h * x, lights[i, PLACE + 1] - h * y, lights[i, PLACE + 2] - h * z
        inverse = _ONE / np.sqrt(lx * lx + ly * ly + lz * lz + np.float32(1e-30))
        lx, ly, lz = lx * inverse, ly * inverse, lz * inverse
        cosine = -(lx * lights[i, AXIS] + ly * lights[i, AXIS + 1] + lz * lights[i, AXIS + 2])
        f = min(max(lights[i, CONSTANT] + lights[i, SLOPE] * cosine, _ZERO), _ONE) * lights[i, INTENSITY + channel]
        if nx * lx + ny * ly + nz * lz <= lights[i, FLOOR]:
            f = _ZERO
        sx, sy, sz = sx + f * (ny * lz - nz * ly), sy + f * (nz * lx - nx * lz), sz + f * (nx * ly - ny * lx)
    return sx, sy, sz


@pixel_function
def _add(sums, s, weight, e, row):
    """Add one residual ``e`` with its ``row`` of the Jacobian to the sums of a shape, in the layout of `alignment_kernels`."""
    k = 0
    for i in range(6):
        for j in range(i, 6):
            sums[s, k] += weight * row[i] * row[j]
            k += 1
        sums[s, GRADIENT + i] += weight * e * row[i]


@pixel_loop
def _linearize_any(
    buffer, numbers, column, xs, ys, u0, v0, u1, coefficients, frames, triangles, corners, levels, texels,
    lights, gain, power, planes, view, weights, image_gains, gained, sums,
):  # fmt: skip
    """Sums (n_shapes, `alignment_kernels.N_SUMS`) over the pixels of a `raycaster.Cast`; see there for the derivatives."""
    width, height = view[WIDTH], view[HEIGHT]
    size = width * height
    for i in range(buffer.shape[0]):
        v = v0 + i
        if v < 1 or v >= height - 1:
            continue
        for j in range(u1 - u0):
            packed, u = buffer[i, column + j], u0 + j
            if packed <= 0 or u < 1 or u >= width - 1:
                continue
            s = (packed & LABEL_BITS) - 1
            x, y = xs[v, u], ys[v, u]
            px, py, pz, nx, ny, nz, cr, cg, cb = surface_at(
                coefficients, frames, triangles, corners, levels, texels, s, number_at(numbers, i, column + j), x, y
            )
            lr, lg, lb = irradiance(lights, px, py, pz, nx, ny, nz)
            r, g, b = displayed(cr, lr, gain[0], power), displayed(cg, lg, gain[1], power), displayed(cb, lb, gain[2], power)
            xu, xv = _HALF * (xs[v, u + 1] - xs[v, u - 1]), _HALF * (xs[v + 1, u] - xs[v - 1, u])
            yu, yv = _HALF * (ys[v, u + 1] - ys[v, u - 1]), _HALF * (ys[v + 1, u] - ys[v - 1, u])
            det = xu * yv - xv * yu
            if not abs(det) > _ZERO:  # a neighbor has no ray
                continue
            at, w = view[PLANES] + v * width + u, _ONE / pz
            tr, tg, tb = np.float32(planes[at]), np.float32(planes[at + size]), np.float32(planes[at + 2 * size])
            in_model, in_image = _FULL / max(r + g + b, _ONE), _FULL / max(tr + tg + tb, _ONE)
            if gained:
                sums[s, SUM_MODEL_SQUARES] += r * r + g * g + b * b
                for channel in range(3):
                    shown, seen = (r, tr) if channel == 0 else ((g, tg) if channel == 1 else (b, tb))
                    sums[s, SUM_PRODUCTS + channel] += shown * seen
                    sums[s, SUM_IMAGE_SQUARES + channel] += seen * seen
            er, eg, eb = r - image_gains[0] * tr, g - image_gains[1] * tg, b - image_gains[2] * tb
            fr, fg, fb = r * in_model - tr * in_image, g * in_model - tg * in_image, b * in_model - tb * in_image
            sums[s, SQUARES] += weights[0] * (er * er + eg * eg + eb * eb) + weights[1] * (fr * fr + fg * fg + fb * fb)
            sums[s, PIXELS] += 1.0
            total_x, total_y = _ZERO, _ZERO
            for channel in range(3):
                at_channel = at + channel * size
                du = _HALF * (np.float32(planes[at_channel + 1]) - np.float32(planes[at_channel - 1]))
                dv = _HALF * (np.float32(planes[at_channel + width]) - np.float32(planes[at_channel - width]))
                gx, gy = (du * yv - dv * yu) / det, (dv * xu - du * xv) / det
                total_x, total_y = total_x + gx, total_y + gy
                if weights[0] > _ZERO:
                    e, shown, light = er, r, lr
                    if channel == 1:
                        e, shown, light = eg, g, lg
                    elif channel == 2:
                        e, shown, light = eb, b, lb
                    sx, sy, sz = _turning_light(lights, channel, px, py, pz, nx, ny, nz)
                    k = power * shown / light if light > _ZERO and shown < _FULL else _ZERO
                    gx, gy = image_gains[channel] * gx, image_gains[channel] * gy
                    _add(
                        sums, s, weights[0], e,
                        (-gx * w, -gy * w, w * (gx * x + gy * y), gx * x * y + gy * (_ONE + y * y) + k * sx,
                         k * sy - gx * (_ONE + x * x) - gy * x * y, gx * y - gy * x + k * sz),
                    )  # fmt: skip
            if weights[1] > _ZERO:
                share = in_image / _FULL
                for channel in range(3):
                    at_channel = at + channel * size
                    du = _HALF * (np.float32(planes[at_channel + 1]) - np.float32(planes[at_channel - 1]))
                    dv = _HALF * (np.float32(planes[at_channel + width]) - np.float32(planes[at_channel - width]))
                    e = fr if channel == 0 else (fg if channel == 1 else fb)
                    t = share * (tr if channel == 0 else (tg if channel == 1 else tb))
                    gx = in_image * ((du * yv - dv * yu) / det - t * total_x)
                    gy = in_image * ((dv * xu - du * xv) / det - t * total_y)
                    _add(
                        sums, s, weights[1], e,
                        (-gx * w, -gy * w, w * (gx * x + gy * y), gx * x * y + gy * (_ONE + y * y),
                         -gx * (_ONE + x * x) - gy * x * y, gx * y - gy * x),
                    )  # fmt: skip


def _arguments(
    configuration: Configuration, camera: Camera, constants: ColorConstants, index: int, views: ColorViews, weights: np.ndarray,
    image_gains: np.ndarray, gained: bool,
) -> tuple:
    """What both kernels take."""
    found = cast(configuration, camera, (0, 0, camera.model.width, camera.model.height))
    if constants.recolored:
        _recolor(found.frames, constants.colors_rgb[index])
    surfaces, (u0, v0, u1, _) = surface_arrays(configuration.model), found.region
    return (
        found.buffer, found.numbers, found.column, found.table.xs, found.table.ys, u0, v0, u1,
        found.coefficients, found.frames, found.triangles, surfaces.corners, surfaces.levels, surfaces.texels,
        lights_in_camera(constants.lights, camera.T_cam_world), np.array(camera.gain, dtype=np.float32),
        np.float32(1.0 / camera.gamma), views.planes, views.views[index], weights, image_gains, gained,
    )  # fmt: skip


def score_with_cast(
    configuration: Configuration,
    camera: Camera,
    constants: ColorConstants,
    index: int,
    views: ColorViews,
    weights: np.ndarray,
    gained: bool,
    total: np.ndarray,
) -> None:
    """Squared color differences and pixels of one camera.

    Parameters
    ----------
    configuration : the body in its state.
    camera, constants, index, views : the camera, the constants of all, its place among them, and their images.
    weights : (3,) of the raw and the normalized difference, and the most that a pixel counts.
    gained : whether the raw difference is left out, and what a gain of the image depends on filled.
    total : (`score_kernels.N_TOTALS`,), overwritten but for the status.
    """
    total[MODEL_SQUARES:] = 0.0
    _score_any(*_arguments(configuration, camera, constants, index, views, weights, _NO_GAINS, gained), total)


def linearize_with_cast(
    configuration: Configuration,
    camera: Camera,
    constants: ColorConstants,
    index: int,
    views: ColorViews,
    weights: np.ndarray,
    image_gains: np.ndarray,
    gained: bool,
    sums: np.ndarray,
) -> None:
    """Sums of the shapes in one camera.

    Parameters
    ----------
    configuration, camera, constants, index, views : see `score_with_cast`.
    weights : (2,) of the raw and the normalized difference.
    image_gains, gained : (3,) float32 of the image's channels; whether the sums that they depend on are filled.
    sums : (n_shapes, `alignment_kernels.N_SUMS`), overwritten.
    """
    sums[:] = 0.0
    _linearize_any(*_arguments(configuration, camera, constants, index, views, weights, image_gains, gained), sums)
