"""Colors out of the pictures on boxes and meshes, for kernels."""

from __future__ import annotations

import numpy as np

from .pixel_function import pixel_function
from .surface_arrays import N_LEVELS

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@pixel_function
def _bilinear(texels, start, width, height, u, v):
    """Color (r, g, b) of a level of a picture at (u, v), 0..1 from its upper left corner; its border goes on outside."""
    x = min(max(u * np.float32(width) - _HALF, _ZERO), np.float32(width - 1))
    y = min(max(v * np.float32(height) - _HALF, _ZERO), np.float32(height - 1))
    i, j = int(x), int(y)
    fx, fy = x - np.float32(i), y - np.float32(j)
    a = start + j * width + i
    b = a + (1 if i + 1 < width else 0)
    down = width if j + 1 < height else 0
    c, d = a + down, b + down
    wa, wb, wc, wd = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy), (_ONE - fx) * fy, fx * fy
    return (
        wa * texels[a, 0] + wb * texels[b, 0] + wc * texels[c, 0] + wd * texels[d, 0],
        wa * texels[a, 1] + wb * texels[b, 1] + wc * texels[c, 1] + wd * texels[d, 1],
        wa * texels[a, 2] + wb * texels[b, 2] + wc * texels[c, 2] + wd * texels[d, 2],
    )


@pixel_function
def sample(levels, texels, picture, u, v, ux, vx, uy, vy):
    """Color (r, g, b) of a picture at (u, v), of the levels whose texels are about as large as a pixel.

    ``levels`` and ``texels`` are of `surface_arrays.SurfaceArrays`; (ux, vx) and (uy, vy) are what one pixel to the right, and
    one down, changes (u, v) by.
    """
    width, height = levels[picture, 0, 1], levels[picture, 0, 2]
    ux, uy, vx, vy = ux * np.float32(width), uy * np.float32(width), vx * np.float32(height), vy * np.float32(height)
    square = max(ux * ux + vx * vx, uy * uy + vy * vy)
    if not square > _ONE:
        return _bilinear(texels, levels[picture, 0, 0], width, height, u, v)
    level = min(_HALF * np.log2(square), np.float32(N_LEVELS - 2))
    k = int(level)
    f = level - np.float32(k)
    r0, g0, b0 = _bilinear(texels, levels[picture, k, 0], levels[picture, k, 1], levels[picture, k, 2], u, v)
    r1, g1, b1 = _bilinear(texels, levels[picture, k + 1, 0], levels[picture, k + 1, 1], levels[picture, k + 1, 2], u, v)
    return r0 + f * (r1 - r0), g0 + f * (g1 - g0), b0 + f * (b1 - b0)
