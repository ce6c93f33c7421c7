"""Optimizers on a score by name, all called alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from ..errors import UnknownNameError
from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .score_objective import ScoreObjective, SearchResult
from .simplex import polish, search_simplex
from .stepping import DECIMATED_LOOPS, SteppingOptions, step_downhill


class ScoreOptimizer(Protocol):
    """Minimize the score from ``start`` over the ``active`` variables (None: all)."""

    def __call__(
        self, objective: ScoreObjective, start: State, chain: KinematicChain, *, active: Sequence[int] | None = None
    ) -> SearchResult: ...


def stepping_simplex(
    objective: ScoreObjective, start: State, chain: KinematicChain, *, active: Sequence[int] | None = None
) -> SearchResult:
    """Decimated stepping, then a fine simplex: as far as the score itself goes."""
    stepped = step_downhill(objective, start, chain, SteppingOptions(DECIMATED_LOOPS), active)
    polished = polish(objective, stepped.state, chain, active=active)
    return replace(
        polished, evaluations=stepped.evaluations + polished.evaluations,
        evaluations_per_variable=stepped.evaluations_per_variable + polished.evaluations_per_variable,
    )  # fmt: skip


OPTIMIZERS: dict[str, ScoreOptimizer] = {
    "stepping": step_downhill,
    "simplex": search_simplex,
    "stepping_simplex": stepping_simplex,
}


def optimizer(name: str) -> ScoreOptimizer:
    """The optimizer of that name.

    Raises
    ------
    UnknownNameError : no such one.
    """
    if name not in OPTIMIZERS:
        raise UnknownNameError("optimizer", name, list(OPTIMIZERS))
    return OPTIMIZERS[name]
