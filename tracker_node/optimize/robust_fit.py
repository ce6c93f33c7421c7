"""Fit, and search wider only where the score says that this was not the body.

The shipped default for rigid bodies is `align_robustly`: alone, an alignment goes astray where a background has colors like the
body's; the score shows it, and hypotheses around the start then bring it near enough.

Finding a body again that has moved too far from where it was expected: many hypotheses, of which the best are refined.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .alignment import AlignmentOptions, PyramidObjective, align
from .levenberg_marquardt import OptimizerResult
from .robust_start import RobustStartOptions, chance_level, search
from .score_objective import ScoreObjective


class Fitted(Protocol):
    """What an optimizer returns, at the least."""

    @property
    def state(self) -> State: ...

    @property
    def evaluations(self) -> int: ...


F = TypeVar("F", bound=Fitted)


_TRUSTED_SHARE = 0.5  # of what the body scores by chance around a fit: one that scores no more has found the body
_CHANCE = 16  # hypotheses give what that is
_REFITS = 4  # hypotheses of a search are fitted at most, the best first
_SEARCHES = 3  # each with other hypotheses and twice as many, until a fit is accepted
_AROUND = RobustStartOptions(0.35, 0.6)


@dataclass(frozen=True, eq=False)
class RobustFit(Generic[F]):
    """The best of all fits and its score.

    Attributes
    ----------
    trusted : it scores far better than chance.
    fits : how many there were; one, where nothing had to be searched.
    evaluations : those of all fits, and all hypotheses.
    """

    best: F
    score: float
    trusted: bool
    fits: int
    evaluations: int

    @property
    def state(self) -> State:
        return self.best.state


def fit_robustly(
    objective: ScoreObjective, start: State, fit: Callable[[State], F], around: RobustStartOptions = _AROUND
) -> RobustFit[F]:
    """Fit; where the score is too near to chance, search around the start and fit the best hypotheses. Deterministic.

    Parameters
    ----------
    objective : its score judges the fits, and hypotheses.
    start : state to begin at.
    fit : any optimizer from a start.
    around : hypotheses of the first search.

    Returns
    -------
    The best of all fits.
    """
    best = fit(start)
    score, fits, evaluations = objective.score(best.state), 1, best.evaluations + _CHANCE
    trusted_score = _TRUSTED_SHARE * chance_level(objective, best.state, _CHANCE, around)
    if score <= trusted_score:
        return RobustFit(best, score, True, fits, evaluations)
    for number in range(_SEARCHES):
        ways = replace(around, n=around.n << number, seed=around.seed + 100 * number)
        evaluations += ways.evaluations
        for hypothesis in search(objective, start, ways)[:_REFITS]:
            again = fit(hypothesis.state)
            fits, evaluations = fits + 1, evaluations + again.evaluations
            again_score = objective.score(again.state)
            if again_score < score:
                best, score = again, again_score
            if score <= trusted_score:
                return RobustFit(best, score, True, fits, evaluations)
    return RobustFit(best, score, False, fits, evaluations)


def align_robustly(
    objective: ScoreObjective, pyramid: PyramidObjective, start: State, chain: KinematicChain,
    around: RobustStartOptions = _AROUND,
) -> RobustFit[OptimizerResult]:  # fmt: skip
    """`fit_robustly` by alignment.

    Parameters
    ----------
    objective, pyramid : score, and least squares on levels, of the same images.
    start, chain : state to begin at, and the limits of its joints.
    around : hypotheses of the first search.

    Returns
    -------
    The best of all alignments.
    """
    return fit_robustly(objective, start, lambda state: align(pyramid, state, chain), around)


class ScoredPyramid(ScoreObjective, PyramidObjective, Protocol):
    """A score that has least squares too."""


@dataclass(frozen=True)
class ReacquireOptions:
    """How to look for a body.

    Attributes
    ----------
    search : hypotheses around the expected state; those that it keeps are aligned on the coarsest level. One round: narrowing in
        on the best few leads astray more often than alignment does.
    alignment : of the best, from its coarsest level to its finest.
    candidates : so many of the best then are refined down to the level before the finest, and the best of those on the finest.
    """

    search: RobustStartOptions = field(default_factory=lambda: RobustStartOptions(0.35, 0.6, 3000, rounds=1, keep=40, row_step=8))
    alignment: AlignmentOptions = field(default_factory=lambda: AlignmentOptions(tolerance=1e-4))
    candidates: int = 3


def reacquire(
    objective: ScoredPyramid, start: State, chain: KinematicChain, options: ReacquireOptions | None = None
) -> OptimizerResult | None:
    """Search around a state, and refine what is found; deterministic for a seed.

    Whether that is the body is for the caller to judge.

    Parameters
    ----------
    objective : scores and levels of the same images.
    start, chain : state that hypotheses are spread around, and the limits of its joints.
    options : None: the defaults.

    Returns
    -------
    The best state; None where no hypothesis can be scored.
    """
    options = options or ReacquireOptions()
    found = [hypothesis.state for hypothesis in search(objective, start, options.search)]
    if not found:
        return None
    alignment = options.alignment
    coarsest, finest = min(alignment.coarsest, objective.n_levels - 1), alignment.finest
    evaluations = options.search.n * options.search.rounds
    result: OptimizerResult | None = None
    coarse = objective.at_row_step(options.search.row_step)
    # Level after level, fewer and fewer
    for first, last, keep in ((coarsest, coarsest, options.candidates), (coarsest - 1, finest + 1, 1), (finest, finest, 1)):
        if first < last:
            continue
        aligned = [align(objective, state, chain, replace(alignment, coarsest=first, finest=last)) for state in found]
        evaluations += sum(one.evaluations for one in aligned)
        scores = (coarse if first == coarsest else objective).scores([one.state for one in aligned])
        best = [aligned[i] for i in np.argsort(scores, kind="stable")[:keep]]
        found, result = [one.state for one in best], best[0]
    return None if result is None else replace(result, evaluations=evaluations)
