"""Scores in closed form, for tests of optimizers that go by scores alone; they remember what they were asked."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tracker_node.model import configuration
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain

RIGID = KinematicChain(("base",), ())


def hinged(*limits: tuple[float, float]) -> KinematicChain:
    """A chain of links, one hinge between each, with these limits (rad)."""
    links = tuple(f"link{i}" for i in range(len(limits) + 1))
    joints = tuple(
        Joint(f"joint{i}", links[i], links[i + 1], np.eye(4), (Axis(f"axis{i}", (1.0, 0.0, 0.0), low, high, low),))
        for i, (low, high) in enumerate(limits)
    )
    return KinematicChain(links, joints)


class AnalyticScore:
    """``function`` of the pose variables as a score; ``asked`` are the variables of every state, ``batches`` how many at once and
    ``row_steps`` on which rows."""

    def __init__(self, function: Callable[[np.ndarray], float], row_step: int = 1, record: AnalyticScore | None = None):
        self.function, self.row_step = function, row_step
        self.asked: list[np.ndarray] = record.asked if record else []
        self.batches: list[int] = record.batches if record else []
        self.row_steps: list[int] = record.row_steps if record else []

    def score(self, state: State) -> float:
        return float(self.scores([state])[0])

    def scores(self, states: list[State]) -> np.ndarray:
        points = [configuration.to_variables(state) for state in states]
        self.asked += points
        self.batches.append(len(points))
        self.row_steps += [self.row_step] * len(points)
        return np.array([self.function(x) for x in points])

    def at_row_step(self, row_step: int) -> AnalyticScore:
        return AnalyticScore(self.function, row_step, self)


def state_at(*variables: float) -> State:
    """The state of these pose variables."""
    return configuration.from_variables(np.array(variables))
