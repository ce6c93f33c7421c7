"""Bodies of any shapes scored against images: pixel by pixel from what the ray-caster says is in front.

For boxes and meshes, and for whatever the kernels of smooth shapes leave out (a camera within a cone's wedge). The same law, the
same sums; slower.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from ..render.lighting import displayed, irradiance
from ..render.ray_kernels import LABEL_BITS
from ..render.shading import COLORS, number_at, surface_at
from .color_kernels import HEIGHT, PLANES, WIDTH

_ZERO, _ONE, _FULL = np.float32(0.0), np.float32(1.0), np.float32(255.0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def recolor(frames, colors):
    """Give every shape one of ``colors`` (n, 3), whatever its faces had."""
    for s in range(colors.shape[0]):
        for face in range(6):
            for i in range(3):
                frames[s, COLORS + 3 * face + i] = colors[s, i]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def score_any(
    buffer, numbers, column, xs, ys, u0, v0, u1, coefficients, frames, triangles, corners, levels, texels,
    lights, gain, power, planes, view, weights, total,
):  # fmt: skip
    """Squared differences and number of the pixels of a `raycaster.Cast` (whose fields come first), into ``total`` (3,)."""
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
            dr, dg, db = r - tr, g - tg, b - tb
            squares += weights[0] * (dr * dr + dg * dg + db * db)
            if weights[1] > _ZERO:
                m, t = _FULL / max(r + g + b, _ONE), _FULL / max(tr + tg + tb, _ONE)
                dr, dg, db = r * m - tr * t, g * m - tg * t, b * m - tb * t
                squares += weights[1] * (dr * dr + dg * dg + db * db)
            count += 1
    total[0], total[1] = squares, count
