"""Several objectives and priors as one."""

from __future__ import annotations

from collections.abc import Sequence

from ..model.configuration import State
from .constraints.prior import Prior
from .normal_equations import LeastSquaresObjective, NormalEquations


class SumObjective:
    """The sum of least-squares objectives, each times its factor, and of priors.

    Objectives in information units (residuals over their standard deviations) are added as they are; a factor brings others to
    that unit, or weighs one against another.
    """

    def __init__(
        self, objectives: Sequence[LeastSquaresObjective], factors: Sequence[float] | None = None, priors: Sequence[Prior] = ()
    ):
        self.objectives = tuple(objectives)
        self.factors = (1.0,) * len(self.objectives) if factors is None else tuple(factors)
        self.priors = tuple(priors)

    def exchanged(self, old: LeastSquaresObjective, new: LeastSquaresObjective) -> SumObjective:
        """The same sum with one objective in place of another.

        Parameters
        ----------
        old : one of ``objectives``.
        new : takes its place, with its factor.

        Returns
        -------
        Another sum.
        """
        return SumObjective([new if objective is old else objective for objective in self.objectives], self.factors, self.priors)

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; added in the order given."""
        parts = [objective.linearize(state) for objective in self.objectives]
        H, g, cost = self.factors[0] * parts[0].H, self.factors[0] * parts[0].g, self.factors[0] * parts[0].cost
        for factor, part in zip(self.factors[1:], parts[1:], strict=True):
            H += factor * part.H
            g += factor * part.g
            cost += factor * part.cost
        for prior in self.priors:
            cost += prior.add_to(H, g, state)
        return NormalEquations(H, g, cost, sum(part.count for part in parts))
