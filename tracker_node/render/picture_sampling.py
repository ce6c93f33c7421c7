"""Colors out of the pictures on boxes and meshes, for kernels."""

from __future__ import annotations

import numba as nb
import numpy as np

from .surface_arrays import N_LEVELS

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _bilinear(texels, start, width, height, u, v):
    """Color (r, g, b) of a level of a picture at (u, v), 0..1 from its upper left corner; its border goes on outside."""
    x = min(max(u * np.float32(width) - _HALF, _ZERO), np.float32(width - 1))
    y = min(max(v * np.float32(height) - _HALF, _ZERO), np.float32(height - 1))
    i, j = int(x), int(y)
    fx, fy = x - np.float32(i), y - np.float32(j)
    a = start + j * width + i
    right, down = (1 if i + 1 < width else 0), (width if j + 1 < height else 0)
    w00, w10, w01, w11 = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy), (_ONE - fx) * fy, fx * fy
    c00, c10, c01, c11 = texels[a], texels[a + right], texels[a + down], texels[a + right + down]
    return (
        w00 * np.float32(c00[0]) + w10 * np.float32(c10[0]) + w01 * np.float32(c01[0]) + w11 * np.float32(c11[0]),
        w00 * np.float32(c00[1]) + w10 * np.float32(c10[1]) + w01 * np.float32(c01[1]) + w11 * np.float32(c11[1]),
        w00 * np.float32(c00[2]) + w10 * np.float32(c10[2]) + w01 * np.float32(c01[2]) + w11 * np.float32(c11[2]),
    )


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sample(surfaces, picture, u, v, ux, vx, uy, vy):
    """Color (r, g, b) of a picture at (u, v), of the levels whose texels are about as large as a pixel.

    (ux, vx) and (uy, vy) are what one pixel to the right, and one down, changes (u, v) by.
    """
    levels, texels = surfaces.pictures[picture], surfaces.texels
    width, height = np.float32(levels[0, 1]), np.float32(levels[0, 2])
    ux, uy, vx, vy = ux * width, uy * width, vx * height, vy * height
    square = max(ux * ux + vx * vx, uy * uy + vy * vy)
    if not square > _ONE:
        return _bilinear(texels, levels[0, 0], levels[0, 1], levels[0, 2], u, v)
    level = min(_HALF * np.log2(square), np.float32(N_LEVELS - 2))
    below = int(level)
    f = level - np.float32(below)
    r0, g0, b0 = _bilinear(texels, levels[below, 0], levels[below, 1], levels[below, 2], u, v)
    r1, g1, b1 = _bilinear(texels, levels[below + 1, 0], levels[below + 1, 1], levels[below + 1, 2], u, v)
    return r0 + f * (r1 - r0), g0 + f * (g1 - g0), b0 + f * (b1 - b0)
