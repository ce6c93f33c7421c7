"""Gaussian priors of a state, axes that drive each other, and sums of objectives and priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...compiled.kernels import compiled
from ...geometry import so3
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..normal_equations import LeastSquaresObjective, NormalEquations


@dataclass(frozen=True, eq=False)
class Prior:
    """Cost d^T information d, d the tangent from ``mean`` to the state.

    Attributes
    ----------
    mean : the expected state.
    information : (n_dof,) diagonal or (n_dof, n_dof) symmetric matrix, in the unit of the objective it is added to per
        tangent^2; an inverse covariance where that objective is a log posterior.
    inverse : (n_dof, n_dof) of the information, where that is known.
    """

    mean: State
    information: np.ndarray
    inverse: np.ndarray | None = None

    def add_to(self, H: np.ndarray, g: np.ndarray, state: State) -> float:
        """Add the prior to normal equations.

        Parameters
        ----------
        H, g : (n_dof, n_dof) and (n_dof,), added to.
        state : at which they hold.

        Returns
        -------
        The prior's cost there.
        """
        offset = state.difference(self.mean)
        return _add(offset, self._information, H, g)

    @cached_property
    def _information(self) -> np.ndarray:
        return np.diag(self.information) if self.information.ndim == 1 else np.ascontiguousarray(self.information)


@compiled
def _add(offset, information, H, g):
    """Add K^T information K to ``H``, K^T information offset to ``g``, K the derivative of the offset from the mean: the identity
    but for the rotation's logarithm by a small turn of the state; the cost."""
    J = so3.left_jacobian_inverse_kernel(offset[3:6])
    n, cost = offset.size, 0.0
    half, pull = np.empty((n, n)), np.empty(n)  # information K
    for i in range(n):
        value = 0.0
        for j in range(n):
            half[i, j] = information[i, j]
            value += information[i, j] * offset[j]
        for j in range(3):
            half[i, 3 + j] = (
                information[i, 3] * J[0, j] + information[i, 4] * J[1, j] + information[i, 5] * J[2, j]
            )  # fmt: skip
        pull[i] = value
        cost += offset[i] * value
    for i in range(n):
        if 3 <= i < 6:
            for j in range(n):
                H[i, j] += J[0, i - 3] * half[3, j] + J[1, i - 3] * half[4, j] + J[2, i - 3] * half[5, j]
            g[i] += J[0, i - 3] * pull[3] + J[1, i - 3] * pull[4] + J[2, i - 3] * pull[5]
        else:
            for j in range(n):
                H[i, j] += half[i, j]
            g[i] += pull[i]
    return cost


class CouplingObjective:
    """Cost ((follower - multiplier * leader - offset) / sigma)^2 of every driven axis of a chain.

    Parameters
    ----------
    sigma : play of the gear, radians or meters of the follower: so little that no other term can change it, and enough for the
        normal equations to stay well conditioned.
    """

    def __init__(self, chain: KinematicChain, sigma: float = 1e-3):
        couplings = chain.couplings
        self._J, self._offsets = np.zeros((len(couplings), chain.n_dof)), np.zeros(len(couplings))
        for row, (follower, leader, following) in enumerate(couplings):
            self._J[row, N_ROOT_DOF + follower] += 1.0 / sigma
            self._J[row, N_ROOT_DOF + leader] -= following.multiplier / sigma
            self._offsets[row] = following.offset / sigma
        self._H = self._J.T @ self._J

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; they are exact everywhere."""
        residuals = self._J[:, N_ROOT_DOF:] @ state.joint_positions - self._offsets
        return NormalEquations(self._H.copy(), self._J.T @ residuals, float(residuals @ residuals), len(residuals))


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
