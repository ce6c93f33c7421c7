"""Finding a body again that has moved too far from where it was expected: many hypotheses, of which the best are refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from ..objective.normal_equations import LeastSquaresObjective
from .levenberg_marquardt import LevenbergMarquardtOptions, minimize
from .result import OptimizerResult
from .robust_start import RobustStartOptions, search
from .score_objective import ScoreObjective


class LevelledObjective(ScoreObjective, Protocol):
    """A score whose least squares come in levels, 0 the finest."""

    @property
    def n_levels(self) -> int: ...

    def at_level(self, level: int) -> LeastSquaresObjective: ...


@dataclass(frozen=True)
class ReacquireOptions:
    """How to look for a body.

    Attributes
    ----------
    search : hypotheses around the expected state, scored on the coarsest level.
    candidates : so many of the best are refined down to the level before the finest, and the best of those on the finest.
    """

    search: RobustStartOptions = field(default_factory=lambda: RobustStartOptions(0.35, 0.6, 1000, column_step=8))
    candidates: int = 4


ALIGNMENT = LevenbergMarquardtOptions(max_iterations=12, tolerance=1e-4)


def align_levels(
    objective: LevelledObjective,
    start: State,
    chain: KinematicChain,
    levels: Sequence[int],
    options: LevenbergMarquardtOptions = ALIGNMENT,
) -> OptimizerResult:
    """Levenberg-Marquardt on one level after the other; iterations and evaluations are those of all."""
    result: OptimizerResult | None = None
    for level in levels:
        next_ = minimize(objective.at_level(level), start if result is None else result.state, chain, options)
        if result is not None:
            next_ = replace(
                next_, iterations=result.iterations + next_.iterations, evaluations=result.evaluations + next_.evaluations
            )
        result = next_
    if result is None:
        raise ValueError("expected one level at least, got none")
    return result


def reacquire(
    objective: LevelledObjective,
    start: State,
    chain: KinematicChain,
    options: ReacquireOptions | None = None,
    centers: Sequence[State] = (),
) -> OptimizerResult | None:
    """The best state that is found around ``start`` (and ``centers``), refined; None where no hypothesis can be scored.

    Whether that is the body is for the caller to judge. Deterministic for a seed.
    """
    options = options or ReacquireOptions()
    hypotheses = search(objective, start, options.search, centers)
    middle = range(objective.n_levels - 1, 0, -1) or range(1)
    refined = [align_levels(objective, h.state, chain, middle) for h in hypotheses[: options.candidates]]
    if not refined:
        return None
    scores = objective.scores([result.state for result in refined])
    best = refined[int(scores.argmin())]
    last = align_levels(objective, best.state, chain, (0,))
    asked = options.search.n * options.search.rounds + sum(result.evaluations for result in refined)
    return replace(last, evaluations=last.evaluations + asked)
