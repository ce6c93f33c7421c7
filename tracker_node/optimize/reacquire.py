"""Finding a body again that has moved too far from where it was expected: many hypotheses, of which the best are refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .alignment import AlignmentOptions, PyramidObjective, align
from .result import OptimizerResult
from .robust_start import RobustStartOptions, search
from .score_objective import ScoreObjective


class ScoredPyramid(ScoreObjective, PyramidObjective, Protocol):
    """A score that has least squares too."""


@dataclass(frozen=True)
class ReacquireOptions:
    """How to look for a body.

    Attributes
    ----------
    search : hypotheses around the expected state.
    alignment : of the best, from its coarsest level to its finest.
    candidates : so many of the best are refined down to the level before the finest, and the best of those on the finest.
    """

    search: RobustStartOptions = field(default_factory=lambda: RobustStartOptions(0.35, 0.6, 1000, column_step=8))
    alignment: AlignmentOptions = field(default_factory=lambda: AlignmentOptions(tolerance=1e-4))
    candidates: int = 4


def reacquire(
    objective: ScoredPyramid,
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
    finest = options.alignment.finest
    but_last = replace(options.alignment, finest=min(finest + 1, options.alignment.coarsest, objective.n_levels - 1))
    refined = [align(objective, h.state, chain, but_last) for h in hypotheses[: options.candidates]]
    if not refined:
        return None
    scores = objective.scores([result.state for result in refined])
    best = refined[int(scores.argmin())]
    last = align(objective, best.state, chain, replace(options.alignment, coarsest=finest))
    asked = options.search.n * options.search.rounds + sum(result.evaluations for result in refined)
    return replace(last, evaluations=last.evaluations + asked)
