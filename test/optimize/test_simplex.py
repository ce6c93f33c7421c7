"""The simplex, its polish, what all optimizers have in common and the search for a start, on scores whose minimum is known."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmark.color._fits import stepping_simplex
from helpers.numeric.analytic_scores import RIGID, AnalyticScore, hinged, state_at
from tracker_node.optimize.robust_start import RobustStartOptions, search
from tracker_node.optimize.simplex import POLISH, SimplexStage, search_simplex
from tracker_node.optimize.stepping import DECIMATED_LOOPS, SteppingOptions, step_downhill

OPTIMIZERS = {"stepping": step_downhill, "simplex": search_simplex, "stepping_simplex": stepping_simplex}
START = state_at(0, 0, 0, 0, 0, 0)


def rosenbrock(x):
    """Its valley in six dimensions, a tenth as large, so that the minimum lies 100 mm and 0.1 rad off in every variable."""
    y = 10.0 * x
    return float((100.0 * (y[1:] - y[:-1] ** 2) ** 2 + (1.0 - y[:-1]) ** 2).sum())


def correlated(x, tip):
    y = np.array([[1, 0.5, 0, 0, 0, 0], [0, 1, 0, -0.4, 0, 0], [0.3, 0, 1, 0, 0, 0.2], [0, 0, 0.5, 1, 0, 0],
                  [0, 0, 0, 0, 1, 1], [0.3, 0, 0, 0, 0, 1]]) @ (x - tip)  # fmt: skip
    return float(np.sqrt(1e-8 + y @ y))


def test_rosenbrock_in_six_dimensions():
    stages = tuple(SimplexStage(s, s, 1e-4, max_evaluations=1000) for s in (0.05, 0.02, 0.01))
    objective = AnalyticScore(rosenbrock)
    result = search_simplex(objective, START, RIGID, stages)
    np.testing.assert_allclose(result.variables, 0.1, atol=1e-5)
    assert result.converged
    assert result.evaluations == len(objective.asked)
    assert result.evaluations_per_variable.sum() == pytest.approx(result.evaluations)


@pytest.mark.parametrize("name", sorted(OPTIMIZERS))
def test_every_optimizer_finds_a_correlated_minimum(name):
    """Six variables that depend on each other: one at a time is slower, and the simplex is where it should be."""
    tip = np.array([0.04, -0.05, 0.03, 0.06, -0.08, 0.05])
    objective = AnalyticScore(lambda x: correlated(x, tip))
    result = OPTIMIZERS[name](objective, START, RIGID)
    error = np.abs(result.variables - tip).max()
    assert error < (0.02 if name == "stepping" else 5e-4)
    assert result.score == pytest.approx(correlated(result.variables, tip))
    again = OPTIMIZERS[name](AnalyticScore(objective.function), START, RIGID)
    np.testing.assert_array_equal(again.variables, result.variables)


@pytest.mark.parametrize("name", sorted(OPTIMIZERS))
def test_no_optimizer_leaves_the_limits_or_moves_what_is_not_active(name):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        chain = hinged(*((a, a + 0.3) for a in rng.uniform(-0.4, 0.1, 3)))
        tip = np.concatenate([rng.uniform(-0.05, 0.05, 6), rng.uniform(-0.5, 0.5, 3)])
        objective = AnalyticScore(lambda x, tip=tip: float(((x - tip) ** 2).sum()))
        start = state_at(*np.zeros(6), *rng.normal(0, 0.4, 3))
        result = OPTIMIZERS[name](objective, start, chain, active=[0, 1, 4, 6, 7, 8])
        angles = np.array([x[6:] for x in objective.asked])
        assert (angles >= chain.lower).all() and (angles <= chain.upper).all()
        np.testing.assert_array_equal(result.variables[[2, 3, 5]], 0.0)
        np.testing.assert_allclose(result.variables[6:], np.clip(tip[6:], chain.lower, chain.upper), atol=4e-3)


@pytest.mark.parametrize("name", sorted(OPTIMIZERS))
def test_a_start_that_cannot_be_scored_is_said(name):
    result = OPTIMIZERS[name](AnalyticScore(lambda x: math.inf), START, RIGID)
    assert not result.converged and result.score == math.inf
    np.testing.assert_array_equal(result.state.T_world_root, np.eye(4))


def test_ground_that_cannot_be_scored_is_never_chosen():
    objective = AnalyticScore(lambda x: math.inf if x[0] > 0.07 else float(((x - 0.1) ** 2).sum()))
    result = search_simplex(objective, START, RIGID)
    assert math.isfinite(result.score) and 0.06 < result.variables[0] <= 0.07


def test_too_few_evaluations_are_not_convergence():
    stage = SimplexStage(0.05, 0.05, 1e-6, max_evaluations=3)
    result = search_simplex(AnalyticScore(rosenbrock), START, RIGID, (stage,))
    assert not result.converged
    assert result.score <= rosenbrock(np.zeros(6))


def test_stages_look_at_the_rows_they_are_told():
    objective = AnalyticScore(lambda x: float((x**2).sum()))
    search_simplex(objective, START, RIGID)
    seen = objective.row_steps
    assert seen == sorted(seen, reverse=True) and set(seen) == {8, 4, 1}


def test_polish_stays_where_it_was_put():
    """It is fine from the first step: on a wavy score it does not jump to another valley."""
    tip = np.array([0.002, -0.001, 0.0, 0.003, 0.0, -0.002])
    objective = AnalyticScore(lambda x: correlated(x, tip))
    result = search_simplex(objective, START, RIGID, POLISH)
    assert max(np.abs(x).max() for x in objective.asked) < 0.05
    np.testing.assert_allclose(result.variables, tip, atol=3e-4)


def test_stepping_and_simplex_in_a_row_are_counted_together():
    chain, start = hinged((-1.0, 1.0)), state_at(0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
    target = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2])

    def score() -> AnalyticScore:
        return AnalyticScore(lambda x: float(np.abs(x - target).sum()))

    counted = score()
    both = stepping_simplex(counted, start, chain, active=(0, 6))
    first = step_downhill(score(), start, chain, SteppingOptions(DECIMATED_LOOPS), (0, 6))
    second = search_simplex(score(), first.state, chain, POLISH, (0, 6))
    assert both.evaluations == len(counted.asked) == first.evaluations + second.evaluations
    np.testing.assert_allclose(both.evaluations_per_variable, first.evaluations_per_variable + second.evaluations_per_variable)
    np.testing.assert_array_equal(both.variables, second.variables)
    assert both.score == second.score
    np.testing.assert_array_equal(both.variables[1:6], np.zeros(5))  # what is not active stays


class TestRobustStart:
    tip = np.array([0.15, -0.1, 0.08, 0.2, -0.15, 0.1])

    def pit(self, x):
        """Flat but for a pit of 60 mm and 0.1 rad: nothing to walk down until one is in it."""
        off = (x - self.tip) / np.array([0.12] * 3 + [0.25] * 3)
        return min(1.0, float(np.linalg.norm(off)))

    def test_a_pit_in_a_plain_is_found(self):
        objective = AnalyticScore(self.pit)
        found = search(objective, START, RobustStartOptions(n=400))
        assert [h.score for h in found] == sorted(h.score for h in found)
        assert found[0].score < 0.6 < self.pit(np.zeros(6))
        assert set(objective.row_steps) == {8} and len(objective.batches) == 3

    def test_the_first_round_fills_two_balls(self):
        """As many hypotheses in half the radius as its share of the volume."""
        objective = AnalyticScore(lambda x: 1.0)
        options = RobustStartOptions(spread_m=0.4, spread_rad=0.5, n=2000, rounds=1)
        search(objective, START, options)
        position = np.array([np.linalg.norm(x[:3]) for x in objective.asked])
        turn = np.array([
            np.linalg.norm(Rotation.from_euler("YXZ", x[3:6]).as_rotvec()) for x in objective.asked
        ])  # fmt: skip
        for radius, limit in ((position, 0.4), (turn, 0.5)):
            assert radius.max() <= limit + 1e-9
            assert np.mean(radius < 0.5 * limit) == pytest.approx(1 / 8, abs=0.02)
        assert np.linalg.norm(np.mean([x[:3] for x in objective.asked], axis=0)) < 0.01

    def test_hypotheses_that_are_kept_stand_apart(self):
        def nearest(options):
            """Of all pairs, in shares of the last round's spread."""
            found = [h.state for h in search(AnalyticScore(self.pit), START, options)]
            spreads = np.repeat([options.spread_m, options.spread_rad], 3) * options.shrink ** (options.rounds - 1)
            tangents = [a.difference(b) / spreads for i, a in enumerate(found) for b in found[:i]]
            return min(max(np.linalg.norm(t[:3]), np.linalg.norm(t[3:])) for t in tangents)

        assert nearest(RobustStartOptions(n=400, keep=24, apart=0.0)) < 0.6
        assert nearest(RobustStartOptions(n=400, keep=24, apart=0.8)) >= 0.8 - 1e-6

    def test_the_seed_decides(self):
        runs = [search(AnalyticScore(self.pit), START, RobustStartOptions(seed=s)) for s in (3, 3, 4)]
        np.testing.assert_array_equal(runs[0][0].state.T_world_root, runs[1][0].state.T_world_root)
        assert runs[0][0].score != runs[2][0].score

    def test_nothing_to_score_is_an_empty_list(self):
        assert search(AnalyticScore(lambda x: math.inf), START) == []
