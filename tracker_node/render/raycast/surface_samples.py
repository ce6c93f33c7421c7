"""What a camera sees of a body at single pixels: points of its surface with normals and colors, before any light."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera
from ...geometry import se3
from ...model.configuration import Configuration
from .kernels import LABEL_BITS, pixel_loop
from .raycaster import cast
from .shading import number_at, surface_at
from .surface_arrays import surface_arrays

_N_COLUMNS = 9
_SAME_NORMAL = 0.8  # cosine of the angle between the normals of one face, within a few pixels
_SAME_COLOR = 20.0  # gray levels


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points of a body that one camera sees.

    Attributes
    ----------
    pixels : (n, 2) whole (u, v).
    points, normals : (n, 3) in the world, meters and unit length.
    colors_rgb : (n, 3) in 0..255, of the surface.
    shapes : (n,) index of the shape.
    """

    pixels: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    colors_rgb: np.ndarray
    shapes: np.ndarray


def surface_samples(configuration: Configuration, camera: Camera, rim: int = 0) -> SurfaceSamples:
    """All pixels at which a camera sees a body.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its lens and pose.
    rim : pixels nearer than this to the background, to another shape or to another face (normal, color) are left out: a sensor
        mixes the two there.

    Returns
    -------
    Points, normals and colors of the surface, with their pixels.
    """
    whole = 0, 0, camera.model.width, camera.model.height
    found, surfaces = cast(configuration, camera, whole), surface_arrays(configuration.model)
    u0, v0, u1, _ = found.region
    labels = (found.buffer[:, found.column : found.column + u1 - u0] & LABEL_BITS).astype(np.int32)
    rows, columns = np.nonzero(labels)
    values = np.zeros((len(rows), _N_COLUMNS), dtype=np.float32)
    _sample(
        found.buffer, found.numbers, found.column, found.table.xs, found.table.ys, u0, v0, found.coefficients, found.frames,
        found.triangles, surfaces.corners, surfaces.levels, surfaces.texels, rows, columns, values,
    )  # fmt: skip
    shapes = labels[rows, columns] - 1
    if rim:
        inner = _inner(labels, rows, columns, values, rim)
        rows, columns, values, shapes = rows[inner], columns[inner], values[inner], shapes[inner]
    T = camera.T_world_cam
    points, normals = se3.apply(T, values[:, :3]), values[:, 3:6].astype(np.float64) @ T[:3, :3].T
    return SurfaceSamples(np.column_stack([columns + u0, rows + v0]), points, normals, values[:, 6:].astype(np.float64), shapes)


def _inner(labels: np.ndarray, rows: np.ndarray, columns: np.ndarray, values: np.ndarray, rim: int) -> np.ndarray:
    """(n,) True for pixels whose neighbors in a distance of ``rim`` show the same face of the same shape."""
    h, w = labels.shape
    at = np.full((h + 2 * rim, w + 2 * rim), -1)
    at[rows + rim, columns + rim] = np.arange(len(rows))
    inner = np.ones(len(rows), dtype=bool)
    for down, right in itertools.product((-rim, 0, rim), repeat=2):
        other = at[rows + rim + down, columns + rim + right]
        alike = labels[rows, columns] == np.where(other >= 0, labels[rows[other], columns[other]], 0)
        alike &= (values[:, 3:6] * values[other, 3:6]).sum(axis=1) > _SAME_NORMAL
        alike &= np.abs(values[:, 6:] - values[other, 6:]).max(axis=1) < _SAME_COLOR
        inner &= alike
    return inner


@pixel_loop
def _sample(
    buffer, numbers, column, xs, ys, u0, v0, coefficients, frames, triangles, corners, levels, texels, rows, columns, values
):
    """Fill ``values`` (n, 9): point, normal and color in the camera frame at pixels (rows, columns) of the buffer's region."""
    for k in range(rows.shape[0]):
        i, j = rows[k], columns[k]
        shape, number = (buffer[i, column + j] & LABEL_BITS) - 1, number_at(numbers, i, column + j)
        px, py, pz, nx, ny, nz, r, g, b = surface_at(
            coefficients, frames, triangles, corners, levels, texels, shape, number, xs[v0 + i, u0 + j], ys[v0 + i, u0 + j]
        )
        values[k, 0], values[k, 1], values[k, 2] = px, py, pz
        values[k, 3], values[k, 4], values[k, 5] = nx, ny, nz
        values[k, 6], values[k, 7], values[k, 8] = r, g, b
