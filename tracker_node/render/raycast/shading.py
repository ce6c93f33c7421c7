"""Surfaces at one pixel, for kernels: where the ray meets the body, its normal and its color.

A loop over the pixels of a `raycaster.Cast`, with the arrays of that name in it, reads::

    packed = buffer[row, column]
    if packed > 0:
        shape, number = (packed & LABEL_BITS) - 1, number_at(numbers, row, column)
        px, py, pz, nx, ny, nz, r, g, b = surface_at(
            coefficients, frames, triangles, corners, levels, texels, shape, number, xs[v, u], ys[v, u]
        )
        lr, lg, lb = irradiance(lights, px, py, pz, nx, ny, nz)
        r, g, b = displayed(r, lr, gain[0], power), displayed(g, lg, gain[1], power), displayed(b, lb, gain[2], power)

All in the camera frame, in float32; ``lights`` from `lighting.lights_in_camera`, ``power`` is 1 / gamma. A mesh that is seen
from behind is shaded as if its normals were turned over. The kernel that has this loop should be a
`kernels.pixel_loop`.
"""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import compiled
from ..shape_arrays import CONE, OTHER
from . import mesh_kernels as mesh
from .coefficients import ABOVE, BELOW, BETWEEN, BOX, LINE, ORIGIN, QUADRATIC, UPPER
from .kernels import LABEL_BITS, pixel_function, pixel_loop
from .lighting import displayed, irradiance
from .surface_arrays import NO_TEXTURE, sample

_ZERO, _HALF, _ONE, _BIG, _TINY = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(1e30), np.float32(1e-30)

# Columns of a frame: rotation R_cam_shape row by row, place, then what each kind needs
# (curved: gradient of the surface as a matrix and an offset, outward normal of the cap on the camera's side; box: on which side
# of each pair of faces the camera is, 1 or -1, and half its size); kind and bounds as the ray-caster has them; width and height
# of a pixel in normalized coordinates; colors and textures of the faces of a box (of others: of the whole)
ROTATION, PLACE, GRADIENT, GRADIENT_OFFSET, CAP, SIDES, HALF_SIZE = 0, 9, 12, 21, 24, 12, 15
KIND, BOUNDS, PIXEL, COLORS, TEXTURES = 27, 28, 29, 31, 49
N_FRAME_COLUMNS = 55


@compiled
def fill_frames(kinds, bounds, dims, colors, textures, params, T_cam_world, Ts_world_shape, frames):
    """Fill what `surface_at` needs of each shape.

    Parameters
    ----------
    kinds, bounds, dims : (n,), (n,) and (n, 5) of the shapes, as the ray-caster has them.
    colors, textures : (n, 6, 3) and (n, 6) of `SurfaceArrays`.
    params : (`N_PARAMS`,) of the lens.
    T_cam_world : (4, 4).
    Ts_world_shape : (n, 4, 4).
    frames : (n, `N_FRAME_COLUMNS`), filled.
    """
    R, t, o, scale = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for s in range(kinds.shape[0]):
        row = frames[s]
        row[KIND], row[BOUNDS], row[PIXEL], row[PIXEL + 1] = kinds[s], bounds[s], 1.0 / params[0], 1.0 / params[1]
        for i in range(6):
            row[TEXTURES + i] = textures[s, i]
            for j in range(3):
                row[COLORS + 3 * i + j] = colors[s, i, j]
        for i in range(3):
            t[i] = T_cam_world[i, 3]
            for m in range(3):
                t[i] += T_cam_world[i, m] * Ts_world_shape[s, m, 3]
                R[i, m] = 0.0
                for j in range(3):
                    R[i, m] += T_cam_world[i, j] * Ts_world_shape[s, j, m]
        for j in range(3):
            o[j] = -(R[0, j] * t[0] + R[1, j] * t[1] + R[2, j] * t[2])
        for i in range(3):
            row[PLACE + i] = t[i]
            for j in range(3):
                row[ROTATION + 3 * i + j] = R[i, j]
        if kinds[s] == BOX:
            for j in range(3):
                row[SIDES + j] = 1.0 if o[j] > 0.0 else -1.0
                row[HALF_SIZE + j] = 0.5 * dims[s, j]
        elif kinds[s] != OTHER:
            # Half the gradient of x^2 / a^2 + y^2 / b^2 - (1 + k z)^2, or of the ellipsoid's form, times a^2 to keep it near one
            a, b, c = dims[s, 0], dims[s, 1], dims[s, 2]
            is_cone = kinds[s] == CONE
            scale[0], scale[1], scale[2] = 1.0, a * a / (b * b), (-a * a * c * c if is_cone else a * a / (c * c))
            offset = -a * a * c if is_cone else 0.0
            side = 1.0 if o[2] > 0.5 * (dims[s, 3] + dims[s, 4]) else -1.0
            for i in range(3):
                row[GRADIENT_OFFSET + i] = R[i, 2] * offset
                row[CAP + i] = R[i, 2] * side
                for j in range(3):
                    value = 0.0
                    for m in range(3):
                        value += R[i, m] * scale[m] * R[j, m]
                    row[GRADIENT + 3 * i + j] = value


