"""What searches for limbs ask of an image set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...model.configuration import State
from ...objective.lines.correspondences import PartEvidence
from ..poses import Poses


@dataclass(frozen=True, eq=False)
class PartPose:
    """A body with one part fitted, and how far its outline then agrees with the images."""

    state: State
    evidence: PartEvidence


class SearchedSet(Protocol):
    """The image set in which limbs are searched."""

    def gains(self, poses: Poses, shapes: np.ndarray) -> np.ndarray:
        """Log-likelihood that the colors gain by some parts, and the cells in which they show.

        Parameters
        ----------
        poses : n poses.
        shapes : (n_shapes,) mask of the parts; the rest of the body is where the first pose has it.

        Returns
        -------
        (n, 2)
        """
        ...

    def fit_part(self, state: State, dofs: np.ndarray) -> PartPose:
        """The body with some degrees of freedom fitted to its contours.

        Parameters
        ----------
        state : to begin at.
        dofs : (n_dof,) mask of what moves.

        Returns
        -------
        The fitted state, and what agrees there.
        """
        ...
