"""The law of light of `camera.light` at one pixel, for kernels."""

from __future__ import annotations

import numba as nb
import numpy as np

from ..camera.light import COS_INNER, COS_OUTER, DIRECTION, DIRECTIONAL, INTENSITY, KIND, POINT, POSITION, SPOT

_ZERO, _ONE, _WHITE, _TINY = np.float32(0.0), np.float32(1.0), np.float32(255.0), np.float32(1e-30)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def lights_in_camera(packed, T_cam_world):
    """Lights (n, `camera.light.N_LIGHT_COLUMNS`) of `pack_lights` with places and directions in the camera frame, float32."""
    out = packed.astype(np.float32)
    for i in range(packed.shape[0]):
        for j in range(3):
            place, direction = T_cam_world[j, 3], 0.0
            for m in range(3):
                place += T_cam_world[j, m] * packed[i, POSITION + m]
                direction += T_cam_world[j, m] * packed[i, DIRECTION + m]
            out[i, POSITION + j], out[i, DIRECTION + j] = place, direction
    return out


@nb.njit(cache=True, nogil=True, error_model="numpy")
def irradiance(lights, x, y, z, nx, ny, nz):
    """Light (r, g, b) on a surface at (x, y, z) with unit normal (nx, ny, nz), in the frame of ``lights``."""
    r, g, b = _ZERO, _ZERO, _ZERO
    for i in range(lights.shape[0]):
        light = lights[i]
        kind, factor = light[KIND], _ONE
        dx, dy, dz = light[DIRECTION], light[DIRECTION + 1], light[DIRECTION + 2]
        if kind == DIRECTIONAL:
            factor = -(nx * dx + ny * dy + nz * dz)
        elif kind >= POINT:
            lx, ly, lz = light[POSITION] - x, light[POSITION + 1] - y, light[POSITION + 2] - z
            inverse = _ONE / np.sqrt(lx * lx + ly * ly + lz * lz + _TINY)
            factor = (nx * lx + ny * ly + nz * lz) * inverse
            if kind == SPOT:
                cosine = -(lx * dx + ly * dy + lz * dz) * inverse
                inside = (cosine - light[COS_OUTER]) / (light[COS_INNER] - light[COS_OUTER])
                factor *= min(max(inside, _ZERO), _ONE)
        factor = max(factor, _ZERO)
        r, g, b = r + factor * light[INTENSITY], g + factor * light[INTENSITY + 1], b + factor * light[INTENSITY + 2]
    return r, g, b


@nb.njit(cache=True, nogil=True, error_model="numpy")
def displayed(color, light, gain, power):
    """What a camera of ``gain`` and gamma 1 / ``power`` shows of a surface of ``color`` under ``light``, one channel."""
    factor = gain * light
    if power != _ONE:
        factor = factor**power
    return min(color * factor, _WHITE)
