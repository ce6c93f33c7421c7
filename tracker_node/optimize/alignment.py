"""Alignment from coarse to fine: Levenberg-Marquardt on each level of an image pyramid, the coarsest first."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from ..objective.normal_equations import LeastSquaresObjective
from .levenberg_marquardt import LevenbergMarquardtOptions, OptimizerResult, minimize


class PyramidObjective(Protocol):
    """A least-squares problem on several levels; level 0 is the finest."""

    @property
    def n_levels(self) -> int: ...

    def at_level(self, level: int) -> LeastSquaresObjective: ...


@dataclass(frozen=True)
class AlignmentOptions:
    """``coarsest`` level to start on (of those that there are), ``finest`` to end on; iterations on each level, and the relative
    fall of the cost at which the finest level, and each coarser one, is left."""

    coarsest: int = 3
    finest: int = 0
    max_iterations: int = 12
    tolerance: float = 3e-3
    coarse_tolerance: float = 3e-2
    step_tolerance: float = 2e-5
    damping: float = 1e-3


def align(
    objective: PyramidObjective, start: State, chain: KinematicChain, options: AlignmentOptions | None = None
) -> OptimizerResult:
    """Align level after level, the coarsest first; deterministic.

    Parameters
    ----------
    objective : on all levels.
    start, chain : state to begin at, and the limits of its joints.
    options : levels and tolerances; None: the defaults.

    Returns
    -------
    The state after all levels; its equations are those of the finest one.
    """
    options = options or AlignmentOptions()
    lm = LevenbergMarquardtOptions(
        max_iterations=options.max_iterations, damping=options.damping, tolerance=options.tolerance,
        step_tolerance=options.step_tolerance,
    )  # fmt: skip
    iterations = evaluations = 0
    result = None
    for level in range(min(options.coarsest, objective.n_levels - 1), options.finest - 1, -1):
        here = lm if level == options.finest else replace(lm, tolerance=options.coarse_tolerance)
        result = minimize(objective.at_level(level), start if result is None else result.state, chain, here)
        iterations, evaluations = iterations + result.iterations, evaluations + result.evaluations
    if result is None:
        raise ValueError(f"expected levels from coarsest to finest, got {options.coarsest} to {options.finest}")
    return replace(result, iterations=iterations, evaluations=evaluations)
