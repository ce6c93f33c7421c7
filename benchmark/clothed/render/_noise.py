"""Value noise in three dimensions, the same for every call: wrinkles, cloth, plaster."""

from __future__ import annotations

import numba as nb
import numpy as np

_SIZE = 32
TABLE = np.random.default_rng(2024).uniform(-1.0, 1.0, (_SIZE, _SIZE, _SIZE)).astype(np.float32)


@nb.njit(cache=True)
def noise_at(table, x, y, z):
    """Smooth noise at a point.

    Parameters
    ----------
    table : `TABLE`.
    x, y, z : in units of half a wavelength; the noise repeats after 32.

    Returns
    -------
    Between -1 and 1.
    """
    i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
    fx, fy, fz = x - i, y - j, z - k
    fx, fy, fz = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy), fz * fz * (3.0 - 2.0 * fz)
    total = 0.0
    for a in range(2):
        wx = fx if a else 1.0 - fx
        for b in range(2):
            wy = fy if b else 1.0 - fy
            for c in range(2):
                wz = fz if c else 1.0 - fz
                total += wx * wy * wz * table[(i + a) & 31, (j + b) & 31, (k + c) & 31]
    return total


@nb.njit(cache=True)
def noise(table, points):
    """Noise at points.

    Parameters
    ----------
    table : `TABLE`.
    points : (n, 3), in units of half a wavelength.

    Returns
    -------
    (n,) between -1 and 1.
    """
    result = np.empty(len(points))
    for i in range(len(points)):
        result[i] = noise_at(table, points[i, 0], points[i, 1], points[i, 2])
    return result


def noise_image(shape: tuple[int, int], wavelength: float, rng: np.random.Generator) -> np.ndarray:
    """Fractal noise as an image.

    Parameters
    ----------
    shape : rows, columns.
    wavelength : of the broadest of three octaves, pixels.
    rng : decides where the noise begins.

    Returns
    -------
    (rows, columns) float64, about -1 to 1.
    """
    v, u = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float64)
    start = rng.uniform(0.0, 32.0, 3)
    total = np.zeros(shape)
    for octave in range(3):
        scale = 2.0 ** (octave + 1) / wavelength
        points = np.stack([u * scale + start[0], v * scale + start[1], np.full(shape, start[2] + 7.3 * octave)], axis=-1)
        total += noise(TABLE, points.reshape(-1, 3)).reshape(shape) / 2.0**octave
    return total / 1.5