@pixel_function
def _unit(x, y, z):
    inverse = _ONE / np.sqrt(x * x + y * y + z * z + _TINY)
    return x * inverse, y * inverse, z * inverse


@pixel_function
def _curved_at(c, frames, s, x, y):
    """Inverse depth and normal of an ellipsoid or a cone."""
    u, v, bounds = x - c[s, ORIGIN], y - c[s, ORIGIN + 1], frames[s, BOUNDS]
    q = (c[s, QUADRATIC] + u * (c[s, QUADRATIC + 1] + c[s, QUADRATIC + 3] * u + c[s, QUADRATIC + 4] * v)
         + v * (c[s, QUADRATIC + 2] + c[s, QUADRATIC + 5] * v))  # fmt: skip
    root = np.sqrt(max(q, _ZERO))
    high = c[s, UPPER] + c[s, UPPER + 1] * u + c[s, UPPER + 2] * v
    w = c[s, LINE] + c[s, LINE + 1] * u + c[s, LINE + 2] * v + (root if bounds == BETWEEN else -root)
    if high < w or bounds == ABOVE or (bounds == BELOW and q <= _ZERO):
        return high, frames[s, CAP], frames[s, CAP + 1], frames[s, CAP + 2]
    z = _ONE / w
    px, py, pz = x * z - frames[s, PLACE], y * z - frames[s, PLACE + 1], z - frames[s, PLACE + 2]
    g, o = GRADIENT, GRADIENT_OFFSET
    nx, ny, nz = _unit(
        frames[s, g] * px + frames[s, g + 1] * py + frames[s, g + 2] * pz + frames[s, o],
        frames[s, g + 3] * px + frames[s, g + 4] * py + frames[s, g + 5] * pz + frames[s, o + 1],
        frames[s, g + 6] * px + frames[s, g + 7] * py + frames[s, g + 8] * pz + frames[s, o + 2],
    )
    return w, nx, ny, nz


@pixel_function
def _box_at(c, s, x, y):
    """Inverse depth of a box, and the axis of its face that is seen."""
    u, v = x - c[s, ORIGIN], y - c[s, ORIGIN + 1]
    w, axis = _BIG, 0
    for j in range(3):
        bound = c[s, UPPER + 3 * j] + c[s, UPPER + 3 * j + 1] * u + c[s, UPPER + 3 * j + 2] * v
        if bound < w:
            w, axis = bound, j
    return w, axis


