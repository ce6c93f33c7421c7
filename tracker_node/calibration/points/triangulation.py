"""Points in space from their pixels in several calibrated cameras.

`triangulate` is linear and quick. `reconstruct_point` minimizes the squared distances in the images, with the lenses of the rig,
and gives a covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera
from ...geometry import se3

_ITERATIONS = 10
_SMALLEST_STEP_M = 1e-9


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
    points : (n_points, 3) in the world, meters; zeros where invalid.
    valid : (n_points,), False where fewer than two cameras see the point or all their rays are nearly parallel.
    """
    n_points, n_cameras = weights.shape
    normal, right = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
    for index in range(n_cameras):
        rays, ok = models[index].rays(pixels[:, index])
        weight = np.where(ok, weights[:, index], 0.0)
        directions = rays @ Ts_world_cam[index, :3, :3].T
        projector = across_ray(directions, weight)
        normal += projector
        right += projector @ Ts_world_cam[index, :3, 3]
    valid = rays_meet(normal)
    points = np.zeros((n_points, 3))
    points[valid] = np.linalg.solve(normal[valid], right[valid][..., None])[..., 0]
    return points, valid


def across_ray(directions: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """What is left of a vector across a ray: weight (I - d d^T).

    Parameters
    ----------
    directions : (n, 3), of length 1.
    weights : (n,).

    Returns
    -------
    (n, 3, 3).
    """
    return weights[:, None, None] * (np.eye(3) - directions[:, :, None] * directions[:, None, :])


def rays_meet(normal: np.ndarray) -> np.ndarray:
    """Whether rays tell a point: the smallest eigenvalue vanishes for a single one, and when all are parallel.

    It has to be 1e-4 of the trace, for two rays an angle of 1.6 degrees. ``normal`` is (n, 3, 3), sums of `across_ray`.
    """
    return np.linalg.eigvalsh(normal)[:, 0] > 1e-4 * np.trace(normal, axis1=1, axis2=2)


def reproject(models: Sequence[CameraModel], Ts_world_cam: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project points into all cameras.

    Parameters
    ----------
    models : one per camera.
    Ts_world_cam : (n_cameras, 4, 4).
    points : (n_points, 3) world, meters.

    Returns
    -------
    Pixels (n_points, n_cameras, 2).
    Valid (n_points, n_cameras): in front of the camera, where its lens holds.
    """
    pixels = np.zeros((len(points), len(models), 2))
    valid = np.zeros((len(points), len(models)), dtype=bool)
    for index, model in enumerate(models):
        pixels[:, index], valid[:, index] = model.project(se3.apply(se3.inverse(Ts_world_cam[index]), points))
    return pixels, valid


@dataclass(frozen=True, eq=False)
class ReconstructedPoint:
    """A point in space.

    Attributes
    ----------
    position_m : (3,) world.
    residuals_px : (n, 2) pixels clicked on minus pixels of the point, one row a camera.
    covariance_m2 : (3, 3) for clicks with independent errors of the given standard deviation.
    """

    position_m: np.ndarray
    residuals_px: np.ndarray
    covariance_m2: np.ndarray

    @property
    def sigma_m(self) -> np.ndarray:
        """(3,) standard deviations along the world's axes."""
        return np.sqrt(np.diag(self.covariance_m2))

    @property
    def rms_px(self) -> float:
        """Root mean square distance in the images."""
        return float(np.sqrt((self.residuals_px**2).sum(axis=1).mean()))


def reconstruct_point(cameras: Sequence[Camera], pixels: np.ndarray, sigma_px: float = 1.0) -> ReconstructedPoint | None:
    """The point that cameras show at given pixels.

    Parameters
    ----------
    cameras : n of them.
    pixels : (n, 2).
    sigma_px : standard deviation of a click along u and v.

    Returns
    -------
    The point; None for fewer than two cameras, or where their rays do not meet in front of all of them.
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    if len(cameras) < 2:
        return None
    poses = np.array([camera.T_world_cam for camera in cameras])
    points, valid = triangulate([camera.model for camera in cameras], poses, pixels[None], np.ones((1, len(cameras))))
    if not valid[0]:
        return None
    position = points[0]
    for _ in range(_ITERATIONS):  # of Gauss-Newton, from where the rays come nearest to each other
        found = _linearized(cameras, position)
        if found is None:
            return None
        seen, jacobian = found
        step = np.linalg.lstsq(jacobian, (pixels - seen).ravel(), rcond=None)[0]
        position = position + step
        if np.linalg.norm(step) < _SMALLEST_STEP_M:
            break
    found = _linearized(cameras, position)
    if found is None:
        return None
    seen, jacobian = found
    return ReconstructedPoint(position, pixels - seen, sigma_px**2 * np.linalg.inv(jacobian.T @ jacobian))


def _linearized(cameras: Sequence[Camera], position: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Pixels (n, 2) of a point, and their derivative (2n, 3) by it; None where it is not before all of them."""
    pixels, rows = np.zeros((len(cameras), 2)), []
    for i, camera in enumerate(cameras):
        T = camera.T_cam_world
        pixels[i], by_point, valid = camera.model.project_with_jacobian(se3.apply(T, position))
        if not valid:
            return None
        rows.append(by_point @ T[:3, :3])
    jacobian = np.concatenate(rows)
    singular = np.linalg.svd(jacobian, compute_uv=False)
    return (pixels, jacobian) if singular[-1] > 1e-9 * singular[0] else None


def repeatability(groups: Sequence[np.ndarray]) -> tuple[float, int]:
    """Standard deviation per coordinate of repeated measurements about their own means, and its degrees of freedom.

    ``groups`` are arrays (n_i, d), each the same thing measured n_i times; those of one row tell nothing. Of two measurements
    each it is their root mean square difference divided by the square root of two. Not a number without repetitions.
    """
    squares, freedom = 0.0, 0
    for group in groups:
        values = np.asarray(group, dtype=np.float64)
        squares += float(((values - values.mean(axis=0)) ** 2).sum())
        freedom += (len(values) - 1) * values.shape[1]
    return (float(np.sqrt(squares / freedom)) if freedom else float("nan")), freedom
