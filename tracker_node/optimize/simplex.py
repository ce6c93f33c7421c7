"""Nelder & Mead's simplex on a score: all variables at once, as Trewartha, Yeadon & Knight propose instead of stepping.

Several stages, each with a fresh simplex around the best point so far, coarse then fine: a collapsed simplex does not get going
again by itself. Made for rigid bodies and single limbs; above some twenty variables it needs too many scores.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # imports its modules when they are first used

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .score_objective import ScoreObjective, SearchResult, VariableSpace


@dataclass(frozen=True)
class SimplexStage:
    """A simplex whose corners stand ``spread_m`` (root position) and ``spread_rad`` (angles) off; the stage has converged when
    all lie within ``tolerance`` times these of the best, and ends after ``max_evaluations`` per variable at the latest."""

    spread_m: float
    spread_rad: float
    tolerance: float = 0.05
    row_step: int = 1
    max_evaluations: int = 60


STAGES = (
    SimplexStage(0.08, math.radians(8.0), 0.15, 8),
    SimplexStage(0.02, math.radians(2.0), 0.1, 4),
    SimplexStage(0.003, math.radians(0.3), 0.02, 1),
)
POLISH = (SimplexStage(0.006, math.radians(0.6), 0.02, 1),)


def search_simplex(
    objective: ScoreObjective, start: State, chain: KinematicChain, stages: Sequence[SimplexStage] = STAGES,
    active: Sequence[int] | None = None,
) -> SearchResult:  # fmt: skip
    """Minimize over all active variables at once; deterministic.

    Parameters
    ----------
    objective, start, chain : see `stepping.step_downhill`.
    stages : one at least, in order; the last one decides whether the search has converged.
    active : indices of the variables that may move; None: all.

    Returns
    -------
    Converged where the last stage has.
    """
    space = VariableSpace(objective, start, chain)
    variables = list(range(space.size)) if active is None else list(active)
    x, score, converged = space.start.copy(), math.inf, False
    for stage in stages:
        space.begin_stage(stage.row_step)
        x, score, converged = _run_stage(space, x, variables, stage)
        if not math.isfinite(score):
            break
    return space.result(x, score, converged)


def _run_stage(
    space: VariableSpace, start: np.ndarray, variables: list[int], stage: SimplexStage
) -> tuple[np.ndarray, float, bool]:
    """Best point, its score, and whether the simplex has shrunk as far as asked."""
    scale = np.where(np.array(variables) < 3, stage.spread_m, stage.spread_rad)
    center = start[variables]

    def at(z: np.ndarray) -> np.ndarray:
        x = start.copy()
        x[variables] = np.clip(center + scale * z, space.lower[variables], space.upper[variables])
        return x

    def score_of(z: np.ndarray) -> float:
        return float(space.scores([at(z)], active=variables)[0])

    n = len(variables)
    first = score_of(np.zeros(n))
    if not math.isfinite(first):
        return start, first, False
    found = scipy.optimize.minimize(
        score_of, np.zeros(n), method="Nelder-Mead",
        bounds=list(zip((space.lower[variables] - center) / scale, (space.upper[variables] - center) / scale, strict=True)),
        options={
            "initial_simplex": _corners(center, scale, space.lower[variables], space.upper[variables]),
            "xatol": stage.tolerance, "fatol": math.inf, "maxfev": stage.max_evaluations * n, "adaptive": n > 8,
        },
    )  # fmt: skip
    return at(found.x), float(found.fun), bool(found.success)


def _corners(center: np.ndarray, scale: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(n + 1, n) in units of ``scale``: the center, and a step along each axis, inward where a limit is nearer than the step.

    Steps alternate in sign, so that the simplex leans to no side of all variables."""
    n = len(center)
    signs = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    blocked = np.where(signs > 0, center + scale > upper, center - scale < lower)
    signs = np.where(blocked, -signs, signs)
    return np.vstack([np.zeros(n), np.diag(signs)])
