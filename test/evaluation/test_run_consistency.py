"""NEES of a run: 1 where errors are as large as covariances say."""

import numpy as np
import pytest

from tracker_node.evaluation import consistency as module
from tracker_node.evaluation.consistency import NeesSeries


def series(values, bounds=((0.5, 1.5), (0.5, 1.5))):
    values = np.array(values, dtype=float)
    names = tuple("ab"[: values.shape[1]])
    return NeesSeries(names, 3, values, np.array(bounds[: values.shape[1]]))


def test_means_are_of_what_is_known():
    found = series([[1.0, np.nan], [2.0, 4.0], [6.0, np.nan]])
    assert found.means.tolist() == [3.0, 4.0]
    assert np.isnan(series([[np.nan, 1.0]]).means).tolist() == [True, False]


def test_bounds_are_within_reach():
    assert series([[0.5, 1.5]]).in_bounds.tolist() == [True, True]
    assert series([[0.49, 1.51]]).in_bounds.tolist() == [False, False]


def test_bounds_of_a_single_set_are_those_of_chi_square():
    # Chi-square of three degrees of freedom: 2.5 % below 0.2158, 2.5 % above 9.3484.
    assert series([[1.0]]).set_bounds == pytest.approx((0.2158 / 3, 9.3484 / 3), abs=1e-4)


def made(errors, covariances, valid=None):
    errors, covariances = np.array(errors, dtype=float), np.array(covariances, dtype=float)
    valid = np.ones(errors.shape[:2], bool) if valid is None else np.array(valid)
    return module._series(("a", "b")[: errors.shape[1]], errors, covariances, valid)


def test_a_value_is_the_mean_of_the_whitened_squares():
    found = made([[[2.0, 3.0]]], [[np.diag([4.0, 1.0])]])
    assert found.values == pytest.approx(np.array([[5.0]])) and found.n_numbers == 2  # (1 + 9) / 2
    # e' P^-1 e of correlated errors: P^-1 of [[2, 1], [1, 2]] is [[2, -1], [-1, 2]] / 3.
    found = made([[[1.0, 1.0]], [[1.0, -1.0]]], [[[[2.0, 1.0], [1.0, 2.0]]]] * 2)
    assert found.values[:, 0] == pytest.approx([1 / 3, 1.0])


def test_without_truth_or_an_inverse_nothing_is_known():
    good, flat, gone = np.eye(2), np.diag([1.0, 0.0]), np.full((2, 2), np.nan)
    errors = np.ones((5, 1, 2))
    found = made(errors, [[good], [flat], [gone], [good], [-good]], [[True], [True], [True], [False], [True]])
    assert np.isfinite(found.values[:, 0]).tolist() == [True, False, False, False, False]
    assert found.names == ("a",)
    assert made(errors[:1], [[flat]]) is None and made(errors[:1], [[good]], [[False]]) is None
    assert made(errors[:1], [[np.zeros((2, 2))]]) is None


def test_nearly_singular_covariances_count_above_a_share_of_the_largest():
    assert made([[[1.0, 0.0]]], [[np.diag([1.0, 1e-11])]]) is not None
    assert made([[[1.0, 0.0]]], [[np.diag([1.0, 1e-13])]]) is None
    assert made([[[1.0, 0.0]]], [[np.diag([1e6, 1e-5])]]) is not None


def test_bounds_are_closer_for_more_independent_sets():
    rng = np.random.default_rng(2)
    errors = rng.normal(size=(400, 2, 3))
    errors[:, 1] = errors[0, 1]  # one error that stays
    valid = np.ones((400, 2), bool)
    found = made(errors, np.broadcast_to(np.eye(3), (400, 2, 3, 3)), valid)
    (low, high), (low_of_one, high_of_one) = found.bounds
    assert 0.8 < low < 1.0 < high < 1.2 and found.in_bounds[0]
    assert low_of_one < 0.4 and high_of_one > 2.0
    valid[:, 1] = False
    found = made(errors, np.broadcast_to(np.eye(3), (400, 2, 3, 3)), valid)
    assert np.isnan(found.bounds[1]).all() and np.isfinite(found.bounds[0]).all()


def test_errors_of_nothing_count_as_independent():
    found = made(np.zeros((100, 1, 3)), np.broadcast_to(np.eye(3), (100, 1, 3, 3)))
    low, high = found.bounds[0]
    # Chi-square of 300: 95 % within 253.9 and 349.9.
    assert (low, high) == pytest.approx((253.9 / 300, 349.9 / 300), abs=1e-3)
