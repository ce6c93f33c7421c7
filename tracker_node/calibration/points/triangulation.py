"""Points in space from their pixels in several calibrated cameras."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...camera.model import CameraModel
from ...geometry import se3


def triangulate(
    models: Sequence[CameraModel], Ts_world_cam: np.ndarray, pixels: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points nearest to the rays of their pixels, in the weighted least-squares sense.

    Linear and closed form: each ray with unit direction d from center c asks for (I - d d^T)(X - c) = 0. Good as a start; the
    bundle adjustment then minimizes the distance in the image.

    Parameters
    ----------
    models : one per camera.
    Ts_world_cam : (n_cameras, 4, 4).
    pixels : (n_points, n_cameras, 2).
    weights : (n_points, n_cameras), 0 where a camera has not seen the point.

    Returns
    -------
    points : (n_points, 3) in the world, metres; zeros where invalid.
    valid : (n_points,), False where fewer than two cameras see the point or all their rays are nearly parallel.
    """
    n_points, n_cameras = weights.shape
    normal, right = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
    for index in range(n_cameras):
        rays, ok = models[index].rays(pixels[:, index])
        weight = np.where(ok, weights[:, index], 0.0)
        directions = rays @ Ts_world_cam[index, :3, :3].T
        projector = weight[:, None, None] * (np.eye(3) - directions[:, :, None] * directions[:, None, :])
        normal += projector
        right += projector @ Ts_world_cam[index, :3, 3]
    trace = np.trace(normal, axis1=1, axis2=2)
    # The smallest eigenvalue vanishes for a single ray, and when all are parallel: 1e-4 of the trace is an angle of 1.6 degrees.
    valid = np.linalg.eigvalsh(normal)[:, 0] > 1e-4 * trace
    points = np.zeros((n_points, 3))
    points[valid] = np.linalg.solve(normal[valid], right[valid][..., None])[..., 0]
    return points, valid


def reproject(models: Sequence[CameraModel], Ts_world_cam: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (n_points, n_cameras, 2) of world points (n_points, 3), and a validity mask (n_points, n_cameras)."""
    pixels = np.zeros((len(points), len(models), 2))
    valid = np.zeros((len(points), len(models)), dtype=bool)
    for index, model in enumerate(models):
        pixels[:, index], valid[:, index] = model.project(se3.apply(se3.inverse(Ts_world_cam[index]), points))
    return pixels, valid
