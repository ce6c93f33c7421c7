"""The law of light of `camera.light` at one pixel, for kernels.

`irradiance` is the same arithmetic for all kinds of lights, without branches: the direction to a light is P - h p, with h = 0
where it does not depend on the point p; a floor of one under the cosine makes light ambient; and what falls outside a spot's cone
is a line in the cosine of the angle from its axis, clipped to 0..1.
"""

from __future__ import annotations

import numpy as np

from ...camera import light as packing
from ...camera.light import AMBIENT, DIRECTIONAL, SPOT
from ...compiled.kernels import compiled
from .kernels import pixel_function

_ZERO, _ONE, _WHITE, _TINY = np.float32(0.0), np.float32(1.0), np.float32(255.0), np.float32(1e-30)

# Columns of a light in a camera: P, h, axis of the spot, line in the cosine, floor, intensity
PLACE, NEARNESS, AXIS, SLOPE, CONSTANT, FLOOR, INTENSITY = 0, 3, 4, 7, 8, 9, 10
N_COLUMNS = 13


@compiled
def lights_in_camera(packed, T_cam_world):
    """Lights in the frame of a camera, as `irradiance` takes them.

    Parameters
    ----------
    packed : (n, `N_LIGHT_COLUMNS`) of `camera.light.pack_lights`, world.
    T_cam_world : (4, 4).

    Returns
    -------
    (n, `N_COLUMNS`) float32.
    """
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
    """Light on a point of a surface.

    Parameters
    ----------
    lights : of `lights_in_camera`.
    x, y, z : the point, in the frame of ``lights``, meters.
    nx, ny, nz : its unit normal there.

    Returns
    -------
    r, g, b : float32, factors of the surface's color.
    """
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
    """What a camera shows of a surface, one channel.

    Parameters
    ----------
    color : of the surface, 0..255.
    light : of `irradiance`.
    gain : of the camera.
    power : 1 / gamma of the camera.

    Returns
    -------
    float32 in 0..255.
    """
    factor = gain * light
    if power != _ONE:  # not as a power: that the compiler takes for cheap, and does it always
        factor = np.exp2(power * np.log2(factor + _TINY))
    return min(color * factor, _WHITE)
