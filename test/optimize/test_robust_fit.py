"""A fit that is not believed is tried again from elsewhere; one that is, is not."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from helpers.numeric.analytic_scores import RIGID, AnalyticScore, state_at
from tracker_node.model.configuration import State, from_variables, to_variables
from tracker_node.optimize import robust_fit
from tracker_node.optimize.robust_fit import fit_robustly
from tracker_node.optimize.robust_start import RobustStartOptions
from tracker_node.optimize.simplex import POLISH, search_simplex

START = state_at(0, 0, 0, 0, 0, 0)
TIP = np.array([0.15, -0.1, 0.08, 0.2, -0.15, 0.1])
AROUND = RobustStartOptions(0.3, 0.5, n=400)
CHANCE = 16  # hypotheses that say what chance scores


@pytest.fixture(autouse=True)
def strict(monkeypatch):
    """The narrow pit scores less than half of what chance does."""
    monkeypatch.setattr(robust_fit, "_TRUSTED_SHARE", 0.2)


def two_pits(x):
    """A shallow, narrow pit where one starts, and the deep, wide one of the body 200 mm away."""
    narrow, wide = (np.array([width] * 3 + [2 * width] * 3) for width in (0.05, 0.3))
    shallow, deep = np.linalg.norm((x - 0.01) / narrow), np.linalg.norm((x - TIP) / wide)
    return min(1.0, 0.5 + 0.5 * float(shallow), float(deep))


def test_the_body_is_found_behind_a_nearer_likeness():
    objective = AnalyticScore(two_pits)
    alone = search_simplex(objective, START, RIGID, POLISH)
    assert alone.score == pytest.approx(0.5, abs=5e-3)
    found = fit_robustly(objective, START, lambda state: search_simplex(objective, state, RIGID, POLISH), AROUND)
    assert found.trusted and found.score < 1e-2 and found.score == found.best.score
    np.testing.assert_allclose(to_variables(found.state), TIP, atol=1e-3)
    assert found.fits > 1 and found.evaluations > alone.evaluations + AROUND.n


@dataclass
class Stays:
    """A fit that ends where it starts."""

    state: State
    evaluations: int = 1


def test_a_trusted_fit_is_the_only_one():
    objective = AnalyticScore(two_pits)
    found = fit_robustly(objective, from_variables(TIP), Stays, AROUND)
    assert (found.trusted, found.fits) == (True, 1)
    assert found.evaluations == 1 + CHANCE == len(objective.asked)


def test_the_best_is_kept_though_none_is_trusted(monkeypatch):
    """Four refits after each of three searches, twice as many hypotheses each time, every score counted."""
    monkeypatch.setattr(robust_fit, "_TRUSTED_SHARE", -1.0)
    objective, starts = AnalyticScore(two_pits), []

    def fit(state):
        starts.append(state)
        return Stays(state)

    found = fit_robustly(objective, START, fit, AROUND)
    assert not found.trusted and found.fits == len(starts) == 1 + 3 * 4
    assert found.score == min(objective.function(to_variables(state)) for state in starts)
    assert found.evaluations == len(starts) + CHANCE + (3 * 400 + 1) + (3 * 800 + 1) + (3 * 1600 + 1)
    assert len(objective.asked) == len(starts) + CHANCE + (3 * 400 + 1) + (3 * 800 + 1) + (3 * 1600 + 1)
    assert len({state.T_world_root.tobytes() for state in starts}) == len(starts)


@pytest.mark.parametrize("brightness", [0.01, 1.0, 100.0])
def test_trust_knows_no_scale(brightness, monkeypatch):
    """Scores of a dim picture, or of a body that is not quite the one seen, are judged by what chance gives there."""
    objective = AnalyticScore(lambda x: brightness * two_pits(x))
    assert fit_robustly(objective, from_variables(TIP), Stays, AROUND).trusted
    monkeypatch.setattr(robust_fit, "_TRUSTED_SHARE", 0.5)
    monkeypatch.setattr(robust_fit, "_SEARCHES", 0)
    assert not fit_robustly(objective, START, Stays).trusted


def test_nothing_to_score_leaves_the_first_fit():
    found = fit_robustly(AnalyticScore(lambda x: math.inf), START, Stays, AROUND)
    assert (found.trusted, found.fits, found.score) == (False, 1, math.inf)
    assert found.state is START
