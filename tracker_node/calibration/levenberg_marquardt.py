"""Levenberg-Marquardt for the least-squares problems of calibration: one loop, whatever the unknowns are.

A problem brings its cost and a linearization that gives the step of any damping; how it solves its equations (which of its
unknowns it eliminates, which it holds) is its own affair. The state's own minimization, with limits, is `optimize`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

_DAMPING, _LEAST, _MOST = 1e-3, 1e-10, 1e8  # relative to the diagonals of the Gauss-Newton matrices
_DOWN, _UP = 0.1, 8.0

Unknowns = TypeVar("Unknowns")


@dataclass(frozen=True, eq=False)
class Descent(Generic[Unknowns]):
    """Where `descend` came to: the unknowns, their cost, its steps, and whether it ended at a minimum."""

    found: Unknowns
    cost: float
    iterations: int
    converged: bool


def descend(
    start: Unknowns,
    cost: Callable[[Unknowns], float],
    linearize: Callable[[Unknowns], Callable[[float], Unknowns | None]],
    max_iterations: int,
    tolerance: float,
    damping: float = _DAMPING,
    least_gain: float = 0.0,
) -> Descent[Unknowns]:
    """Go downhill; deterministic.

    Parameters
    ----------
    start : unknowns to begin with.
    cost : of unknowns; infinite where they are impossible.
    linearize : at unknowns, a function from a damping (relative to the diagonal) to the unknowns after that step, or None
        where these are impossible.
    max_iterations : linearizations at most.
    tolerance : it ends when a step lowers the cost by no more than this fraction.
    damping : of the first step.
    least_gain : it ends as well when a step lowers the cost by no more than this; for costs whose minimum may be zero.

    Returns
    -------
    The unknowns of the lowest cost that was met.
    """
    found, lowest = start, cost(start)
    for iteration in range(1, max_iterations + 1):
        step = linearize(found)
        while True:
            trial = step(damping)
            trial_cost = float("inf") if trial is None else cost(trial)
            if trial is not None and trial_cost <= lowest:
                break
            damping *= _UP
            if damping > _MOST:  # no direction goes down: this is the minimum, to rounding
                return Descent(found, lowest, iteration, True)
        gain, found, lowest, damping = lowest - trial_cost, trial, trial_cost, max(_DOWN * damping, _LEAST)
        if gain <= tolerance * lowest + least_gain:
            return Descent(found, lowest, iteration, True)
    return Descent(found, lowest, max_iterations, False)
