"""What a series of errors comes to."""

import numpy as np
import pytest

from tracker_node.evaluation.metrics import spread_of


def test_a_spread_is_of_sizes():
    spread = spread_of(np.array([-3.0, 4.0, 0.0, -5.0]))
    assert spread.row == pytest.approx((3.0, np.sqrt(50.0 / 4.0), 4.85, 5.0))
    assert spread.n == 4


def test_the_95th_percentile_is_between_sorted_sizes():
    spread = spread_of(np.arange(101.0)[::-1])
    assert (spread.p95, spread.max, spread.mean) == (95.0, 100.0, 50.0)


def test_what_is_not_valid_or_not_finite_does_not_count():
    errors = np.array([1.0, np.nan, 100.0, -np.inf, 3.0])
    assert spread_of(errors).n == 3
    some = spread_of(errors, np.array([True, True, False, True, True]))
    assert some.row == pytest.approx((2.0, np.sqrt(5.0), 2.9, 3.0))
    assert some.n == 2


@pytest.mark.parametrize("errors", [[], [np.nan]])
def test_of_nothing_nothing_is_known(errors):
    spread = spread_of(np.array(errors))
    assert np.isnan(spread.row).all()
    assert spread.n == 0
