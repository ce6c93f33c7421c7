"""Levenberg-Marquardt on the state manifold, with box limits on the joint angles.

Each step goes to the minimum of the damped quadratic model *within* the limits, found exactly (`box_quadratic`): a joint that
meets its stop changes what the joints correlated with it do best, and one that is at its stop leaves it as soon as that helps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..objective.normal_equations import LeastSquaresObjective, NormalEquations
from .box_quadratic import minimize_quadratic


@dataclass(frozen=True)
class LevenbergMarquardtOptions:
    """``damping`` is relative to the diagonal of H; iteration stops when the cost falls by less than ``tolerance`` (relative) or
    the step by less than ``step_tolerance`` (meters and radians alike)."""

    max_iterations: int = 5
    damping: float = 1e-3
    damping_up: float = 8.0
    damping_down: float = 0.2
    tolerance: float = 1e-3
    step_tolerance: float = 2e-4


@dataclass(frozen=True, eq=False)
class OptimizerResult:
    """``converged`` is a fact of the run, not an error; ``equations`` are those of ``state``."""

    state: State
    equations: NormalEquations
    iterations: int
    evaluations: int
    converged: bool


def clip_to_limits(state: State, chain: KinematicChain) -> State:
    """A state with every joint within its limits.

    Parameters
    ----------
    state, chain : the state, and the limits.

    Returns
    -------
    The nearest such state.
    """
    return State(state.T_world_root, np.clip(state.joint_positions, chain.lower, chain.upper))


def _step(
    equations: NormalEquations, state: State, chain: KinematicChain, damping: float | np.ndarray
) -> np.ndarray | None:
    """The step (n_dof,) from ``state`` to the minimum of the damped quadratic within the limits; None where it has none."""
    anywhere = np.full(N_ROOT_DOF, np.inf)
    lower = np.append(-anywhere, chain.lower - state.joint_positions)
    upper = np.append(anywhere, chain.upper - state.joint_positions)
    H, step = equations.H.copy(), np.empty(equations.g.size)
    diagonal = np.diag(equations.H)
    np.einsum("ii->i", H)[:] += damping * diagonal + 1e-9 * max(float(diagonal.max(initial=0.0)), 1e-12)
    return step if minimize_quadratic(H, equations.g, lower, upper, step) >= 0 else None


def stepped(equations: NormalEquations, state: State, chain: KinematicChain, damping: float | np.ndarray) -> State:
    """A state after one step within the joints' limits, by its equations alone.

    Parameters
    ----------
    equations, state : equations at ``state``.
    chain : limits of the joints.
    damping : relative to the diagonal of H; a number, or (n_dof,).

    Returns
    -------
    The state after the step; ``state`` where the equations have no minimum.
    """
    step = _step(equations, state, chain, damping)
    if step is None:
        return state
    return clip_to_limits(state.retract(step), chain)


def minimize(
    objective: LeastSquaresObjective, start: State, chain: KinematicChain, options: LevenbergMarquardtOptions
) -> OptimizerResult:
    """Walk downhill; deterministic.

    Parameters
    ----------
    objective : least squares.
    start, chain : state to begin at, and the limits of its joints.
    options : damping, and when to stop.

    Returns
    -------
    The best state, with the objective's equations there.
    """
    state = clip_to_limits(start, chain)
    equations = objective.linearize(state)
    evaluations, damping, converged, iterations, accepted = 1, options.damping, False, 0, True
    while iterations < options.max_iterations and not converged:
        iterations += 1
        step = _step(equations, state, chain, damping)
        if step is None:
            accepted, damping = False, damping * options.damping_up
            continue
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
