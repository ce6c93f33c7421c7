"""Levenberg-Marquardt on the state manifold, with box limits on the joint angles.

Each step goes to the minimum of the damped quadratic model *within* the limits, found exactly: a joint that
meets its stop changes what the joints correlated with it do best, and one that is at its stop leaves it as soon as that helps.

Block principal pivoting: guess which variables are at which limit, solve for the others, and correct the guess where the
solution passes a limit or a multiplier pulls back inside, all at once. This takes two or three solutions where limits matter
and one where they do not; in the rare case that it goes round in circles, the corrections are made one at a time, which ends
always for a positive definite matrix (Judice & Pires 1994, A block principal pivoting algorithm for large-scale strictly
monotone linear complementarity problems, Computers & Operations Research 21, 587-596).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..compiled.kernels import compiled
from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..objective.normal_equations import LeastSquaresObjective, NormalEquations

_DAMPING_UP, _DAMPING_DOWN = 8.0, 0.2


@dataclass(frozen=True)
class LevenbergMarquardtOptions:
    """``damping`` is relative to the diagonal of H; iteration stops when the cost falls by less than ``tolerance`` (relative) or
    the step by less than ``step_tolerance`` (meters and radians alike)."""

    max_iterations: int = 5
    damping: float = 1e-3
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


def _step(equations: NormalEquations, state: State, chain: KinematicChain, damping: float | np.ndarray) -> np.ndarray | None:
    """The step (n_dof,) from ``state`` to the minimum of the damped quadratic within the limits; None where it has none."""
    step, dampings = np.empty(equations.g.size), np.full(equations.g.size, damping) if np.isscalar(damping) else damping
    joints = np.ascontiguousarray(state.joint_positions)
    return step if _damped_step(equations.H, equations.g, joints, chain.lower, chain.upper, dampings, step) else None


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
            accepted, damping = False, damping * _DAMPING_UP
            continue
        trial = clip_to_limits(state.retract(step), chain)
        trial_equations = objective.linearize(trial)
        evaluations += 1
        accepted = trial_equations.cost < equations.cost
        if accepted:
            gain = equations.cost - trial_equations.cost
            converged = gain < options.tolerance * equations.cost or float(np.abs(step).max()) < options.step_tolerance
            state, equations = trial, trial_equations
            damping = max(damping * _DAMPING_DOWN, 1e-9)
        else:
            converged = float(np.abs(step).max()) < options.step_tolerance or damping > 1e6
            damping *= _DAMPING_UP
    if not accepted:  # whatever the objective keeps of its last evaluation is that of the result
        equations = objective.linearize(state)
        evaluations += 1
    return OptimizerResult(state, equations, iterations, evaluations, converged and bool(np.isfinite(equations.cost)))


_FREE, _LOWER, _UPPER = 0, 1, 2


@compiled
def _solve_free(H, g, sides, lower, upper, x, factor):
    """Fill ``x`` with the minimum over the free variables, the others at their limits. Cholesky on the free block, in place of
    ``factor``. False where the block is not positive definite."""
    n = g.size
    free = np.empty(n, dtype=np.int64)
    count = 0
    for i in range(n):
        if sides[i] == _FREE:
            free[count] = i
            count += 1
        else:
            x[i] = lower[i] if sides[i] == _LOWER else upper[i]
    for a in range(count):
        i = free[a]
        value = -g[i]
        for j in range(n):
            if sides[j] != _FREE:
                value -= H[i, j] * x[j]
        x[i] = value
        for b in range(a + 1):
            total = H[i, free[b]]
            for c in range(b):
                total -= factor[a, c] * factor[b, c]
            if a == b:
                if not total > 0.0:
                    return False
                factor[a, a] = np.sqrt(total)
            else:
                factor[a, b] = total / factor[b, b]
    for a in range(count):
        value = x[free[a]]
        for c in range(a):
            value -= factor[a, c] * x[free[c]]
        x[free[a]] = value / factor[a, a]
    for a in range(count - 1, -1, -1):
        value = x[free[a]]
        for c in range(a + 1, count):
            value -= factor[c, a] * x[free[c]]
        x[free[a]] = value / factor[a, a]
    return True


@compiled
def _damped_step(H, g, joints, lower, upper, damping, step):
    """Fill ``step`` with the minimum of the quadratic, damped relative to its diagonal, within the limits of the joints; whether
    it has one."""
    n, largest = g.size, 0.0
    damped, least, most = H.copy(), np.full(n, -np.inf), np.full(n, np.inf)
    for i in range(n):
        largest = max(largest, H[i, i])
    for i in range(n):
        damped[i, i] += damping[i] * H[i, i] + 1e-9 * max(largest, 1e-12)
    for k in range(joints.size):
        least[N_ROOT_DOF + k], most[N_ROOT_DOF + k] = lower[k] - joints[k], upper[k] - joints[k]
    return minimize_quadratic(damped, g, least, most, step, 10) >= 0


@compiled
def _wanted_side(i, H, g, sides, lower, upper, x, slack):
    """Where variable ``i`` belongs after a solution: beyond a limit it goes there, at one whose multiplier pulls inside it is
    set free."""
    if sides[i] == _FREE:
        if x[i] < lower[i] - slack * max(1.0, abs(lower[i])):
            return _LOWER
        if x[i] > upper[i] + slack * max(1.0, abs(upper[i])):
            return _UPPER
        return _FREE
    pull, scale = g[i], abs(g[i])
    for j in range(g.size):
        pull += H[i, j] * x[j]
        scale += abs(H[i, j] * x[j])
    if sides[i] == _LOWER and pull < -slack * scale:
        return _FREE
    if sides[i] == _UPPER and pull > slack * scale:
        return _FREE
    return sides[i]


@compiled
def minimize_quadratic(H, g, lower, upper, x, patience=10):
    """Minimum of 2 g.x + x.H x over lower <= x <= upper.

    Parameters
    ----------
    H, g : (n, n) symmetric, and (n,).
    lower, upper : (n,); infinite where there is no limit.
    x : (n,), overwritten with the minimum.
    patience : rounds without fewer corrections before they are made singly.

    Returns
    -------
    How many linear systems were solved; -1 where ``H`` is not positive definite.
    """
    n = g.size
    sides, factor = np.zeros(n, dtype=np.int64), np.empty((n, n))
    wanted = np.empty(n, dtype=np.int64)
    fewest, left, solutions = n + 1, patience, 0
    while True:
        if not _solve_free(H, g, sides, lower, upper, x, factor):
            return -1
        solutions += 1
        changes, last = 0, -1
        for i in range(n):
            wanted[i] = _wanted_side(i, H, g, sides, lower, upper, x, 1e-12)
            if wanted[i] != sides[i]:
                changes, last = changes + 1, i
        if changes == 0 or solutions > 50 * n:
            break
        if changes < fewest:
            fewest, left = changes, patience
        else:
            left -= 1
        if left > 0:
            sides[:] = wanted
        else:
            sides[last] = wanted[last]
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    return solutions
