"""What an objective tells an optimizer: cost, gradient and Gauss-Newton matrix at a state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..model.configuration import State


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Second-order model of a cost around a state: cost + 2 g.x + x.H x.

    Attributes
    ----------
    H : (n_dof, n_dof) J^T W J, symmetric, px^2 per tangent^2.
    g : (n_dof,) J^T W r.
    cost : robust cost, px^2 (with priors).
    count : number of residuals in it.
    """

    H: np.ndarray
    g: np.ndarray
    cost: float
    count: int


class LeastSquaresObjective(Protocol):
    """Anything Levenberg-Marquardt can minimize over a `State`."""

    def linearize(self, state: State) -> NormalEquations: ...
