"""From the eleven parameters of a DLT to a camera with seven, by stages (Trewartha, Yeadon & Knight, for video of the cross).

A restricted camera has a place, an orientation and one angle of view: square pixels, no skew, the principal point in the middle
of the image (what Open Inventor offered). The geometric parameters calculated back from the eleven are not those of the best
restricted camera: a principal point that is forced to the middle asks for another orientation. So simulated annealing looks for
it around them, and least squares polishes what it finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import dual_annealing, least_squares

from ...camera.model import CameraModel
from ...camera.rig import Camera
from ...geometry import se3
from .dlt import calibrate, decompose, dlt_parameters, image_residuals, reconstruct, solve_linear

STAGES = ("linear", "refined", "restricted", "annealed", "polished")
"""Eleven parameters by the linear solution; by least squares in the image; seven as calculated back; annealed; polished."""

_TURN_RAD, _MOVE, _ZOOM = 0.2, 0.2, 0.3  # how far annealing looks: angle; fraction of the distance; logarithm of the focal length


@dataclass(frozen=True, eq=False)
class DltStage:
    """One stage: the camera (the first two have five lens parameters, the others one) and its residuals (n, 2) in pixels."""

    name: str
    camera: Camera
    residuals_px: np.ndarray

    @property
    def rms_px(self) -> float:
        """Root mean square distance in the image."""
        return float(np.sqrt((self.residuals_px**2).sum(axis=1).mean()))


def calibrate_in_stages(
    name: str, points: np.ndarray, pixels: np.ndarray, image_size: tuple[int, int], seed: int = 0, iterations: int = 300
) -> tuple[DltStage, ...]:
    """The stages of `STAGES` for one camera.

    Parameters
    ----------
    name : of the camera.
    points : (n, 3) world, meters.
    pixels : (n, 2) where they are seen.
    image_size : (width, height).
    seed : of the annealing's random numbers.
    iterations : of the annealing.

    Returns
    -------
    One a stage.

    Raises
    ------
    CalibrationError : points that do not determine the camera, see `dlt.calibrate`.
    """
    refined = calibrate(name, points, pixels, image_size, "none")
    K, T_world_cam = decompose(solve_linear(name, points, pixels), points, name)
    linear = Camera(name, CameraModel(*image_size, K), T_world_cam)
    problem = _Restricted(refined.camera, points, pixels, image_size)
    annealed = problem.annealed(seed, iterations)
    vectors = np.zeros(7), annealed, problem.polished(annealed)
    cameras = (linear, refined.camera, *(problem.camera(x) for x in vectors))
    return tuple(
        DltStage(stage, camera, image_residuals(camera, points, pixels)) for stage, camera in zip(STAGES, cameras, strict=True)
    )


class _Restricted:
    """The seven parameters as a vector around what was calculated back: logarithm of the zoom, move (distances), turn (radians).

    Turns are about the middle of the points, so that they do not ask for a move of their own.
    """

    def __init__(self, start: Camera, points: np.ndarray, pixels: np.ndarray, image_size: tuple[int, int]):
        self.start, self.points, self.pixels, self.image_size = start, points, pixels, image_size
        K = start.model.K
        self.focal = float(np.sqrt(K[0, 0] * K[1, 1]))
        self.middle = points.mean(axis=0)
        self.distance = float(np.linalg.norm(start.center - self.middle))

    def camera(self, x: np.ndarray) -> Camera:
        (width, height), f = self.image_size, self.focal * float(np.exp(x[0]))
        K = np.array([[f, 0.0, (width - 1) / 2.0], [0.0, f, (height - 1) / 2.0], [0.0, 0.0, 1.0]])
        turn = se3.exp(np.concatenate([np.zeros(3), x[4:]]))
        to_middle = se3.from_rotation_translation(np.eye(3), self.middle)
        T = to_middle @ turn @ se3.inverse(to_middle) @ self.start.T_world_cam
        T[:3, 3] += self.distance * x[1:4]
        return Camera(self.start.name, CameraModel(width, height, K), T)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        return image_residuals(self.camera(x), self.points, self.pixels).ravel()

    def annealed(self, seed: int, iterations: int) -> np.ndarray:
        """(7,) by generalized simulated annealing, without its local searches (Xiang et al. 2013, as scipy has it)."""
        reach = np.array([_ZOOM, *[_MOVE] * 3, *[_TURN_RAD] * 3])
        found = dual_annealing(
            lambda x: float(np.minimum(np.square(self.residuals(x)), 1e8).mean()), list(zip(-reach, reach, strict=True)),
            maxiter=iterations, x0=np.zeros(7), rng=seed, no_local_search=True,
        )  # fmt: skip
        return found.x

    def polished(self, x: np.ndarray) -> np.ndarray:
        """(7,) by least squares."""
        return least_squares(self.residuals, x, method="lm", xtol=1e-14, ftol=1e-14).x


def object_errors_m(cameras: Sequence[Camera], points: np.ndarray, pixels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Distances of known points from where the cameras reconstruct them.

    Parameters
    ----------
    cameras : c of them, without distortion.
    points : (n, 3).
    pixels, weights : (n, c, 2) and (n, c), weight 0 where a camera has not seen the point.

    Returns
    -------
    (k,) meters, of the points that two cameras see.
    """
    found, valid = reconstruct(np.array([dlt_parameters(camera) for camera in cameras]), pixels, weights)
    return np.linalg.norm(found - points, axis=1)[valid]
