"""Levenberg-Marquardt on the state manifold, with box limits on the joint angles.

Limits are held by an active set: a joint at its limit whose downhill direction points outward is taken out of the step, and
the accepted step is clipped to the box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..objective.normal_equations import LeastSquaresObjective, NormalEquations
from .result import OptimizerResult


@dataclass(frozen=True)
class LevenbergMarquardtOptions:
    """``damping`` is relative to the diagonal of H; iteration stops when the cost falls by less than ``tolerance`` (relative) or
    the step by less than ``step_tolerance`` (metres and radians alike)."""

    max_iterations: int = 5
    damping: float = 1e-3
    damping_up: float = 8.0
    damping_down: float = 0.2
    tolerance: float = 1e-3
    step_tolerance: float = 2e-4


def clip_to_limits(state: State, chain: KinematicChain) -> State:
    """The state with every joint angle within its limits."""
    return State(state.T_world_root, np.clip(state.joint_positions, chain.lower, chain.upper))


def _free(state: State, equations: NormalEquations, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Mask (n_dof,) of degrees of freedom that may move."""
    free = np.ones(equations.g.size, dtype=bool)
    downhill = -equations.g[N_ROOT_DOF:]
    q = state.joint_positions
    free[N_ROOT_DOF:] = ~(((q <= lower) & (downhill < 0)) | ((q >= upper) & (downhill > 0)))
    return free


def _step(equations: NormalEquations, free: np.ndarray, damping: float) -> np.ndarray:
    step = np.zeros(equations.g.size)
    H = equations.H[np.ix_(free, free)].copy()
    diagonal = np.diag(H)
    H[np.diag_indices_from(H)] += damping * diagonal + 1e-9 * max(float(diagonal.max(initial=0.0)), 1e-12)
    step[free] = np.linalg.solve(H, -equations.g[free])
    return step


def minimize(
    objective: LeastSquaresObjective, start: State, chain: KinematicChain, options: LevenbergMarquardtOptions
) -> OptimizerResult:
    """Walk downhill from ``start``; deterministic."""
    lower, upper = chain.lower, chain.upper
    state = clip_to_limits(start, chain)
    equations = objective.linearize(state)
    evaluations, damping, converged, iterations, accepted = 1, options.damping, False, 0, True
    while iterations < options.max_iterations and not converged:
        iterations += 1
        step = _step(equations, _free(state, equations, lower, upper), damping)
        trial = clip_to_limits(state.retract(step), chain)
        trial_equations = objective.linearize(trial)
        evaluations += 1
        accepted = trial_equations.cost < equations.cost
        if accepted:
            gain = equations.cost - trial_equations.cost
            converged = gain < options.tolerance * equations.cost or float(np.abs(step).max()) < options.step_tolerance
            state, equations = trial, trial_equations
            damping = max(damping * options.damping_down, 1e-9)
        else:
            converged = float(np.abs(step).max()) < options.step_tolerance or damping > 1e6
            damping *= options.damping_up
    if not accepted:  # whatever the objective keeps of its last evaluation is that of the result
        equations = objective.linearize(state)
        evaluations += 1
    return OptimizerResult(state, equations, iterations, evaluations, converged and bool(np.isfinite(equations.cost)))
