"""Levenberg-Marquardt over contour lines of many image sets: a pose each, and a shape and cameras that all of them share.

Lines are fixed while the solver works; drawing them anew at the result, and solving again, is the caller's loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...geometry import se3
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shape_parameters import ShapeSpace
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import LeastSquaresObjective
from ...objective.shape_jacobian import FOCAL, N_CAMERA, TIME, ContourLines, line_residuals, linearize_lines, normal_equations
from ...optimize.descent import ArrowEquations, Descent, descend
from ...optimize.levenberg_marquardt import clip_to_limits


@dataclass(frozen=True, eq=False)
class Estimate:
    """All that is sought.

    Attributes
    ----------
    states : of every image set. s : (n_shape,) shape parameters.
    cameras : (n_cameras, `N_CAMERA`) departure from the given rig: twist of T_cam_world in the camera's frame, logarithm of the
        focal length's scale, seconds that the camera's images are later than their stamps say.
    """

    states: tuple[State, ...]
    s: np.ndarray
    cameras: np.ndarray


@dataclass(frozen=True, eq=False)
class SharedPrior:
    """Standard deviations of what all sets share, about zero; 0 holds an entry there: ``shape`` (n_shape,) and ``cameras``
    (n_cameras, `N_CAMERA`)."""

    shape: np.ndarray
    cameras: np.ndarray


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """How the body moves while an image set is taken: ``velocity`` (n_dof,) tangent a second; ``delays_s`` (n_cameras,), by how
    much each camera exposed after the set's stamp, as its own stamp says."""

    velocity: np.ndarray
    delays_s: np.ndarray


@dataclass(frozen=True, eq=False)
class Problem:
    """What is given.

    Attributes
    ----------
    space, rig : the body and the cameras to start from.
    motions : of every image set.
    pose_priors : of every image set. shared : of what all of them share.
    correlation : how many neighboring lines share one error.
    constraints : what no pose may do (of the given body).
    """

    space: ShapeSpace
    rig: CameraRig
    motions: Sequence[BodyMotion]
    pose_priors: Sequence[Sequence[Prior]]
    shared: SharedPrior
    correlation: float = 1.0
    constraints: Sequence[LeastSquaresObjective] = ()

    def rig_of(self, estimate: Estimate) -> CameraRig:
        """The rig with the cameras' departures."""
        cameras = tuple(moved_camera(c, departure) for c, departure in zip(self.rig, estimate.cameras, strict=True))
        return replace(self.rig, cameras=cameras)

    def states_of(self, estimate: Estimate, k: int) -> list[State]:
        """States of the body when each camera exposes.

        Parameters
        ----------
        estimate : states and delays.
        k : number of the image set.

        Returns
        -------
        One a camera.
        """
        state, motion = estimate.states[k], self.motions[k]
        delays_s = motion.delays_s + estimate.cameras[:, TIME]
        return [state.retract(delay_s * motion.velocity) if delay_s else state for delay_s in delays_s]

    def weights(self, residuals: np.ndarray, variances: np.ndarray, robust_px: float) -> tuple[np.ndarray, np.ndarray]:
        """As `line_weights`, with the correlation of the problem.

        Parameters
        ----------
        residuals, variances, robust_px : see there.

        Returns
        -------
        Costs (n,).
        Weights (n,) of the squared residuals.
        """
        return line_weights(residuals, variances, robust_px, self.correlation)


