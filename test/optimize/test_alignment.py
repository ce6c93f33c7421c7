"""From coarse to fine, on scripted levels: which are looked at, when each is left, and what is counted."""

import numpy as np
import pytest

from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.optimize.alignment import AlignmentOptions, align

FIXED = KinematicChain(("base",), ())
START = State(np.eye(4), np.zeros(0))


class Bowl:
    """(x - target)^2 along x, and a floor that makes its relative fall small."""

    def __init__(self, target, floor, level, asked):
        self.target, self.floor, self.level, self.asked = target, floor, level, asked

    def linearize(self, state):
        x = state.T_world_root[0, 3]
        self.asked.append((self.level, float(x)))
        g = np.zeros(6)
        g[0] = x - self.target
        return NormalEquations(np.eye(6), g, (x - self.target) ** 2 + self.floor, 10 + self.level)


class Levels:
    def __init__(self, n_levels, floor=1.0):
        self.n_levels, self.floor, self.asked, self.levels = n_levels, floor, [], []

    def at_level(self, level):
        self.levels.append(level)
        return Bowl(1.0 + level, self.floor, level, self.asked)


@pytest.mark.parametrize(
    ("n_levels", "coarsest", "finest", "expected"),
    [(5, 3, 0, [3, 2, 1, 0]), (3, 3, 0, [2, 1, 0]), (4, 3, 1, [3, 2, 1]), (1, 3, 0, [0]), (5, 2, 2, [2])],
)
def test_levels_from_the_coarsest_there_is_to_the_finest_asked(n_levels, coarsest, finest, expected):
    objective = Levels(n_levels, floor=0.0)
    result = align(objective, START, FIXED, AlignmentOptions(coarsest=coarsest, finest=finest, damping=0.1))
    assert objective.levels == expected
    assert result.state.T_world_root[0, 3] == pytest.approx(1.0 + finest, abs=1e-4)
    assert result.equations.count == 10 + finest  # of the finest level
    assert result.evaluations == len(objective.asked)
    assert result.iterations == len(objective.asked) - len(expected)  # none was refused


def test_each_level_begins_where_the_one_before_has_ended():
    objective = Levels(3)
    align(objective, START, FIXED, AlignmentOptions(damping=0.0))
    firsts = {level: next(x for at, x in objective.asked if at == level) for level in (2, 1, 0)}
    assert firsts[2] == 0.0
    assert firsts[1] == pytest.approx(3.0, abs=1e-4)
    assert firsts[0] == pytest.approx(2.0, abs=1e-4)


def test_the_options_reach_every_level():
    objective = Levels(2)
    result = align(objective, START, FIXED, AlignmentOptions(max_iterations=1, damping=1.0))
    assert (result.iterations, result.evaluations) == (2, 5)  # the last step was refused, and what it left looked at again
    # A damping as large as the diagonal halves the step: from 0 to 1 of 2, and from there nowhere, since 1 is the finer target
    assert [x for _, x in objective.asked[:2]] == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize(("tolerance", "coarse", "iterations"), [(0.1, 1e-9, (3, 1)), (1e-9, 0.1, (1, 3))])
def test_the_finest_level_is_left_by_another_rule(tolerance, coarse, iterations):
    """Steps of a damped walk fall short a little less each time; a floor makes the gain of the first one small."""
    objective = Levels(2, floor=1e3)
    options = AlignmentOptions(damping=0.5, tolerance=tolerance, coarse_tolerance=coarse, step_tolerance=0.05, max_iterations=20)
    align(objective, START, FIXED, options)
    of_level = [sum(at == level for at, _ in objective.asked) - 1 for level in (1, 0)]
    assert (of_level[0] > 1, of_level[1] > 1) == (iterations[0] > 1, iterations[1] > 1)


def test_short_steps_end_a_level():
    few, many = Levels(1), Levels(1)
    for objective, step in ((few, 10.0), (many, 1e-6)):
        align(objective, START, FIXED, AlignmentOptions(damping=0.5, tolerance=0.0, step_tolerance=step))
    assert len(few.asked) == 2 < len(many.asked)


def test_levels_that_there_are_not_are_said():
    with pytest.raises(ValueError, match="got 1 to 2"):
        align(Levels(4), START, FIXED, AlignmentOptions(coarsest=1, finest=2))


def test_without_options_those_by_default():
    objective = Levels(9)
    align(objective, START, FIXED)
    assert objective.levels == list(range(AlignmentOptions().coarsest, -1, -1))
