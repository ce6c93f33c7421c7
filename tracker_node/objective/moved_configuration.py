"""A body a moment before or after the state that is sought: what a camera sees that does not expose with the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry import so3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State


def moved_configuration(model: ArticulatedModel, state: State, offset: np.ndarray) -> Configuration:
    """The body in ``state.retract(offset)``, with ``twists`` that are derivatives by ``state``.

    ``offset`` (n_dof,) is held fixed. A small turn d of the root before it has turned by w on the way is the turn exp(w) d after
    it; all else adds up.
    """
    configuration = Configuration(model, state.retract(offset))
    configuration.twists[3:6] = so3.exp(offset[3:6]).T @ configuration.twists[3:6]
    return configuration


def bodies_seen(model: ArticulatedModel, state: State, offsets: Sequence[np.ndarray | None]) -> list[Configuration]:
    """The body as each camera sees it; one and the same where there is no offset."""
    common = Configuration(model, state)
    return [common if offset is None else moved_configuration(model, state, offset) for offset in offsets]


def cameras_by_body(cameras: Sequence[int], bodies: Sequence[Configuration]) -> list[list[int]]:
    """Those of ``cameras`` that see one and the same configuration, together; in order."""
    groups: dict[int, list[int]] = {}
    for i in cameras:
        groups.setdefault(id(bodies[i]), []).append(i)
    return list(groups.values())