def line_weights(
    residuals: np.ndarray, variances: np.ndarray, robust_px: float, correlation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Geman-McClure kernel, in information units. Lines of large variance have a larger scale.

    Parameters
    ----------
    residuals, variances : (n,) pixels, and squared pixels.
    robust_px : least scale of the kernel.
    correlation : how many neighboring lines share one error.

    Returns
    -------
    Costs (n,).
    Weights (n,) of the squared residuals.
    """
    squares, scale = residuals**2, np.maximum(robust_px**2, 4.0 * variances)
    ratio = scale / (scale + squares)
    information = 1.0 / (correlation * variances)
    return information * ratio * squares, information * ratio**2


Solution = Descent[Estimate]
"""Where the solver came to; its cost is minus twice a log posterior."""
_TOLERANCE = 1e-4  # of the cost


def moved_camera(camera: Camera, departure: np.ndarray) -> Camera:
    """A camera that departs from its calibration; its stamps stay.

    Parameters
    ----------
    camera : as calibrated.
    departure : (`N_CAMERA`,) see `Estimate`.

    Returns
    -------
    The moved camera.
    """
    lens = camera.model
    if departure[FOCAL]:
        K = lens.K.copy()
        K[:2, :2] *= np.exp(departure[FOCAL])
        lens = CameraModel(lens.width, lens.height, K, lens.distortion_model, lens.distortion)
    return replace(camera, model=lens, T_world_cam=se3.inverse(se3.exp(departure[:6]) @ camera.T_cam_world))


def solve(
    problem: Problem,
    lines: Sequence[ContourLines],
    start: Estimate,
    robust_px: float,
    max_iterations: int = 3,
    damping: float = 1e-3,
) -> Solution:
    """Go downhill on fixed lines; deterministic. Joints stay within their limits.

    Parameters
    ----------
    problem : what is given, and what is free.
    lines : of every image set.
    start : the unknowns.
    robust_px : scale of the robust kernel.
    max_iterations : steps at most.
    damping : of the first step, relative to the diagonal of the Gauss-Newton matrix.

    Returns
    -------
    Where it ended.
    """
    return descend(
        start, lambda estimate: _cost(problem, lines, estimate, robust_px),
        lambda estimate: _Arrow(problem, lines, estimate, robust_px).step, max_iterations, _TOLERANCE, damping,
    )  # fmt: skip


def shared_covariance(
    problem: Problem, lines: Sequence[ContourLines], estimate: Estimate, robust_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """Covariances of shape and cameras, the poses being unknown; zeros for what is held.

    Parameters
    ----------
    problem : what is given.
    lines : of every image set.
    estimate : where to linearize.
    robust_px : scale of the robust kernel.

    Returns
    -------
    (n_shape, n_shape) of the shape.
    (n_cameras * `N_CAMERA`, the same) of all cameras' departures.
    """
    covariance, n_shape = _Arrow(problem, lines, estimate, robust_px).shared_covariance(), len(estimate.s)
    return covariance[:n_shape, :n_shape], covariance[n_shape:, n_shape:]


def clustered_covariance(problem: Problem, lines: Sequence[ContourLines], estimate: Estimate, robust_px: float) -> np.ndarray:
    """Covariance of all cameras' departures by how much the image sets contradict each other.

    Where a body is not the model's, all lines along a limb are off alike, and a covariance that takes each for a measurement of
    its own is far too small. Here a whole image set is one measurement (cluster-robust sandwich: Liang and Zeger, 1986).

    Parameters
    ----------
    problem : what is given.
    lines : of every image set.
    estimate : where to linearize.
    robust_px : scale of the robust kernel.

    Returns
    -------
    (n_cameras * `N_CAMERA`, the same).
    """
    n_shape = len(estimate.s)
    return _Arrow(problem, lines, estimate, robust_px).clustered_covariance()[n_shape:, n_shape:]


def _cost(problem: Problem, lines: Sequence[ContourLines], estimate: Estimate, robust_px: float) -> float:
    model, rig = problem.space.body(estimate.s), problem.rig_of(estimate)
    total = 0.0
    n_dof = model.n_dof
    for k, own in enumerate(lines):
        residuals, _ = line_residuals(own, model, rig, problem.states_of(estimate, k))
        total += float(problem.weights(residuals, own.variances, robust_px)[0].sum())
        H, g = np.zeros((n_dof, n_dof)), np.zeros(n_dof)
        total += sum(prior.add_to(H, g, estimate.states[k]) for prior in problem.pose_priors[k])
        total += sum(constraint.linearize(estimate.states[k]).cost for constraint in problem.constraints)
    shared, sigmas = _packed(estimate), _packed_prior(problem)
    free = sigmas > 0.0
    return total + float(np.sum((shared[free] / sigmas[free]) ** 2))


def _packed(estimate: Estimate) -> np.ndarray:
    return np.concatenate([estimate.s, estimate.cameras.ravel()])


def _packed_prior(problem: Problem) -> np.ndarray:
    return np.concatenate([problem.shared.shape, problem.shared.cameras.ravel()])


class _Arrow(ArrowEquations):
    """Normal equations around an estimate: image sets share shape and cameras, their poses are the blocks."""

    def __init__(self, problem: Problem, lines: Sequence[ContourLines], estimate: Estimate, robust_px: float):
        sigmas, shared = _packed_prior(problem), _packed(estimate)
        model, rig = problem.space.body(estimate.s), problem.rig_of(estimate)
        n_shape, n_dof, n = len(estimate.s), model.n_dof, len(sigmas)
        super().__init__(n, len(lines), n_dof)
        self._estimate, self._chain, self.free = estimate, model.chain, sigmas > 0.0
        self.precision = np.where(self.free, sigmas, np.inf) ** -2.0  # (d,) of the prior
        self.shared, self.gradient_shared = np.diag(self.precision), shared * self.precision
        self._by_set = np.zeros((len(lines), n))  # gradients of what is shared, by the lines of each set
        for k, own in enumerate(lines):
            states = problem.states_of(estimate, k)
            found = linearize_lines(own, problem.space, estimate.s, model, rig, states, problem.motions[k].velocity)
            weights = np.where(found.valid, problem.weights(found.residuals, own.variances, robust_px)[1], 0.0)
            by_shared = np.zeros((len(own), n))
            by_shared[:, :n_shape] = found.by_shape
            columns = n_shape + N_CAMERA * own.camera[:, None] + np.arange(N_CAMERA)
            np.put_along_axis(by_shared, columns, found.by_camera, axis=1)
            J = np.hstack([found.by_state, by_shared])
            H, g = np.zeros((J.shape[1], J.shape[1])), np.zeros(J.shape[1])
            normal_equations(J, found.residuals, weights, H, g)
            self.shared += H[n_dof:, n_dof:]
            self.gradient_shared += g[n_dof:]
            self._by_set[k] = g[n_dof:]
            self.mixed[k] = H[n_dof:, :n_dof]
            H_pose, g_pose = self.blocks[k], self.gradient_blocks[k]
            H_pose += H[:n_dof, :n_dof]
            g_pose += g[:n_dof]
            for prior in problem.pose_priors[k]:
                prior.add_to(H_pose, g_pose, estimate.states[k])
            for constraint in problem.constraints:
                equations = constraint.linearize(estimate.states[k])
                H_pose += equations.H
                g_pose += equations.g
            H_pose[np.diag_indices(n_dof)] += 1e-9 * max(float(np.diag(H_pose).max()), 1e-12)
            q, slope = estimate.states[k].joint_positions, g_pose[N_ROOT_DOF:]
            at_limit = ((q <= self._chain.lower) & (slope > 0.0)) | ((q >= self._chain.upper) & (slope < 0.0))
            self.held[k, N_ROOT_DOF:] = at_limit

    def step(self, damping: float) -> Estimate:
        shared, tangents = self.move(damping)
        pairs = zip(self._estimate.states, tangents, strict=True)
        states = [clip_to_limits(state.retract(tangent), self._chain) for state, tangent in pairs]
        n_shape = len(self._estimate.s)
        cameras = shared[n_shape:].reshape(-1, N_CAMERA)
        return Estimate(tuple(states), self._estimate.s + shared[:n_shape], _composed(self._estimate.cameras, cameras))

    def shared_covariance(self) -> np.ndarray:
        """Of everything that is shared (zeros: held)."""
        return self.expanded(np.linalg.inv(self.reduced(self.inverses(0.0), 0.0)))

    def clustered_covariance(self) -> np.ndarray:
        """As `shared_covariance`, by the scatter of the gradients of the sets, their poses eliminated."""
        inverses, k = self.inverses(0.0), len(self._by_set)
        eliminated = np.einsum("nik,nkj,nj->ni", self.mixed, inverses, self.gradient_blocks)
        scores = (self._by_set - eliminated)[:, self.free]
        scores = scores - scores.mean(axis=0)
        spread = scores.T @ scores * (k / max(k - 1, 1)) + np.diag(self.precision[self.free])
        inverse = np.linalg.inv(self.reduced(inverses, 0.0))
        return self.expanded(inverse @ spread @ inverse)


def _composed(departures: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Departures after a further step, whose twist acts after theirs."""
    result = departures + steps
    for i, (departure, step) in enumerate(zip(departures, steps, strict=True)):
        result[i, :6] = se3.log(se3.exp(step[:6]) @ se3.exp(departure[:6]))
    return result
