"""Gaussian prior of a state."""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from ...geometry import so3
from ...model.configuration import State


@dataclass(frozen=True, eq=False)
class Prior:
    """Cost d^T information d, d the tangent from ``mean`` to the state.

    Attributes
    ----------
    mean : the expected state.
    information : (n_dof,) diagonal or (n_dof, n_dof) symmetric matrix, in the unit of the objective it is added to per
        tangent^2; an inverse covariance where that objective is a log posterior.
    """

    mean: State
    information: np.ndarray

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
        # Of the rotation's logarithm by a small turn of the state
        J = so3.left_jacobian_inverse(offset[3:6])
        information = np.diag(self.information) if self.information.ndim == 1 else self.information
        return _add(offset, J, information, H, g)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _add(offset, J, information, H, g):
    """Add K^T information K to ``H``, K^T information offset to ``g``, K the identity but for J at the root's turn; the cost."""
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
