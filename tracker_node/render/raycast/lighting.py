"""The law of light of `camera.light` at one pixel, for kernels.

`irradiance` is the same arithmetic for all kinds of lights, without branches: the direction to a light is P - h p, with h = 0
where it does not depend on the point p; a floor of one under the cosine makes light ambient; and what falls outside a spot's cone
is a line in the cosine of the angle from its axis, clipped to 0..1.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from ...camera import light as packing
from ...camera.light import AMBIENT, DIRECTIONAL, SPOT
from .kernels import pixel_function

_ZERO, _ONE, _WHITE, _TINY = np.float32(0.0), np.float32(1.0), np.float32(255.0), np.float32(1e-30)

# Columns of a light in a camera: P, h, axis of the spot, line in the cosine, floor, intensity
PLACE, NEARNESS, AXIS, SLOPE, CONSTANT, FLOOR, INTENSITY = 0, 3, 4, 7, 8, 9, 10
N_COLUMNS = 13


@nb.njit(cache=True, nogil=True, error_model="numpy")
def lights_in_camera(packed, T_cam_world):
    """Lights (n, `N_COLUMNS`) float32 in the camera frame, of `camera.light.pack_lights`."""
    out = np.zeros((packed.shape[0], N_COLUMNS), dtype=np.float32)
    for i in range(packed.shape[0]):
        kind = packed[i, packing.KIND]
        at_infinity = kind in (AMBIENT, DIRECTIONAL)
        for j in range(3):
            place, axis = T_cam_world[j, 3], 0.0
            for m in range(3):
                place += T_cam_world[j, m] * packed[i, packing.POSITION + m]
                axis += T_cam_world[j, m] * packed[i, packing.DIRECTION + m]
            out[i, PLACE + j], out[i, AXIS + j] = -axis if at_infinity else place, axis
            out[i, INTENSITY + j] = packed[i, packing.INTENSITY + j]
        out[i, NEARNESS] = 0.0 if at_infinity else 1.0
        out[i, FLOOR] = 1.0 if kind == AMBIENT else 0.0
        out[i, CONSTANT] = 1.0
        if kind == SPOT:
            outer, inner = packed[i, packing.COS_OUTER], packed[i, packing.COS_INNER]
            out[i, SLOPE], out[i, CONSTANT] = 1.0 / (inner - outer), -outer / (inner - outer)
    return out


@pixel_function
def irradiance(lights, x, y, z, nx, ny, nz):
    """Light (r, g, b) on a surface at (x, y, z) with unit normal (nx, ny, nz), in the frame of ``lights``."""
    r, g, b = _ZERO, _ZERO, _ZERO
    for i in range(lights.shape[0]):
        h = lights[i, NEARNESS]
        lx, ly, lz = lights[i, PLACE] - h * x, lights[i, PLACE + 1] - h * y, lights[i, PLACE + 2] - h * z
        inverse = _ONE / np.sqrt(lx * lx + ly * ly + lz * lz + _TINY)
        factor = max((nx * lx + ny * ly + nz * lz) * inverse, lights[i, FLOOR])
        cosine = -(lx * lights[i, AXIS] + ly * lights[i, AXIS + 1] + lz * lights[i, AXIS + 2]) * inverse
        factor *= min(max(lights[i, CONSTANT] + lights[i, SLOPE] * cosine, _ZERO), _ONE)
        r, g = r + factor * lights[i, INTENSITY], g + factor * lights[i, INTENSITY + 1]
        b += factor * lights[i, INTENSITY + 2]
    return r, g, b


@pixel_function
def displayed(color, light, gain, power):
    """What a camera of ``gain`` and gamma 1 / ``power`` shows of a surface of ``color`` under ``light``, one channel."""
    factor = gain * light
    if power != _ONE:  # not as a power: that the compiler takes for cheap, and does it always
        factor = np.exp2(power * np.log2(factor + _TINY))
    return min(color * factor, _WHITE)
