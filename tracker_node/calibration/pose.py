"""Inverse kinematics: the state of a body whose landmarks are best at given points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import UnknownNameError
from ..geometry import se3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.kinematic_chain import N_ROOT_DOF
from ..objective.constraints.prior import Prior
from ..objective.normal_equations import NormalEquations
from ..optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize

_SIGMA_M = 0.02  # expected error of a target
_FREE_SIGMA_RAD, _STIFF_SIGMA_RAD = 1.5, 0.6  # how far angles are expected from neutral: axes without and with stiffness
_ENOUGH = LevenbergMarquardtOptions(200, tolerance=1e-9, step_tolerance=1e-8)
_SHORT = replace(_ENOUGH, max_iterations=15)


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


class _Landmarks:
    """Weighted distances of landmarks from targets, and a pull of the joints to neutral (`LeastSquaresObjective`)."""

    def __init__(self, model: ArticulatedModel, targets: Mapping[str, np.ndarray], weights):
        unknown = [name for name in targets if name not in model.landmark_names]
        if unknown:
            raise UnknownNameError("landmark", unknown[0], model.landmark_names)
        self.model, self.names = model, tuple(targets)
        self.rows = np.array([model.landmark_index(name) for name in self.names], dtype=np.int64)
        self.targets = np.array([targets[name] for name in self.names], dtype=np.float64).reshape(-1, 3)
        weights = weights or {}
        self.information = np.array([weights.get(name, 1.0) for name in self.names]) / _SIGMA_M**2
        stiff = np.array([axis.stiffness > 1.0 for axis in model.chain.axes], dtype=bool)
        pull = np.where(stiff, _STIFF_SIGMA_RAD, _FREE_SIGMA_RAD) ** -2.0
        self.prior = Prior(State.neutral(model), np.concatenate([np.zeros(N_ROOT_DOF), pull]))

    def offsets(self, configuration: Configuration) -> np.ndarray:
        """(n, 3) target to landmark, meters."""
        return configuration.landmarks_world[self.rows] - self.targets

    def linearize(self, state: State) -> NormalEquations:
        configuration = Configuration(self.model, state)
        jacobian, offset = configuration.landmark_jacobian()[self.rows], self.offsets(configuration)
        weighted = jacobian * self.information[:, None, None]
        H, g = np.einsum("nij,nik->jk", weighted, jacobian), np.einsum("nij,ni->j", weighted, offset)
        cost = float(self.information @ np.sum(offset**2, axis=1)) + self.prior.add_to(H, g, state)
        return NormalEquations(H, g, 1.0 + cost, offset.size)  # an exact fit ends by the same relative tolerance as others


def fit_state_to_landmarks(
    model: ArticulatedModel,
    targets: Mapping[str, np.ndarray],
    initial: State | None = None,
    weights: Mapping[str, float] | None = None,
) -> PoseFit:
    """State whose landmarks are nearest to given points, within the joint limits.

    Without ``initial`` the root is placed by the rigid fit of the trunk's landmarks, several poses of the limbs are tried, and
    the best result is taken.

    Parameters
    ----------
    model : the body.
    targets : landmark -> world position (3,), meters.
    initial : state to start from.
    weights : landmark -> multiple of its information; 1 where it is not named.

    Returns
    -------
    The state, its cost and the distances left.

    Raises
    ------
    UnknownNameError : a target that the model has no landmark for.
    ValueError : fewer than three targets and no initial state.
    """
    problem = _Landmarks(model, targets, weights)
    if initial is not None:
        return _solve(problem, initial)
    if len(targets) < 3:
        raise ValueError(f"expected at least 3 targets to start from, got {len(targets)}")
    starts = [_placed(problem, State(np.eye(4), angles)) for angles in _start_poses(model)]
    # A short run shows which starts are worth a long one.
    trials = sorted((_solve(problem, start, _SHORT) for start in starts), key=lambda fit: fit.cost)
    return min((_solve(problem, fit.state) for fit in trials[:2]), key=lambda fit: fit.cost)


def _solve(problem: _Landmarks, state: State, how: LevenbergMarquardtOptions = _ENOUGH) -> PoseFit:
    found = minimize(problem, state, problem.model.chain, how)
    distances = np.linalg.norm(problem.offsets(Configuration(problem.model, found.state)), axis=1)
    residuals = {name: float(d) for name, d in zip(problem.names, distances, strict=True)}
    return PoseFit(found.state, found.equations.cost - 1.0, residuals, found.iterations)


def _placed(problem: _Landmarks, state: State) -> State:
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
