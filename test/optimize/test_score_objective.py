"""Pose variables that are scored and counted, whoever searches."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.numeric.analytic_scores import hinged
from tracker_node.model import configuration
from tracker_node.model.configuration import State
from tracker_node.optimize.score_objective import VariableSpace

MODEL = crane()
CHAIN = MODEL.chain
SIZE = configuration.N_ROOT + CHAIN.n_axes


class Sums:
    """Scores a state by the sum of its variables; remembers how it was asked, and at which step of rows."""

    def __init__(self, row_step=1, asked=None):
        self.row_step, self.asked = row_step, [] if asked is None else asked

    def score(self, state):
        self.asked.append(("one", self.row_step))
        return float(configuration.to_variables(state).sum())

    def scores(self, states):
        self.asked.append((len(states), self.row_step))
        return np.array([float(configuration.to_variables(state).sum()) for state in states])

    def at_row_step(self, row_step):
        return Sums(row_step, self.asked)


def space(start=None):
    return VariableSpace(Sums(), start or State.neutral(MODEL), CHAIN)


def test_limits_are_those_of_the_joints():
    found = space()
    assert found.size == SIZE
    assert np.all(np.isneginf(found.lower[:6]) & np.isposinf(found.upper[:6]))
    assert np.array_equal(found.lower[6:], CHAIN.lower)
    assert np.array_equal(found.upper[6:], CHAIN.upper)


@pytest.mark.parametrize(("beyond", "limit"), [(1.0, CHAIN.upper), (-1.0, CHAIN.lower)])
def test_a_start_beyond_a_limit_begins_there(beyond, limit):
    root = State.neutral(MODEL).T_world_root.copy()
    root[:3, 3] = [1.0, 2.0, 3.0]
    start = space(start=State(root, limit + beyond)).start
    assert start[:3].tolist() == [1.0, 2.0, 3.0]
    assert np.array_equal(start[6:], limit)


def test_scores_are_counted_for_their_variable_or_shared_out():
    found = space()
    points = [np.full(SIZE, 0.01 * i) for i in range(3)]
    assert found.scores(points, variable=2) == pytest.approx([0.0, 0.01 * SIZE, 0.02 * SIZE])
    assert found.scores(points[1:2], active=(0, 4)) == pytest.approx([0.01 * SIZE])
    found.scores(points)
    expected = np.zeros(SIZE)
    expected[[0, 2, 4]] = [0.5, 3.0, 0.5]
    assert np.array_equal(found.per_variable, expected)
    assert found.evaluations == 7
    assert [how for how, _ in found._whole.asked] == [3, "one", 3]


def test_stages_look_at_every_nth_row_of_the_whole():
    found = space()
    for row_step in (4, 2, 1):
        found.begin_stage(row_step)
        found.scores([np.zeros(SIZE)])
    assert [row_step for _, row_step in found._whole.asked] == [4, 2, 1]


@pytest.mark.parametrize(("score", "ended", "converged"), [(1.0, True, True), (1.0, False, False), (np.inf, True, False)])
def test_a_result_converged_where_the_rule_was_met_and_something_was_scored(score, ended, converged):
    x = np.linspace(0.0, 0.1, SIZE)
    result = space().result(x, score, ended)
    assert result.converged == converged
    assert result.score == score
    assert np.allclose(configuration.to_variables(result.state), x)


class PartSums(Sums):
    """The same, which is told what stays."""

    def beside(self, state, variables):
        self.asked.append(("beside", self.row_step, tuple(variables)))
        return Sums(self.row_step, self.asked)

    def at_row_step(self, row_step):
        return PartSums(row_step, self.asked)


def test_variables_of_a_limb_are_stepped_together_and_the_rest_is_held_once():
    chain = hinged(*[(-1.0, 1.0)] * 8)  # a snake: each hinge moves one link less than that before
    score = PartSums()
    found = VariableSpace(score, State(np.eye(4), np.zeros(8)), chain)
    whole = VariableSpace(Sums(), State(np.eye(4), np.zeros(8)), chain)
    assert found.together(range(14)) == [[*range(12)], [12, 13]]  # those that move nine links down to three, then two and one
    assert found.together([12, 7, 13]) == [[12], [7], [13]]
    assert whole.together([3, 13]) == [[3, 13]]
    found.begin_stage(2)
    assert found.hold(found.start, [12, 13])
    assert not found.hold(found.start, [12, 13])
    found.begin_stage(2)
    assert not found.hold(found.start, [12, 13])  # the same rows: drawn already
    found.begin_stage(1)
    assert found.hold(found.start, [12, 13])
    assert score.asked == [("beside", 2, (12, 13)), ("beside", 1, (12, 13))]
    assert not whole.hold(found.start, [12])
