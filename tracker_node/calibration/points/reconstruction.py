"""One point from where several cameras were clicked on, with what it can be trusted to.

With the lenses of the rig, distortion included, the squared distances in the images are least; cameras without distortion can
also be asked by their eleven parameters, as the laboratory's reference method does (`dlt.reconstruct`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera
from ...errors import CalibrationError
from ...geometry import se3
from .dlt import dlt_parameters
from .dlt import reconstruct as reconstruct_by_parameters
from .triangulation import triangulate

METHODS = ("lens", "dlt")
_ITERATIONS = 10
_SMALLEST_STEP_M = 1e-9


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


def reconstruct_point(
    cameras: Sequence[Camera], pixels: np.ndarray, sigma_px: float = 1.0, method: str = "lens"
) -> ReconstructedPoint | None:
    """The point that ``cameras`` show at ``pixels`` (n, 2), n >= 2; None where their rays do not meet in front of all of them.

    Parameters
    ----------
    sigma_px : standard deviation of a click along u and v.
    method : "lens", or "dlt" for the eleven parameters of cameras without distortion.

    Raises
    ------
    CalibrationError : "dlt" for a camera with a distorted lens, or one without parameters.
    """
    if method not in METHODS:
        raise ValueError(f"expected a method of {METHODS}, got {method!r}")
    pixels = np.asarray(pixels, dtype=np.float64)
    if len(cameras) < 2:
        return None
    position = _by_parameters(cameras, pixels) if method == "dlt" else _by_lenses(cameras, pixels)
    if position is None:
        return None
    found = _linearized(cameras, position)
    if found is None:
        return None
    seen, jacobian = found
    return ReconstructedPoint(position, pixels - seen, sigma_px**2 * np.linalg.inv(jacobian.T @ jacobian))


def _by_parameters(cameras: Sequence[Camera], pixels: np.ndarray) -> np.ndarray | None:
    for camera in cameras:
        if np.any(camera.model.distortion != 0.0):
            raise CalibrationError(camera.name, "its lens is distorted, which DLT parameters do not know; use method 'lens'")
    parameters = np.array([dlt_parameters(camera) for camera in cameras])
    points, _ = reconstruct_by_parameters(parameters, pixels[None], np.ones((1, len(cameras))))
    return points[0]


def _by_lenses(cameras: Sequence[Camera], pixels: np.ndarray) -> np.ndarray | None:
    """Gauss-Newton from where the rays come nearest to each other."""
    poses = np.array([camera.T_world_cam for camera in cameras])
    points, valid = triangulate([camera.model for camera in cameras], poses, pixels[None], np.ones((1, len(cameras))))
    if not valid[0]:
        return None
    position = points[0]
    for _ in range(_ITERATIONS):
        found = _linearized(cameras, position)
        if found is None:
            return None
        seen, jacobian = found
        step = np.linalg.lstsq(jacobian, (pixels - seen).ravel(), rcond=None)[0]
        position = position + step
        if np.linalg.norm(step) < _SMALLEST_STEP_M:
            break
    return position


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
