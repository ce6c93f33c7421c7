"""Rounds of hypotheses, by scores in closed form: where they stand, which are kept, and what counts as chance."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers.numeric.analytic_scores import AnalyticScore, state_at
from tracker_node.geometry import so3
from tracker_node.model.configuration import State
from tracker_node.optimize.robust_start import Hypothesis, RobustStartOptions, _ball_points, _distinct, chance_level, search

START = state_at(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.4)
FEW = RobustStartOptions(spread_m=0.2, spread_rad=0.4, n=32, rounds=2, shrink=0.5, keep=3, apart=0.25, row_step=1)


def distance(state: State, center: State) -> float:
    return float(np.linalg.norm(state.T_world_root[:3, 3] - center.T_world_root[:3, 3]))


def turn(state: State, center: State) -> float:
    return float(np.linalg.norm(so3.log(state.T_world_root[:3, :3] @ center.T_world_root[:3, :3].T)))


class States:
    """Scores states by their distance from a place, and remembers batches of them."""

    def __init__(self, place=(1.0, 2.0, 3.0), scores=None):
        self.place, self.batches, self.steps, self.fixed = np.array(place), [], [], scores

    def scores(self, states):
        self.batches.append(list(states))
        if self.fixed is not None:
            return np.resize(self.fixed, len(states))
        return np.array([np.linalg.norm(state.T_world_root[:3, 3] - self.place) for state in states])

    def at_row_step(self, row_step):
        self.steps.append(row_step)
        return self


def test_points_fill_two_balls_evenly():
    """In a unit ball the radius to the third is uniform, whatever the direction; that of the other ball knows nothing of it."""
    points = _ball_points(4096, 3)
    assert points.shape == (4096, 6)
    for half in (points[:, :3], points[:, 3:]):
        shares = np.sort(np.linalg.norm(half, axis=1) ** 3)
        np.testing.assert_allclose(shares, (np.arange(4096) + 0.5) / 4096, atol=0.01)
        np.testing.assert_allclose(half.T @ half / 4096, np.eye(3) / 5.0, atol=0.01)  # of a full unit ball
        np.testing.assert_allclose(half.mean(axis=0), 0.0, atol=0.01)
    np.testing.assert_allclose(points[:, :3].T @ points[:, 3:] / 4096, 0.0, atol=0.01)


def test_the_first_round_is_of_the_start_and_states_around_it():
    objective = States()
    search(objective, START, replace(FEW, rounds=1))
    (batch,) = objective.batches
    assert batch[0] is START and len(batch) == 1 + FEW.n
    for state in batch[1:]:
        assert distance(state, START) <= 0.2 and turn(state, START) <= 0.4
        assert state.joint_positions.tolist() == [0.4]  # only the root moves
    assert max(distance(state, START) for state in batch[1:]) > 0.15
    assert max(turn(state, START) for state in batch[1:]) > 0.3


def test_each_round_is_narrower_and_about_the_best_so_far():
    objective = States(place=(1.1, 2.0, 3.0))
    search(objective, START, replace(FEW, keep=1, rounds=3))
    first, second, third = objective.batches
    assert [len(first), len(second), len(third)] == [1 + FEW.n, FEW.n, FEW.n]
    best = min(first, key=lambda state: objective.scores([state])[0])
    assert max(distance(state, best) for state in second) == pytest.approx(0.1, rel=0.2)
    assert max(distance(state, best) for state in second) <= 0.1
    better = min([*first, *second], key=lambda state: objective.scores([state])[0])
    assert max(distance(state, better) for state in third) <= 0.05
    moved = [np.subtract(s.T_world_root[:3, 3], c.T_world_root[:3, 3]) for batch, c in ((first[1:], START), (second, best))
             for s in batch[:1]]  # fmt: skip
    assert not np.allclose(moved[0], 2.0 * moved[1])  # not the same directions again


def test_the_best_come_first_and_of_all_rounds():
    objective = States()
    found = search(objective, START, FEW)
    assert found[0].state is START and found[0].score == 0.0
    scores = [hypothesis.score for hypothesis in found]
    assert scores == sorted(scores) and len(found) == FEW.keep
    assert all(hypothesis.score == pytest.approx(distance(hypothesis.state, START)) for hypothesis in found)


def test_what_cannot_be_scored_is_no_hypothesis():
    found = search(States(scores=[np.inf, 2.0]), START, replace(FEW, n=1, rounds=1))
    assert [hypothesis.score for hypothesis in found] == [2.0]
    assert found[0].state is not START
    assert search(States(scores=[np.inf]), START, FEW) == []
    objective = States(scores=[np.nan])
    assert search(objective, START, FEW) == [] and len(objective.batches) == 1


@pytest.mark.parametrize(("row_step", "steps"), [(1, []), (2, [2]), (8, [8])])
def test_rows_that_are_looked_at(row_step, steps):
    options, objective = replace(FEW, row_step=row_step), States()
    search(objective, START, options)
    assert objective.steps == steps
    chance_level(objective, START, 4, options)
    assert objective.steps == steps * 2


def test_as_many_scores_as_said():
    score = AnalyticScore(lambda x: float(x @ x))
    search(score, START, FEW)
    assert len(score.asked) == FEW.evaluations == 65


def hypothesis(score, x=0.0, angle=0.0):
    return Hypothesis(state_at(x, 0.0, 0.0, 0.0, 0.0, angle), score)


def test_of_two_that_stand_close_only_the_better_is_kept():
    """Apart by a half of 0.2 m and of 0.4 rad: either is enough."""

    def kept(*hypotheses, keep=8):
        return [one.score for one in _distinct(list(hypotheses), replace(FEW, keep=keep), 0.5)]

    assert kept(hypothesis(2.0, 0.09), hypothesis(1.0)) == [1.0]
    assert kept(hypothesis(2.0, 0.11), hypothesis(1.0)) == [1.0, 2.0]
    assert kept(hypothesis(2.0, 0.09, 0.19), hypothesis(1.0)) == [1.0]
    assert kept(hypothesis(2.0, 0.09, 0.21), hypothesis(1.0)) == [1.0, 2.0]
    assert kept(hypothesis(3.0, 0.4), hypothesis(2.0, 0.2), hypothesis(1.0), keep=2) == [1.0, 2.0]
    # The second is near in place and the first in angle: neither is the same as the third
    assert kept(hypothesis(1.0, 0.0, 1.0), hypothesis(2.0, 1.0, 0.0), hypothesis(3.0)) == [1.0, 2.0, 3.0]
    assert kept(hypothesis(1.0, 0.0, 1.0), hypothesis(2.0, 0.01, 0.0), hypothesis(3.0)) == [1.0, 2.0]


def test_angles_apart_end_at_half_a_turn():
    wide = replace(FEW, spread_rad=20.0)
    assert len(_distinct([hypothesis(1.0), hypothesis(2.0, 0.0, math.pi - 0.01)], wide, 1.0)) == 1


def test_chance_is_the_median_of_what_can_be_scored():
    objective = States(scores=[np.inf, 5.0, 1.0, np.nan, 2.0])
    assert chance_level(objective, START, 5, FEW) == 2.0
    (batch,) = objective.batches
    assert len(batch) == 5 and all(0.0 < distance(state, START) <= 0.2 for state in batch)
    assert chance_level(States(scores=[np.inf]), START, 5, FEW) == 0.0
    spread = States()
    chance_level(spread, START, 64, FEW)
    assert 0.15 < max(distance(state, START) for state in spread.batches[0]) <= 0.2


def test_the_seed_of_chance_is_that_of_the_options():
    one, same, other = States(), States(), States()
    for objective, seed in ((one, 4), (same, 4), (other, 5)):
        chance_level(objective, START, 2, replace(FEW, seed=seed))
    np.testing.assert_array_equal(one.batches[0][0].T_world_root, same.batches[0][0].T_world_root)
    assert not np.array_equal(one.batches[0][0].T_world_root, other.batches[0][0].T_world_root)


def test_without_options_those_by_default():
    objective = States()
    search(objective, START)
    assert len(objective.batches[0]) == 1 + RobustStartOptions().n and objective.steps == [RobustStartOptions().row_step]
    assert chance_level(objective, START, 3) > 0.0
