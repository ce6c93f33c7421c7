"""Downhill stepping against the published rule, worked out by hand, and the V-algorithm against lines whose vertex is known."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from helpers.numeric.analytic_scores import RIGID, AnalyticScore, hinged, state_at
from tracker_node.optimize.stepping import (
    DECIMATED_LOOPS,
    FIVE_LOOPS,
    SEVEN_LOOPS,
    V_WHERE,
    LoopOptions,
    SteppingOptions,
    intersection,
    step_downhill,
    vertex,
)

START = state_at(0, 0, 0, 0, 0, 0)
METER = (LoopOptions(1.0, 1.0),)  # steps of one, to count along


def one_variable(score_at: dict[int, float]):
    """Step x alone, by one, over scores given at whole numbers; what was asked, in order, and the result."""
    objective = AnalyticScore(lambda x: score_at[round(x[0])])
    result = step_downhill(objective, START, RIGID, SteppingOptions(METER, v="never"), active=[0])
    return [round(x[0]) for x in objective.asked], result


@pytest.mark.parametrize(
    ("scores", "asked", "best"),
    [
        # up is lower: 1, 2 fall, 3 and 4 rise
        ({-1: 9, 0: 8, 1: 6, 2: 3, 3: 4, 4: 5}, [0, 1, -1, 2, 3, 4], 2),
        # one increase is stepped over: 2 rises, 3 falls again, 4 and 5 rise
        ({-1: 9, 0: 8, 1: 6, 2: 7, 3: 3, 4: 4, 5: 5}, [0, 1, -1, 2, 3, 4, 5], 3),
        # the bump was higher ground for nothing: the lowest is behind it
        ({-1: 9, 0: 8, 1: 2, 2: 7, 3: 3, 4: 4, 5: 5}, [0, 1, -1, 2, 3, 4, 5], 1),
        # down is lower
        ({1: 9, 0: 8, -1: 6, -2: 7, -3: 8}, [0, 1, -1, -2, -3], -1),
        # both neighbors are higher: one more in the lower one's direction, and back
        ({1: 9, 0: 5, -1: 6, -2: 7}, [0, 1, -1, -2], 0),
        # both neighbors are higher, but there is lower ground behind the lower one
        ({1: 9, 0: 5, -1: 6, -2: 3, -3: 4, -4: 5}, [0, 1, -1, -2, -3, -4], -2),
        # an equal score counts as an increase, and does not win
        ({1: 5, 0: 5, -1: 5, 2: 5}, [0, 1, -1, 2], 0),
        # what cannot be scored is higher than anything
        ({-1: math.inf, 0: 8, 1: 6, 2: math.inf, 3: math.inf}, [0, 1, -1, 2, 3], 1),
    ],
)
def test_a_line_is_walked_as_the_rule_says(scores, asked, best):
    places, result = one_variable(scores)
    assert places == asked
    assert (round(result.variables[0]), result.score) == (best, scores[best])
    assert result.evaluations == len(asked)
    assert result.evaluations_per_variable[0] == len(asked)
    assert result.converged


def test_no_point_is_scored_in_vain_for_two_at_once():
    """Both directions, and the two increases that end a line, are asked for in pairs."""
    objective = AnalyticScore(lambda x: abs(x[0] - 5.2))
    step_downhill(objective, START, RIGID, SteppingOptions(METER, v="never"), active=[0])
    assert [round(x[0]) for x in objective.asked] == [0, 1, -1, 2, 3, 4, 5, 6, 7]
    assert objective.batches == [1, 2, 2, 2, 2]


def test_a_slope_without_end_is_given_up():
    objective = AnalyticScore(lambda x: -x[2])
    result = step_downhill(objective, START, RIGID, SteppingOptions(METER), active=[2])
    assert not result.converged
    assert result.variables[2] == pytest.approx(40.0)


def test_order_schedule_and_rows_are_those_of_the_options():
    objective = AnalyticScore(lambda x: float(np.abs(x).sum()))
    loops = (LoopOptions(0.5, 0.25, 4), LoopOptions(0.125, 0.0625, 1))
    step_downhill(objective, START, RIGID, SteppingOptions(loops, order=(5, 0, 3), v="never"))
    moved = [(int(np.argmax(np.abs(x))), float(np.abs(x).max())) for x in objective.asked]
    line = [(5, 0.25), (5, 0.25), (5, 0.5), (0, 0.5), (0, 0.5), (0, 1.0), (3, 0.25), (3, 0.25), (3, 0.5)]
    fine = [(i, step / 4) for i, step in line]
    np.testing.assert_allclose([m for m in moved if m[1] > 1e-9], line + fine)
    assert objective.row_steps == [4] * 10 + [1] * 10


def test_shipped_schedules_are_those_of_the_paper():
    for loops in (FIVE_LOOPS, DECIMATED_LOOPS, SEVEN_LOOPS):
        assert [round(1e3 * loop.step_m) for loop in loops[:5]] == [50, 30, 20, 10, 10]
        assert [round(math.degrees(loop.step_rad)) for loop in loops[:5]] == [5, 3, 2, 1, 1]
    assert [len(loops) for loops in (FIVE_LOOPS, DECIMATED_LOOPS, SEVEN_LOOPS)] == [5, 5, 7]
    assert {loop.row_step for loop in FIVE_LOOPS + SEVEN_LOOPS} == {1}
    rows = [loop.row_step for loop in DECIMATED_LOOPS]
    assert rows == sorted(rows, reverse=True) and rows[0] > rows[-1]


@settings(max_examples=200)
@given(st.floats(-0.4, 0.4), st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.integers(1, 6), st.floats(0.5, 2.0))
def test_v_finds_where_two_lines_meet(off, falling, rising, k, step):
    """The vertex, if it lies behind the lowest point; else the published pairs meet in that point."""
    x = step * np.arange(k + 5.0)
    tip = step * (k + off)
    f = np.where(x < tip, falling * (tip - x), rising * (x - tip))
    lowest = int(np.argmin(f))
    assume(lowest >= 1)
    expected = max(tip, x[lowest])
    assert vertex(x[: lowest + 3], f[: lowest + 3]) == pytest.approx(expected, abs=1e-9)
    assert vertex(-x[: lowest + 3], f[: lowest + 3]) == pytest.approx(-expected, abs=1e-9)


def test_v_of_the_published_pairs_by_hand():
    # falling from (0, 4) to (1, 2), rising from (2, 1) to (3, 4): 4 - 2 x = 3 x - 5 at 1.8
    assert intersection([0, 1, 2, 3], [4, 2, 1, 4]) == pytest.approx(1.8)
    # falling from (3, 4) to (2, 2), rising from (1, 1) to (0, 2): 2 x - 2 = 2 - x at 4/3
    assert intersection([3, 2, 1, 0], [4, 2, 1, 2]) == pytest.approx(4 / 3)
    # the lowest is the second of the falling pair: 4 - 3 x = 2 x - 2 at 1.2
    assert vertex([-1, 0, 1, 2, 3], [9, 4, 1, 2, 4]) == pytest.approx(1.2)


@pytest.mark.parametrize(
    "f", [[4, 3, 2, 1], [1, 2, 3, 4], [math.inf, 2, 1, 4], [4, 1, 2, math.inf], [4, 4, 1, 2], [9, 8.9, 1, 1.1]]
)
def test_what_is_no_v_has_no_vertex(f):
    assert intersection([0, 1, 2, 3], f) is None


def test_no_vertex_at_the_end_of_a_walk():
    assert vertex([0, 1, 2], [3, 2, 1]) is None
    assert vertex([0, 1, 2, 3], [1, 2, 3, 4]) is None


def tips(tip, weights):
    return AnalyticScore(lambda x: float(weights @ np.abs(x - tip)))


def test_v_in_every_line_finds_most_variables_exactly():
    """Each loop has an even chance that the vertex lies behind the lowest point; once found, it is kept."""
    errors = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        tip = rng.uniform(-1, 1, 6) * np.array([0.2] * 3 + [0.3] * 3)
        result = step_downhill(tips(tip, rng.uniform(1, 9, 6)), START, RIGID)
        assert result.converged
        errors.append(np.abs(result.variables - tip) / np.array([0.01] * 3 + [math.radians(1.0)] * 3))
    assert np.max(errors) <= 0.5 + 1e-9  # half of the last loop's step
    assert np.mean(np.array(errors) < 1e-6) > 0.9


def test_where_v_is_used():
    tip = np.array([0.113, 0.0417, -0.0291, 0.0, 0.0, 0.0])
    asked = {}
    for v in V_WHERE:
        objective = tips(tip, np.ones(6))
        step_downhill(objective, START, RIGID, SteppingOptions(v=v))
        asked[v] = [i for i, x in enumerate(objective.asked) if not on_the_grid(x[:3])]
    first, before_last = (
        step_downhill(tips(tip, np.ones(6)), START, RIGID, SteppingOptions(FIVE_LOOPS[:n], v="never")).evaluations for n in (1, 4)
    )
    assert asked["never"] == []
    assert asked["last_loop"][0] >= before_last
    assert asked["every_line"][0] < first


def on_the_grid(position):
    return np.allclose(position, 0.01 * np.round(position / 0.01), atol=1e-9)


def test_about_as_many_scores_as_in_the_paper():
    """It says about 20 iterations a variable."""
    tip = np.array([0.05, -0.04, 0.03, 0.1, -0.08, 0.06])
    result = step_downhill(tips(tip, np.ones(6)), START, RIGID)
    assert (result.evaluations_per_variable > 14).all() and (result.evaluations_per_variable < 26).all()
    assert result.evaluations_per_variable.sum() == pytest.approx(result.evaluations)


def correlated(x):
    """A curved valley: no variable is right before the others are."""
    y = np.array([x[0] + 0.5 * x[1], x[1] - 0.4 * x[3], x[2] + 0.3 * x[0], x[3], x[4] + x[5], x[5]])
    return float(np.sqrt(1e-6 + y @ y))


def test_the_score_never_rises_and_is_that_of_the_result():
    objective = AnalyticScore(correlated)
    start = state_at(0.1, -0.1, 0.05, 0.2, 0.1, -0.2)
    result = step_downhill(objective, start, RIGID, SteppingOptions(SEVEN_LOOPS))
    assert result.score == objective.score(result.state) == min(objective.function(x) for x in objective.asked)
    again = step_downhill(AnalyticScore(correlated), start, RIGID, SteppingOptions(SEVEN_LOOPS))
    np.testing.assert_array_equal(again.variables, result.variables)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_limits_are_never_left(seed):
    """Not at any point that is scored, wherever the start and the minimum are; and the minimum in the
    box is found, within half a step where a limit is too near for a V."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(-0.5, 0.2, 3)
    chain = hinged(*((a, a + w) for a, w in zip(low, rng.uniform(0.02, 0.6, 3), strict=True)))
    tip = np.concatenate([np.zeros(6), rng.uniform(-0.6, 0.6, 3)])
    objective = AnalyticScore(lambda x: float(np.abs(x - tip).sum()))
    start = state_at(*np.zeros(6), *rng.normal(0, 0.4, 3))
    result = step_downhill(objective, start, chain, SteppingOptions())
    angles = np.array([x[6:] for x in objective.asked])
    assert (angles >= chain.lower).all() and (angles <= chain.upper).all()
    np.testing.assert_allclose(result.variables[6:], np.clip(tip[6:], chain.lower, chain.upper), atol=math.radians(0.51))
    assert result.converged


