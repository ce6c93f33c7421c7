"""What every optimizer returns."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.configuration import State
from ..objective.normal_equations import NormalEquations


@dataclass(frozen=True, eq=False)
class OptimizerResult:
    """``converged`` is a fact of the run, not an error; ``equations`` are those of the returned state."""

    state: State
    equations: NormalEquations
    iterations: int
    evaluations: int
    converged: bool
