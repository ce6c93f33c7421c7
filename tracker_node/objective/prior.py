"""Gaussian pull of a state: what is believed before the images are looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry import so3
from ..model.configuration import State


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
        """Add the pull at ``state`` to the normal equations; returns its cost."""
        offset = state.difference(self.mean)
        J = so3.left_jacobian_inverse(offset[3:6])  # of the rotation's logarithm by a small turn of the state
        if self.information.ndim == 1:
            H[np.diag_indices_from(H)] += np.where(np.arange(g.size) // 3 == 1, 0.0, self.information)
            H[3:6, 3:6] += J.T @ (self.information[3:6, None] * J)
            pull = self.information * offset
        else:
            turned = self.information.copy()
            turned[3:6] = J.T @ turned[3:6]
            turned[:, 3:6] = turned[:, 3:6] @ J
            H += turned
            pull = self.information @ offset
        cost = float(offset @ pull)
        pull[3:6] = J.T @ pull[3:6]
        g += pull
        return cost
