"""Axes that other axes drive, as a least-squares objective."""

from __future__ import annotations

import numpy as np

from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..normal_equations import NormalEquations


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