def test_inactive_variables_stay():
    chain = hinged((-1.0, 1.0), (-1.0, 1.0))
    tip = np.array([0.1] * 6 + [0.3, 0.3])
    objective = AnalyticScore(lambda x: float(np.abs(x - tip).sum()))
    result = step_downhill(objective, state_at(*np.zeros(8)), chain, active=[7, 2])
    np.testing.assert_array_equal(result.variables[[0, 1, 3, 4, 5, 6]], 0.0)
    np.testing.assert_allclose(result.variables[[2, 7]], [0.1, 0.3], atol=1e-9)


def test_a_start_that_cannot_be_scored_is_said():
    result = step_downhill(AnalyticScore(lambda x: math.inf), START, RIGID)
    assert (result.converged, result.score, result.evaluations) == (False, math.inf, 1)
    np.testing.assert_array_equal(result.state.T_world_root, np.eye(4))


def test_ground_that_cannot_be_scored_is_never_chosen():
    """Half of the space has no score, and the minimum lies at its edge."""
    objective = AnalyticScore(lambda x: math.inf if x[0] > 0.07 else float(np.abs(x - 0.1).sum()))
    result = step_downhill(objective, START, RIGID)
    assert math.isfinite(result.score) and 0.05 < result.variables[0] <= 0.07


@pytest.mark.parametrize("wrong", [{"schedule": ()}, {"v": "sometimes"}])
def test_options_that_make_no_sense(wrong):
    with pytest.raises(ValueError, match="expected"):
        SteppingOptions(**wrong)
