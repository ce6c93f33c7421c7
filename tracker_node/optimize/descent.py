"""Levenberg-Marquardt for least-squares problems of any unknowns, such as those of calibration: one loop for all of them.

A problem brings its cost and a linearization that gives the step of any damping. Where some unknowns are shared, such as cameras,
and many others do not know each other, such as points or poses, that is the step of `ArrowEquations`. The state's own
minimization, with limits, is `levenberg_marquardt`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

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
        if gain <= tolerance * lowest:
            return Descent(found, lowest, iteration, True)
    return Descent(found, lowest, max_iterations, False)


class ArrowEquations:
    """Normal equations of unknowns that are shared, and of blocks of unknowns that do not know each other.

    The blocks are eliminated (Schur complement), so a step costs one small system whatever their number (Triggs et al., "Bundle
    adjustment: a modern synthesis", 2000, section 6).

    Parameters
    ----------
    d, n, k : shared unknowns, blocks, and unknowns of each.

    Attributes
    ----------
    shared, blocks, mixed : (d, d), (n, k, k) and (n, d, k), zeros to begin with.
    gradient_shared, gradient_blocks : (d,) and (n, k).
    free, held : (d,) which shared unknowns are sought, at first all; (n, k) which of the blocks are not, at first none.
    """

    def __init__(self, d: int, n: int, k: int):
        self.shared, self.blocks, self.mixed = np.zeros((d, d)), np.zeros((n, k, k)), np.zeros((n, d, k))
        self.gradient_shared, self.gradient_blocks = np.zeros(d), np.zeros((n, k))
        self.free, self.held = np.ones(d, dtype=bool), np.zeros((n, k), dtype=bool)

    def move(self, damping: float) -> tuple[np.ndarray, np.ndarray]:
        """One damped Gauss-Newton step: moves of the shared unknowns (d,) and of the blocks (n, k); zeros for what is held."""
        inverses = self.inverses(damping)
        shared = np.zeros(len(self.free))
        if self.free.any():
            right = np.einsum("nik,nk->i", self.mixed[:, self.free] @ inverses, self.gradient_blocks)
            shared[self.free] = np.linalg.solve(self.reduced(inverses, damping), right - self.gradient_shared[self.free])
        back = self.gradient_blocks + np.einsum("ndk,d->nk", self.mixed, shared)
        return shared, -np.einsum("nij,nj->ni", inverses, back)

    def inverses(self, damping: float) -> np.ndarray:
        """(n, k, k) of the blocks; zeros where something is held."""
        held = self.held[:, :, None] | self.held[:, None, :]
        found = np.linalg.inv(np.where(held, np.eye(held.shape[-1]), _damped(self.blocks, damping)))
        return np.where(held, 0.0, found)

    def reduced(self, inverses: np.ndarray, damping: float) -> np.ndarray:
        """Matrix of the free shared unknowns alone.

        Parameters
        ----------
        inverses, damping : of the blocks (`inverses`), for the same damping.

        Returns
        -------
        As many rows and columns as are free.
        """
        mixed = self.mixed[:, self.free]
        matrix = _damped(self.shared[np.ix_(self.free, self.free)], damping)
        matrix -= np.einsum("nik,njk->ij", mixed @ inverses, mixed)
        return 0.5 * (matrix + matrix.T)

    def expanded(self, of_free: np.ndarray) -> np.ndarray:
        """A matrix of the free shared unknowns as one (d, d) of all; zeros for what is held."""
        full = np.zeros_like(self.shared)
        full[np.ix_(self.free, self.free)] = of_free
        return full


def _damped(matrices: np.ndarray, damping: float) -> np.ndarray:
    """Matrices (..., k, k) with their diagonals made larger by a fraction."""
    diagonals = np.einsum("...ii->...i", matrices)
    return matrices + (damping * diagonals + 1e-12)[..., None] * np.eye(matrices.shape[-1])
