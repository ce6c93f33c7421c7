"""Optimizers by name, and the one that is made of two."""

import numpy as np
import pytest

from helpers.numeric.analytic_scores import AnalyticScore, hinged, state_at
from tracker_node.errors import UnknownNameError
from tracker_node.optimize.registry import OPTIMIZERS, optimizer, stepping_simplex
from tracker_node.optimize.simplex import polish, search_simplex
from tracker_node.optimize.stepping import DECIMATED_LOOPS, SteppingOptions, step_downhill

CHAIN = hinged((-1.0, 1.0))
START = state_at(0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)


def bowl() -> AnalyticScore:
    target = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2])
    return AnalyticScore(lambda x: float(np.abs(x - target).sum()))


def test_names():
    assert optimizer("stepping") is step_downhill
    assert optimizer("simplex") is search_simplex
    assert optimizer("stepping_simplex") is stepping_simplex
    with pytest.raises(UnknownNameError) as caught:
        optimizer("annealing")
    for name in ("annealing", *OPTIMIZERS):
        assert name in str(caught.value)


def test_two_in_a_row_are_counted_together():
    score = bowl()
    both = stepping_simplex(score, START, CHAIN, active=(0, 6))
    first = step_downhill(bowl(), START, CHAIN, SteppingOptions(DECIMATED_LOOPS), (0, 6))
    second = polish(bowl(), first.state, CHAIN, active=(0, 6))
    assert both.evaluations == len(score.asked) == first.evaluations + second.evaluations
    np.testing.assert_allclose(both.evaluations_per_variable, first.evaluations_per_variable + second.evaluations_per_variable)
    np.testing.assert_array_equal(both.variables, second.variables)
    assert both.score == second.score
    np.testing.assert_array_equal(both.variables[1:6], np.zeros(5))  # what is not active stays