@pixel_function
def _box_color(c, frames, levels, texels, s, axis, x, y, w):
    positive = frames[s, SIDES + axis] > _ZERO
    face = 2 * axis + (0 if positive else 1)
    texture, color = int(frames[s, TEXTURES + face]), COLORS + 3 * face
    if texture == NO_TEXTURE:
        return frames[s, color], frames[s, color + 1], frames[s, color + 2]
    # Axes of the face that run right and up to a viewer outside, z (of the faces +z and -z: y) upright
    up = 2 if axis < 2 else 1
    right = 1 if axis == 0 else 0
    scale_u, scale_v = _HALF / frames[s, HALF_SIZE + right], -_HALF / frames[s, HALF_SIZE + up]
    if positive == (axis == 1):
        scale_u = -scale_u
    z = _ONE / w
    px, py, pz = x * z, y * z, z
    tx, ty, tz = px - frames[s, PLACE], py - frames[s, PLACE + 1], pz - frames[s, PLACE + 2]
    ax, ay, az = scale_u * frames[s, right], scale_u * frames[s, 3 + right], scale_u * frames[s, 6 + right]
    bx, by, bz = scale_v * frames[s, up], scale_v * frames[s, 3 + up], scale_v * frames[s, 6 + up]
    # The point moves by ((1, 0, 0) - p dw/dx) / w per unit of x, likewise y
    wx, wy = c[s, UPPER + 3 * axis + 1], c[s, UPPER + 3 * axis + 2]
    along_a, along_b = ax * px + ay * py + az * pz, bx * px + by * py + bz * pz
    dx, dy = frames[s, PIXEL] * z, frames[s, PIXEL + 1] * z
    return sample(
        levels, texels, texture,
        _HALF + ax * tx + ay * ty + az * tz, _HALF + bx * tx + by * ty + bz * tz,
        (ax - along_a * wx) * dx, (bx - along_b * wx) * dx, (ay - along_a * wy) * dy, (by - along_b * wy) * dy,
    )  # fmt: skip


@pixel_function
def _triangle_at(c, frames, corners, levels, texels, s, t, x, y):
    """Inverse depth, normal and color of triangle ``t`` of a mesh."""
    u, v = x - c[t, mesh.ORIGIN], y - c[t, mesh.ORIGIN + 1]
    wx, wy = c[t, mesh.INVERSE_DEPTH + 1], c[t, mesh.INVERSE_DEPTH + 2]
    w = c[t, mesh.INVERSE_DEPTH] + wx * u + wy * v
    z = _ONE / w
    a, b, d = (c[t, 2] + c[t, 3] * u + c[t, 4] * v) * z, (c[t, 5] + c[t, 6] * u + c[t, 7] * v) * z, (
        c[t, 8] + c[t, 9] * u + c[t, 10] * v) * z  # fmt: skip
    side = c[t, mesh.SIDE]
    nx = side * (a * corners[t, 0, 0] + b * corners[t, 1, 0] + d * corners[t, 2, 0])
    ny = side * (a * corners[t, 0, 1] + b * corners[t, 1, 1] + d * corners[t, 2, 1])
    nz = side * (a * corners[t, 0, 2] + b * corners[t, 1, 2] + d * corners[t, 2, 2])
    nx, ny, nz = _unit(
        frames[s, 0] * nx + frames[s, 1] * ny + frames[s, 2] * nz,
        frames[s, 3] * nx + frames[s, 4] * ny + frames[s, 5] * nz,
        frames[s, 6] * nx + frames[s, 7] * ny + frames[s, 8] * nz,
    )
    # Color, or place in the texture
    k0 = a * corners[t, 0, 3] + b * corners[t, 1, 3] + d * corners[t, 2, 3]
    k1 = a * corners[t, 0, 4] + b * corners[t, 1, 4] + d * corners[t, 2, 4]
    k2 = a * corners[t, 0, 5] + b * corners[t, 1, 5] + d * corners[t, 2, 5]
    texture = int(frames[s, TEXTURES])
    if texture != NO_TEXTURE:
        dx, dy = frames[s, PIXEL] * z, frames[s, PIXEL + 1] * z
        k0, k1, k2 = sample(
            levels, texels, texture, k0, k1,
            (c[t, 3] * corners[t, 0, 3] + c[t, 6] * corners[t, 1, 3] + c[t, 9] * corners[t, 2, 3] - k0 * wx) * dx,
            (c[t, 3] * corners[t, 0, 4] + c[t, 6] * corners[t, 1, 4] + c[t, 9] * corners[t, 2, 4] - k1 * wx) * dx,
            (c[t, 4] * corners[t, 0, 3] + c[t, 7] * corners[t, 1, 3] + c[t, 10] * corners[t, 2, 3] - k0 * wy) * dy,
            (c[t, 4] * corners[t, 0, 4] + c[t, 7] * corners[t, 1, 4] + c[t, 10] * corners[t, 2, 4] - k1 * wy) * dy,
        )  # fmt: skip
    return w, nx, ny, nz, k0, k1, k2


