"""Sums of objectives and priors, term by term."""

import numpy as np
import pytest

from tracker_node.model.configuration import State
from tracker_node.objective.constraints.prior import Prior, SumObjective
from tracker_node.objective.normal_equations import NormalEquations

STATE = State(np.eye(4), np.zeros(1))


class Fixed:
    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.H, self.g, self.cost, self.count = rng.normal(size=(7, 7)), rng.normal(size=7), float(rng.uniform()), 10**seed
        self.asked = []

    def linearize(self, state):
        self.asked.append(state)
        return NormalEquations(self.H.copy(), self.g.copy(), self.cost, self.count)


PARTS = [Fixed(0), Fixed(1), Fixed(2)]


@pytest.mark.parametrize("factors", [None, (2.0, 3.0, 0.5)])
def test_each_counts_with_its_factor(factors):
    found, f = SumObjective(PARTS, factors).linearize(STATE), factors or (1.0, 1.0, 1.0)
    for name in ("H", "g", "cost"):
        np.testing.assert_allclose(getattr(found, name), sum(w * getattr(p, name) for w, p in zip(f, PARTS, strict=True)))
    assert found.count == 111  # residuals are not weighed
    assert all(part.asked[-1] is STATE for part in PARTS)


def test_one_alone_with_its_factor():
    found = SumObjective(PARTS[:1], (4.0,)).linearize(STATE)
    np.testing.assert_allclose(found.H, 4.0 * PARTS[0].H)
    np.testing.assert_allclose(found.g, 4.0 * PARTS[0].g)
    assert found.cost == pytest.approx(4.0 * PARTS[0].cost)


def test_priors_are_added_as_they_are():
    away = State(np.eye(4), np.array([0.5]))
    priors = [Prior(away, np.full(7, 8.0)), Prior(away, np.full(7, 2.0))]
    alone, found = (
        SumObjective(PARTS[:2], (2.0, 3.0)).linearize(STATE),
        SumObjective(PARTS[:2], (2.0, 3.0), priors).linearize(STATE),
    )
    assert found.cost - alone.cost == pytest.approx(10.0 * 0.25)
    np.testing.assert_allclose(found.H - alone.H, 10.0 * np.eye(7), atol=1e-12)
    np.testing.assert_allclose(found.g - alone.g, [0.0] * 6 + [-5.0], atol=1e-12)
    assert found.count == alone.count == 11


def test_every_objective_has_a_factor():
    with pytest.raises(ValueError):
        SumObjective(PARTS, (1.0, 2.0)).linearize(STATE)
