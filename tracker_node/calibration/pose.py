"""Inverse kinematics: the state of a body whose landmarks are best at given points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import UnknownNameError
from ..geometry import se3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.kinematic_chain import N_ROOT_DOF
from .levenberg_marquardt import descend


@dataclass(frozen=True)
class PoseOptions:
    """Settings of `fit_state_to_landmarks`.

    ``sigma_m`` is the expected error of a target; ``free_sigma_rad`` and ``stiff_sigma_rad`` are how far joint angles are
    expected from neutral, for axes without and with stiffness in the model.
    """

    sigma_m: float = 0.02
    free_sigma_rad: float = 1.5
    stiff_sigma_rad: float = 0.6
    max_iterations: int = 200
    tolerance: float = 1e-9


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A fitted state and what is left over.

    ``residuals_m`` has the distance of each target from its landmark.
    """

    state: State
    cost: float
    residuals_m: dict[str, float]
    iterations: int

    @property
    def mean_residual_m(self) -> float:
        return float(np.mean(list(self.residuals_m.values())))


class _Problem:
    """Least squares: weighted distances of landmarks, and a pull of the joints to neutral."""

    def __init__(self, model: ArticulatedModel, targets: Mapping[str, np.ndarray], weights, options: PoseOptions):
        unknown = [name for name in targets if name not in model.landmark_names]
        if unknown:
            raise UnknownNameError("landmark", unknown[0], model.landmark_names)
        self.model, self.names = model, tuple(targets)
        self.rows = np.array([model.landmark_index(name) for name in self.names], dtype=np.int64)
        self.targets = np.array([targets[name] for name in self.names], dtype=np.float64).reshape(-1, 3)
        weights = weights or {}
        self.information = np.array([weights.get(name, 1.0) for name in self.names]) / options.sigma_m**2
        stiff = np.array([axis.stiffness > 1.0 for axis in model.chain.axes], dtype=bool)
        self.prior = np.where(stiff, options.stiff_sigma_rad, options.free_sigma_rad) ** -2.0
        self.neutral = np.array([axis.neutral for axis in model.chain.axes])

    def offsets(self, state: State) -> np.ndarray:
        """(n, 3) target to landmark, meters."""
        return Configuration(self.model, state).landmarks_world[self.rows] - self.targets

    def cost(self, state: State) -> float:
        offset, angles = self.offsets(state), state.joint_positions - self.neutral
        return float(self.information @ np.sum(offset**2, axis=1) + self.prior @ angles**2)

    def normal_equations(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Hessian (n_dof, n_dof) and half gradient (n_dof,)."""
        configuration = Configuration(self.model, state)
        jacobian = configuration.landmark_jacobian()[self.rows]
        offset = configuration.landmarks_world[self.rows] - self.targets
        weighted = jacobian * self.information[:, None, None]
        hessian = np.einsum("nij,nik->jk", weighted, jacobian)
        gradient = np.einsum("nij,ni->j", weighted, offset)
        index = np.arange(N_ROOT_DOF, len(gradient))
        hessian[index, index] += self.prior
        gradient[N_ROOT_DOF:] += self.prior * (state.joint_positions - self.neutral)
        return hessian, gradient

    def steps(self, state: State) -> Callable[[float], State]:
        """From a damping to the state after a step from ``state``; an axis that the gradient pushes beyond its limit is held."""
        hessian, gradient = self.normal_equations(state)
        chain, free = self.model.chain, np.ones(len(gradient), dtype=bool)
        q, slope = state.joint_positions, gradient[N_ROOT_DOF:]
        free[N_ROOT_DOF:] = ~((q <= chain.lower) & (slope > 0.0)) & ~((q >= chain.upper) & (slope < 0.0))
        sub = hessian[np.ix_(free, free)]

        def moved(damping: float) -> State:
            step = np.zeros(len(gradient))
            step[free] = -np.linalg.solve(sub + damping * np.diag(np.diag(sub) + 1e-9), gradient[free])
            return _within_limits(self.model, state.retract(step))

        return moved


def fit_state_to_landmarks(
    model: ArticulatedModel,
    targets: Mapping[str, np.ndarray],
    initial: State | None = None,
    weights: Mapping[str, float] | None = None,
    options: PoseOptions | None = None,
) -> PoseFit:
    """State whose landmarks are nearest to given points, within the joint limits.

    Levenberg-Marquardt on the manifold; an axis at its limit that the gradient pushes outward is held there (active set).
    Without ``initial`` the root is placed by the rigid fit of the trunk's landmarks, several poses of the limbs are tried, and
    the best result is taken.

    Parameters
    ----------
    model : the body.
    targets : landmark -> world position (3,), meters.
    initial : state to start from.
    weights : landmark -> multiple of its information; 1 where it is not named.
    options : standard deviations and when to stop.

    Returns
    -------
    The state, its cost and the distances left.

    Raises
    ------
    UnknownNameError : a target that the model has no landmark for.
    ValueError : fewer than three targets and no initial state.
    """
    options = options or PoseOptions()
    problem = _Problem(model, targets, weights, options)
    if initial is not None:
        return _solve(problem, _within_limits(model, initial), options)
    if len(targets) < 3:
        raise ValueError(f"expected at least 3 targets to start from, got {len(targets)}")
    starts = [_placed(problem, State(np.eye(4), angles)) for angles in _start_poses(model)]
    # A short run shows which starts are worth a long one.
    trials = sorted((_solve(problem, start, options, 15) for start in starts), key=lambda fit: fit.cost)
    return min((_solve(problem, fit.state, options) for fit in trials[:2]), key=lambda fit: fit.cost)


def _solve(problem: _Problem, state: State, options: PoseOptions, max_iterations: int | None = None) -> PoseFit:
    most = options.max_iterations if max_iterations is None else max_iterations
    end = descend(state, problem.cost, problem.steps, most, options.tolerance, least_gain=options.tolerance)
    distances = np.linalg.norm(problem.offsets(end.found), axis=1)
    residuals = {name: float(d) for name, d in zip(problem.names, distances, strict=True)}
    return PoseFit(end.found, end.cost, residuals, end.iterations)


def _within_limits(model: ArticulatedModel, state: State) -> State:
    return State(state.T_world_root, np.clip(state.joint_positions, model.chain.lower, model.chain.upper))


def _placed(problem: _Problem, state: State) -> State:
    """``state`` with the root moved so that the trunk's landmarks (or all, if those are few) fit the targets rigidly."""
    points = Configuration(problem.model, state).landmarks_world[problem.rows]
    chain = problem.model.chain
    depth = chain.link_moved_by.sum(axis=1)[problem.model.landmark_links[problem.rows]]
    trunk = depth <= max(np.sort(depth)[min(3, len(depth) - 1)], N_ROOT_DOF)
    # Shoulders hang on few axes below the trunk's; with the hips they fix the heading.
    trunk |= np.array([name.endswith(("_shoulder", "_hip")) for name in problem.names])
    if np.linalg.matrix_rank(problem.targets[trunk] - problem.targets[trunk].mean(axis=0), tol=1e-3) < 2:
        trunk[:] = True
    T_new_old = se3.rigid_fit(points[trunk], problem.targets[trunk])
    return State(T_new_old @ state.T_world_root, state.joint_positions)


# Joint angles (degrees, by the end of the axis name) of poses to start from; what a model does not have is passed over.
_START_POSES: tuple[dict[str, float], ...] = (
    {},
    {"shoulder_elevation_front": 90.0, "shoulder_elevation_back": 45.0},
    {"shoulder_elevation_front": 170.0},
    {"shoulder_elevation_front": 60.0, "elbow_flexion": 60.0, "hip_flexion": 60.0, "knee_flexion": 60.0},
)


def _start_poses(model: ArticulatedModel) -> list[np.ndarray]:
    poses: list[np.ndarray] = []
    for angles in _START_POSES:
        positions = np.array([axis.neutral for axis in model.chain.axes])
        for i, axis in enumerate(model.chain.axes):
            for ending, angle_deg in angles.items():
                if axis.name.endswith(ending):
                    positions[i] = np.clip(np.deg2rad(angle_deg), axis.lower, axis.upper)
        if not any(np.array_equal(positions, other) for other in poses):
            poses.append(positions)
    return poses
