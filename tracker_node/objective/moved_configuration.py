"""A body a moment before or after the state that is sought: what a camera sees that does not expose with the others."""

from __future__ import annotations

import numpy as np

from ..geometry import so3
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration, State


def moved_configuration(model: ArticulatedModel, state: State, offset: np.ndarray) -> Configuration:
    """The body in ``state.retract(offset)``, with ``twists`` that are derivatives by ``state``.

    ``offset`` (n_dof,) is held fixed. A small turn d of the root before it has turned by w on the way is the turn exp(w) d after
    it; all else adds up.
    """
    configuration = Configuration(model, state.retract(offset))
    configuration.twists[3:6] = so3.exp(offset[3:6]).T @ configuration.twists[3:6]
    return configuration
