"""Surfaces at one pixel, for kernels: where the ray meets the body, its normal and its color.

A loop over the pixels of a cast (`raycaster.cast`), with ``posed`` and ``surfaces`` of it, reads::

    packed = buffer[row, column]
    if packed > 0:
        shape = (packed & LABEL_BITS) - 1
        x, y = xs[v, u], ys[v, u]
        px, py, pz, nx, ny, nz, r, g, b = surface_at(posed, surfaces, shape, number_at(numbers, row, column), x, y)
        lr, lg, lb = irradiance(lights, px, py, pz, nx, ny, nz)
        r, g, b = displayed(r, lr, gain[0], power), displayed(g, lg, gain[1], power), displayed(b, lb, gain[2], power)

All in the camera frame, in float32; ``lights`` from `lighting.lights_in_camera`, ``power`` is 1 / gamma. A mesh that is seen
from behind is shaded as if its normals were turned over.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from . import mesh_kernels as mesh
from .lighting import displayed, irradiance
from .picture_sampling import sample
from .ray_coefficients import ABOVE, BELOW, BOX, LINE, ORIGIN, QUADRATIC, UPPER
from .ray_kernels import LABEL_BITS
from .shape_arrays import CONE, OTHER
from .surface_arrays import NO_PICTURE

_ZERO, _HALF, _ONE, _BIG, _TINY = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(1e30), np.float32(1e-30)

# Columns of a frame: rotation R_cam_shape row by row, place, then what each kind needs
# (curved: gradient of the surface as a matrix and an offset, outward normal of the cap on the camera's side; box: on which side
# of each pair of faces the camera is, 1 or -1)
ROTATION, PLACE, GRADIENT, GRADIENT_OFFSET, CAP, SIDES, HALF_SIZE = 0, 9, 12, 21, 24, 12, 15
N_FRAME_COLUMNS = 27


class PosedSurfaces(NamedTuple):
    """The shapes as one camera sees them.

    Attributes
    ----------
    kinds, bounds, coefficients : (n,), (n,) and (n, .), of the ray-caster.
    frames : (n, `N_FRAME_COLUMNS`) float32, of `fill_frames`.
    triangles : (m, .) float32, of `mesh_kernels.draw_mesh`.
    pixel : (2,) float32, width and height of a pixel in normalised coordinates.
    """

    kinds: np.ndarray
    bounds: np.ndarray
    coefficients: np.ndarray
    frames: np.ndarray
    triangles: np.ndarray
    pixel: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_frames(kinds, dims, T_cam_world, Ts_world_shape, frames):
    """Fill ``frames`` (n, `N_FRAME_COLUMNS`)."""
    R, t, o, scale = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for s in range(kinds.shape[0]):
        row = frames[s]
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


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _unit(x, y, z):
    inverse = _ONE / np.sqrt(x * x + y * y + z * z + _TINY)
    return x * inverse, y * inverse, z * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _curved_at(c, frame, bounds, x, y):
    """Inverse depth and normal of an ellipsoid or a cone."""
    u, v = x - c[ORIGIN], y - c[ORIGIN + 1]
    q = (c[QUADRATIC] + u * (c[QUADRATIC + 1] + c[QUADRATIC + 3] * u + c[QUADRATIC + 4] * v)
         + v * (c[QUADRATIC + 2] + c[QUADRATIC + 5] * v))  # fmt: skip
    root = np.sqrt(max(q, _ZERO))
    high = c[UPPER] + c[UPPER + 1] * u + c[UPPER + 2] * v
    if bounds == ABOVE:
        w = _BIG
    else:
        w = c[LINE] + c[LINE + 1] * u + c[LINE + 2] * v + (-root if bounds == BELOW else root)
        if bounds == BELOW and q <= _ZERO:
            w = _BIG
    if high < w:
        return high, frame[CAP], frame[CAP + 1], frame[CAP + 2]
    inverse = _ONE / w
    px, py, pz = x * inverse - frame[PLACE], y * inverse - frame[PLACE + 1], inverse - frame[PLACE + 2]
    a, b = frame[GRADIENT : GRADIENT + 9], frame[GRADIENT_OFFSET : GRADIENT_OFFSET + 3]
    nx, ny, nz = _unit(
        a[0] * px + a[1] * py + a[2] * pz + b[0],
        a[3] * px + a[4] * py + a[5] * pz + b[1],
        a[6] * px + a[7] * py + a[8] * pz + b[2],
    )
    return w, nx, ny, nz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _box_at(c, x, y):
    """Inverse depth of a box, and the axis of its face that is seen."""
    u, v = x - c[ORIGIN], y - c[ORIGIN + 1]
    w, axis = _BIG, 0
    for j in range(3):
        bound = c[UPPER + 3 * j] + c[UPPER + 3 * j + 1] * u + c[UPPER + 3 * j + 2] * v
        if bound < w:
            w, axis = bound, j
    return w, axis


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _box_color(surfaces, shape, pixel, c, frame, axis, x, y, w):
    positive = frame[SIDES + axis] > _ZERO
    face = 2 * axis + (0 if positive else 1)
    picture = surfaces.face_pictures[shape, face]
    if picture == NO_PICTURE:
        color = surfaces.colors[shape, face]
        return color[0], color[1], color[2]
    # Axes of the face that run right and up to a viewer outside, z (of the faces +z and -z: y) upright
    up = 2 if axis < 2 else 1
    right = 1 if axis == 0 else 0
    mirrored = positive == (axis == 1)
    R, inverse = frame[ROTATION : ROTATION + 9], _ONE / w
    px, py, pz = x * inverse, y * inverse, inverse
    tx, ty, tz = px - frame[PLACE], py - frame[PLACE + 1], pz - frame[PLACE + 2]
    scale_u, scale_v = _HALF / frame[HALF_SIZE + right], -_HALF / frame[HALF_SIZE + up]
    if mirrored:
        scale_u = -scale_u
    ax, ay, az = scale_u * R[right], scale_u * R[3 + right], scale_u * R[6 + right]
    bx, by, bz = scale_v * R[up], scale_v * R[3 + up], scale_v * R[6 + up]
    # The point moves by ((1, 0, 0) - p dw/dx) / w per unit of x, likewise y
    wx, wy = c[UPPER + 3 * axis + 1], c[UPPER + 3 * axis + 2]
    along_a, along_b = ax * px + ay * py + az * pz, bx * px + by * py + bz * pz
    dx, dy = pixel[0] * inverse, pixel[1] * inverse
    return sample(
        surfaces, picture, _HALF + ax * tx + ay * ty + az * tz, _HALF + bx * tx + by * ty + bz * tz,
        (ax - along_a * wx) * dx, (bx - along_b * wx) * dx, (ay - along_a * wy) * dy, (by - along_b * wy) * dy,
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _triangle_at(posed, surfaces, shape, number, x, y):
    """Inverse depth, normal and color of a triangle of a mesh."""
    c, R = posed.triangles[number], posed.frames[shape]
    u, v = x - c[mesh.ORIGIN], y - c[mesh.ORIGIN + 1]
    w = c[mesh.INVERSE_DEPTH] + c[mesh.INVERSE_DEPTH + 1] * u + c[mesh.INVERSE_DEPTH + 2] * v
    inverse = _ONE / w
    a = (c[2] + c[3] * u + c[4] * v) * inverse
    b = (c[5] + c[6] * u + c[7] * v) * inverse
    d = (c[8] + c[9] * u + c[10] * v) * inverse
    n = surfaces.corner_normals[number]
    nx, ny, nz = (a * n[0, 0] + b * n[1, 0] + d * n[2, 0], a * n[0, 1] + b * n[1, 1] + d * n[2, 1],
                  a * n[0, 2] + b * n[1, 2] + d * n[2, 2])  # fmt: skip
    side = c[mesh.SIDE]
    nx, ny, nz = _unit(
        side * (R[0] * nx + R[1] * ny + R[2] * nz),
        side * (R[3] * nx + R[4] * ny + R[5] * nz),
        side * (R[6] * nx + R[7] * ny + R[8] * nz),
    )
    picture = surfaces.face_pictures[shape, 0]
    if picture == NO_PICTURE:
        k = surfaces.corner_colors[number]
        return (w, nx, ny, nz, a * k[0, 0] + b * k[1, 0] + d * k[2, 0], a * k[0, 1] + b * k[1, 1] + d * k[2, 1],
                a * k[0, 2] + b * k[1, 2] + d * k[2, 2])  # fmt: skip
    t = surfaces.corner_uv[number]
    wx, wy = c[mesh.INVERSE_DEPTH + 1], c[mesh.INVERSE_DEPTH + 2]
    tu, tv = a * t[0, 0] + b * t[1, 0] + d * t[2, 0], a * t[0, 1] + b * t[1, 1] + d * t[2, 1]
    dx, dy = posed.pixel[0] * inverse, posed.pixel[1] * inverse
    red, green, blue = sample(
        surfaces, picture, tu, tv,
        (c[3] * t[0, 0] + c[6] * t[1, 0] + c[9] * t[2, 0] - tu * wx) * dx,
        (c[3] * t[0, 1] + c[6] * t[1, 1] + c[9] * t[2, 1] - tv * wx) * dx,
        (c[4] * t[0, 0] + c[7] * t[1, 0] + c[10] * t[2, 0] - tu * wy) * dy,
        (c[4] * t[0, 1] + c[7] * t[1, 1] + c[10] * t[2, 1] - tv * wy) * dy,
    )  # fmt: skip
    return w, nx, ny, nz, red, green, blue


@nb.njit(cache=True, nogil=True, error_model="numpy")
def surface_at(posed, surfaces, shape, number, x, y):
    """What the ray (x, y, 1) meets of ``shape``, which is known to be in front: point, unit normal, color.

    Parameters
    ----------
    posed : `PosedSurfaces`.
    surfaces : `surface_arrays.SurfaceArrays`.
    shape : index of the shape.
    number : of the triangle, when the shape is a mesh.
    x, y : undistorted normalised coordinates of the pixel, float32.

    Returns
    -------
    (x, y, z, nx, ny, nz, r, g, b) float32: camera frame, metres; RGB of 0..255.
    """
    kind = posed.kinds[shape]
    if kind == OTHER:
        w, nx, ny, nz, r, g, b = _triangle_at(posed, surfaces, shape, number, x, y)
    elif kind == BOX:
        c, frame = posed.coefficients[shape], posed.frames[shape]
        w, axis = _box_at(c, x, y)
        side = frame[SIDES + axis]
        nx, ny, nz = side * frame[axis], side * frame[3 + axis], side * frame[6 + axis]
        r, g, b = _box_color(surfaces, shape, posed.pixel, c, frame, axis, x, y, w)
    else:
        w, nx, ny, nz = _curved_at(posed.coefficients[shape], posed.frames[shape], posed.bounds[shape], x, y)
        color = surfaces.colors[shape, 0]
        r, g, b = color[0], color[1], color[2]
    z = _ONE / w
    return x * z, y * z, z, nx, ny, nz, r, g, b


@nb.njit(cache=True, nogil=True, error_model="numpy")
def number_at(numbers, row, column):
    """Number of the triangle in front; ``numbers`` (0, 0) of a body without meshes has none."""
    return numbers[row, column] if numbers.shape[0] else np.int32(0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def shade(buffer, numbers, column, xs, ys, u0, v0, posed, surfaces, lights, gain, power, rgb, depth):
    """Colors ``rgb`` (h, w, 3) and ``depth`` (h, w) of ``buffer`` from column ``column`` on, whose first pixel is (u0, v0)."""
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            packed = buffer[i, column + j]
            if packed > 0:
                x, y = xs[v0 + i, u0 + j], ys[v0 + i, u0 + j]
                number = number_at(numbers, i, column + j)
                shape = (packed & LABEL_BITS) - 1
                px, py, pz, nx, ny, nz, r, g, b = surface_at(posed, surfaces, shape, number, x, y)
                lr, lg, lb = irradiance(lights, px, py, pz, nx, ny, nz)
                depth[i, j] = pz
                rgb[i, j, 0] = displayed(r, lr, gain[0], power)
                rgb[i, j, 1] = displayed(g, lg, gain[1], power)
                rgb[i, j, 2] = displayed(b, lb, gain[2], power)
