"""Finding a body again that has moved too far from where it was expected: many hypotheses, of which the best are refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .alignment import AlignmentOptions, PyramidObjective, align
from .levenberg_marquardt import OptimizerResult
from .robust_start import RobustStartOptions, search
from .score_objective import ScoreObjective


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

    search: RobustStartOptions = field(
        default_factory=lambda: RobustStartOptions(0.35, 0.6, 3000, rounds=1, keep=40, row_step=8)
    )
    alignment: AlignmentOptions = field(default_factory=lambda: AlignmentOptions(tolerance=1e-4))
    candidates: int = 3


def reacquire(
    objective: ScoredPyramid,
    start: State,
    chain: KinematicChain,
    options: ReacquireOptions | None = None,
    centers: Sequence[State] = (),
) -> OptimizerResult | None:
    """Search around states, and refine what is found; deterministic for a seed.

    Whether that is the body is for the caller to judge.

    Parameters
    ----------
    objective : scores and levels of the same images.
    start, chain : state that hypotheses are spread around, and the limits of its joints.
    options : None: the defaults.
    centers : further states to spread hypotheses around.

    Returns
    -------
    The best state; None where no hypothesis can be scored.
    """
    options = options or ReacquireOptions()
    found = [hypothesis.state for hypothesis in search(objective, start, options.search, centers)]
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
