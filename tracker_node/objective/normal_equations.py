"""Cost, gradient and Gauss-Newton matrix of an objective at a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..model.configuration import State


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Second-order model of a cost around a state: cost + 2 g.x + x.H x.

    Attributes
    ----------
    H : (n_dof, n_dof) J^T W J, symmetric, unit of the cost per tangent^2.
    g : (n_dof,) J^T W r.
    cost : robust cost, with priors. Where residuals are divided by their standard deviations (contours) it is minus twice the log
        posterior, and H the inverse of the state's covariance; else it has the unit of the squared residuals.
    count : number of residuals in it.
    """

    H: np.ndarray
    g: np.ndarray
    cost: float
    count: int


@dataclass(frozen=True, eq=False)
class CameraEquations:
    """One camera's normal equations, by link.

    ``normal`` (n_links, 6, 6) and ``gradient`` (n_links, 6) are W^T W and W^T r of residuals r divided by their standard
    deviations, W their derivatives by the link's spatial twist (v, omega) at the world origin.
    """

    normal: np.ndarray
    gradient: np.ndarray


@dataclass(frozen=True, eq=False)
class Comparison:
    """A fit of one image set with the normal equations of each camera of the rig, None for one that has no part in it.

    ``equations`` are those of ``state``, priors included; all in units of information.
    """

    state: State
    equations: NormalEquations
    cameras: Sequence[CameraEquations | None]


class LeastSquaresObjective(Protocol):
    """Anything Levenberg-Marquardt can minimize over a `State`."""

    def linearize(self, state: State) -> NormalEquations: ...


class Correspondences(LeastSquaresObjective, Protocol):
    """Correspondences of one modality in the images of one set: a value, in which visibility has been decided."""

    def camera_equations(self, state: State) -> Sequence[CameraEquations | None]:
        """Of each camera of the rig at ``state``; None for one without correspondences, or that cannot be compared."""
        ...
