"""Other bodies that are followed in the same images: where they are expected, and which colors they have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .configuration import Configuration


@dataclass(frozen=True, eq=False)
class Neighbor:
    """Another body in the images of a set.

    Attributes
    ----------
    body : where it is expected.
    classes : (n_shapes,) color class of every shape.
    colors : per camera of the rig (n_classes, n_colors) float32, densities of the colors of every class; None where they are not
        known.
    """

    body: Configuration
    classes: np.ndarray
    colors: Sequence[np.ndarray | None]
