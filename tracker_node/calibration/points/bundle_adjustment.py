"""Bundle adjustment: camera poses and points in space that best explain pixels seen by several cameras.

Levenberg-Marquardt on SE(3) and R^3 with analytic derivatives. A robust loss and a prior that holds each camera near its given
place make it fit for two-dimensional joints found by a network, which are neither exact nor free of confusions; the prior also
fixes the scale, which images alone do not tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...camera.rig import CameraRig
from ...geometry import se3, so3
from ...optimize.descent import ArrowEquations, descend
from .triangulation import reproject, triangulate


@dataclass(frozen=True)
class PointObservations:
    """Pixels of points, all cameras.

    Parameters
    ----------
    pixels : (n_points, n_cameras, 2).
    weights : (n_points, n_cameras), >= 0: the detector's confidence; 0 where the camera has not seen the point.
    """

    pixels: np.ndarray
    weights: np.ndarray

    def __post_init__(self):
        if self.pixels.shape != (*self.weights.shape, 2):
            raise ValueError(f"expected pixels of shape {(*self.weights.shape, 2)}, got {self.pixels.shape}")


_SIGMAS = 0.5, 0.2  # of the prior on each camera's place (meters) and orientation (radians)


@dataclass(frozen=True)
class AdjustmentOptions:
    """How to adjust.

    Parameters
    ----------
    robust_scale_px : residual at which an observation's pull stops growing (Cauchy loss), px.
    free_cameras : False to fit the points only.
    max_iterations, tolerance : stop after so many steps, or when a step lowers the cost by less than this fraction.
    """

    robust_scale_px: float = 8.0
    free_cameras: bool = True
    max_iterations: int = 200
    tolerance: float = 1e-7


@dataclass(frozen=True)
class Adjustment:
    """Result of `adjust`.

    Parameters
    ----------
    Ts_world_cam : (n_cameras, 4, 4), the first as given.
    points : (n_points, 3), meters; zeros where not valid.
    valid : (n_points,).
    residuals_px : (n_points, n_cameras, 2), projected minus seen; zeros where the weight is 0.
    cost, iterations, converged : of the last step.
    """

    Ts_world_cam: np.ndarray
    points: np.ndarray
    valid: np.ndarray
    residuals_px: np.ndarray
    cost: float
    iterations: int
    converged: bool


def adjust(rig: CameraRig, observations: PointObservations, options: AdjustmentOptions | None = None) -> Adjustment:
    """Estimate points, and the poses of all cameras but the first.

    Parameters
    ----------
    rig : cameras with their given poses.
    observations : pixels and weights, cameras in the order of the rig.
    options : robust scale, priors, what is free.

    Returns
    -------
    Poses, points and residuals at the minimum.

    Raises
    ------
    ValueError : when the observations are not for as many cameras as the rig has, or no point is seen by two of them.
    """
    options = options or AdjustmentOptions()
    if observations.weights.shape[1] != len(rig):
        raise ValueError(f"expected observations of {len(rig)} cameras, got {observations.weights.shape[1]}")
    problem = _Problem(rig, observations, options)
    if not problem.valid.any():
        raise ValueError("expected points that at least two cameras see, got none")
    return problem.solve()


class _Problem:
    def __init__(self, rig: CameraRig, observations: PointObservations, options: AdjustmentOptions):
        self.models = [camera.model for camera in rig]
        self.options = options
        given = np.array([camera.T_world_cam for camera in rig])
        self.given_Ts_cam_world = se3.inverse(given)
        points, valid = triangulate(self.models, given, observations.pixels, observations.weights)
        # A point that starts behind a camera, or where its lens model folds, says nothing to that camera.
        weights = np.where(reproject(self.models, given, points)[1], observations.weights, 0.0)
        self.valid = valid & (np.count_nonzero(weights, axis=1) >= 2)
        self.start_points = points[self.valid]
        self.pixels = observations.pixels[self.valid]
        self.weights = weights[self.valid]

    def solve(self) -> Adjustment:
        options = self.options
        start = self.given_Ts_cam_world, self.start_points
        end = descend(start, lambda x: self.cost(*x), self._steps, options.max_iterations, options.tolerance)
        transforms, points = end.found
        n_points, n_cameras = len(self.valid), len(self.models)
        all_points, residuals = np.zeros((n_points, 3)), np.zeros((n_points, n_cameras, 2))
        all_points[self.valid] = points
        found, _, seen = self._residuals(transforms, points)
        residuals[self.valid] = np.where(seen[..., None], found, 0.0)
        return Adjustment(
            se3.inverse(transforms), all_points, self.valid, residuals, end.cost, end.iterations, end.converged
        )

    def _steps(self, start: tuple[np.ndarray, np.ndarray]) -> Callable[[float], tuple[np.ndarray, np.ndarray]]:
        """From a damping to the transforms and points after a step from ``start``."""
        equations = self.linearize(*start)

        def moved(damping: float) -> tuple[np.ndarray, np.ndarray]:
            twists, moves = equations.move(damping)
            return np.array([se3.exp(t) @ T for t, T in zip(twists.reshape(-1, 6), start[0], strict=True)]), start[1] + moves

        return moved

    def _residuals(self, transforms, points):
        """Residuals (n, c, 2), their derivatives by the point in the camera (n, c, 2, 3), seen (n, c)."""
        shape = self.weights.shape
        residuals, derivatives = np.zeros((*shape, 2)), np.zeros((*shape, 2, 3))
        seen = np.zeros(shape, dtype=bool)
        for i, model in enumerate(self.models):
            pixels, derivatives[:, i], ok = model.project_with_jacobian(se3.apply(transforms[i], points))
            residuals[:, i] = pixels - self.pixels[:, i]
            seen[:, i] = ok & (self.weights[:, i] > 0.0)
        return residuals, derivatives, seen

    def prior_twists(self, transforms) -> np.ndarray:
        """(c, 6): each camera's twist from its given pose, in its own frame; the linear part is its center's move."""
        given = self.given_Ts_cam_world
        return np.array([se3.log(T @ se3.inverse(G)) for T, G in zip(transforms, given, strict=True)])

    def prior_precision(self) -> np.ndarray:
        """(6,): one over the variance of each part of a prior twist."""
        return np.repeat(_SIGMAS, 3) ** -2.0

    def cost(self, transforms, points) -> float:
        """Sum of Cauchy losses in units of the robust scale, plus the prior. Points behind a camera forbid the step."""
        residuals, _, seen = self._residuals(transforms, points)
        if np.any((self.weights > 0.0) & ~seen):
            return np.inf
        squares = np.sum(residuals**2, axis=-1) / self.options.robust_scale_px**2
        data = np.sum(self.weights * np.log1p(squares))
        return float(data + np.sum(self.prior_precision() * self.prior_twists(transforms) ** 2))

    def linearize(self, transforms, points) -> ArrowEquations:
        """Cameras share the points, which are the blocks; the first camera is held."""
        residuals, derivatives, seen = self._residuals(transforms, points)
        scale_sq = self.options.robust_scale_px**2
        weights = np.where(seen, self.weights, 0.0) / (scale_sq + np.sum(residuals**2, axis=-1))
        n, c = weights.shape
        by_camera, by_point = np.zeros((n, c, 2, 6)), np.zeros((n, c, 2, 3))
        for i in range(c):
            local = se3.apply(transforms[i], points)
            by_camera[:, i, :, :3] = derivatives[:, i]
            by_camera[:, i, :, 3:] = -derivatives[:, i] @ so3.hat(local)
            by_point[:, i] = derivatives[:, i] @ transforms[i, :3, :3]
        weighted_camera, weighted_point = weights[..., None, None] * by_camera, weights[..., None, None] * by_point
        twists = self.prior_twists(transforms)
        twist_D_step = np.array([_log_derivative(twist) for twist in twists])
        weighted_prior = self.prior_precision()[:, None] * twist_D_step
        equations = ArrowEquations(6 * c, n, 3)
        by_cameras = np.einsum("ncri,ncrj->cij", weighted_camera, by_camera)
        by_cameras += np.einsum("cki,ckj->cij", weighted_prior, twist_D_step)
        for i, block in enumerate(by_cameras):
            equations.shared[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = block
        equations.blocks = np.einsum("ncri,ncrj->nij", weighted_point, by_point)
        equations.mixed = np.einsum("ncri,ncrj->ncij", weighted_camera, by_point).reshape(n, 6 * c, 3)
        by_prior = np.einsum("cki,ck->ci", weighted_prior, twists)
        equations.gradient_shared = (np.einsum("ncri,ncr->ci", weighted_camera, residuals) + by_prior).ravel()
        equations.gradient_blocks = np.einsum("ncri,ncr->ni", weighted_point, residuals)
        equations.free[:] = self.options.free_cameras
        equations.free[:6] = False
        return equations


def _log_derivative(twist: np.ndarray) -> np.ndarray:
    """(6, 6) J with log(exp(d) exp(twist)) = twist + J d + O(d^2), to the second order in the twist (it is small)."""
    linear, angular = so3.hat(twist[:3]), so3.hat(twist[3:])
    ad = np.block([[angular, linear], [np.zeros((3, 3)), angular]])
    return np.eye(6) - 0.5 * ad + ad @ ad / 12.0