@pixel_function
def surface_at(coefficients, frames, triangles, corners, levels, texels, shape, number, x, y):
    """What the ray (x, y, 1) meets of ``shape``, which is known to be in front: point, unit normal, color.

    Parameters
    ----------
    coefficients, frames, triangles : of `raycaster.Cast`.
    corners, levels, texels : of `surface_arrays.SurfaceArrays`.
    shape : index of the shape.
    number : of the triangle, when the shape is a mesh.
    x, y : undistorted normalized coordinates of the pixel, float32.

    Returns
    -------
    (x, y, z, nx, ny, nz, r, g, b) float32: camera frame, meters; RGB of 0..255.
    """
    kind = frames[shape, KIND]
    if kind == OTHER:
        w, nx, ny, nz, r, g, b = _triangle_at(triangles, frames, corners, levels, texels, shape, number, x, y)
    elif kind == BOX:
        w, axis = _box_at(coefficients, shape, x, y)
        side = frames[shape, SIDES + axis]
        nx, ny, nz = side * frames[shape, axis], side * frames[shape, 3 + axis], side * frames[shape, 6 + axis]
        r, g, b = _box_color(coefficients, frames, levels, texels, shape, axis, x, y, w)
    else:
        w, nx, ny, nz = _curved_at(coefficients, frames, shape, x, y)
        r, g, b = frames[shape, COLORS], frames[shape, COLORS + 1], frames[shape, COLORS + 2]
    z = _ONE / w
    return x * z, y * z, z, nx, ny, nz, r, g, b


@pixel_function
def number_at(numbers, row, column):
    """Number of the triangle in front at a pixel.

    Parameters
    ----------
    numbers : (h, w) of `raycaster.Cast`; (0, 0) of a body without meshes.
    row, column : of the buffer.

    Returns
    -------
    int32 : 0 for a body without meshes.
    """
    return numbers[row, column] if numbers.shape[0] else np.int32(0)


@pixel_loop
def shade(
    buffer, numbers, column, xs, ys, u0, v0, coefficients, frames, triangles, corners, levels, texels,
    lights, gain, power, rgb, depth,
):  # fmt: skip
    """Colors and depth of what a buffer shows.

    Parameters
    ----------
    buffer, numbers : of `raycaster.Cast`.
    column : of the buffer where the result begins.
    xs, ys : of `RayTable`.
    u0, v0 : the pixel of the image where the result begins.
    coefficients, frames, triangles : of `raycaster.Cast`.
    corners, levels, texels : of `SurfaceArrays`.
    lights : of `lighting.lights_in_camera`.
    gain : (3,) of the camera, R, G, B.
    power : 1 / gamma of the camera.
    rgb : (h, w, 3) float32 in 0..255, filled where something is.
    depth : (h, w) float32, meters, filled where something is.
    """
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            packed = buffer[i, column + j]
            if packed > 0:
                shape, number = (packed & LABEL_BITS) - 1, number_at(numbers, i, column + j)
                x, y = xs[v0 + i, u0 + j], ys[v0 + i, u0 + j]
                px, py, pz, nx, ny, nz, r, g, b = surface_at(
                    coefficients, frames, triangles, corners, levels, texels, shape, number, x, y
                )
                lr, lg, lb = irradiance(lights, px, py, pz, nx, ny, nz)
                depth[i, j] = pz
                rgb[i, j, 0] = displayed(r, lr, gain[0], power)
                rgb[i, j, 1] = displayed(g, lg, gain[1], power)
                rgb[i, j, 2] = displayed(b, lb, gain[2], power)
