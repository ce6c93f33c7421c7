"""NEES against draws whose covariance and correlation are known."""

import numpy as np
import pytest
from scipy.stats import chi2

from tracker_node.evaluation.consistency import consistency, effective_sets, mean_bounds, nees, whitened

N = 6


def drawn(rng, n_runs, n_sets, memory):
    """White errors with autocorrelation memory^k, and with covariances that vary from set to set."""
    white = rng.normal(size=(n_runs, n_sets, N))
    for t in range(1, n_sets):
        white[:, t] = memory * white[:, t - 1] + np.sqrt(1.0 - memory**2) * white[:, t]
    roots = np.tril(rng.normal(size=(n_runs, n_sets, N, N)), -1) + np.eye(N) * rng.uniform(0.5, 2.0, (n_runs, n_sets, N, 1))
    return np.einsum("rtij,rtj->rti", roots, white), roots @ np.swapaxes(roots, -1, -2), white


def test_nees_is_the_quadratic_form():
    errors, covariances, white = drawn(np.random.default_rng(1), 2, 3, 0.0)
    expected = np.einsum("rti,rtij,rtj->rt", errors, np.linalg.inv(covariances), errors)
    np.testing.assert_allclose(nees(errors, covariances), expected, rtol=1e-9)
    np.testing.assert_allclose(whitened(errors, covariances), white, atol=1e-9)


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.95])
def test_bounds_hold_what_they_promise(memory):
    """The variance of a run's mean is that of so many independent sets, whatever lasts from set to set."""
    rng = np.random.default_rng(2)
    effective = effective_sets(drawn(rng, 400, 30, memory)[2])
    lags = np.abs(np.subtract.outer(np.arange(30), np.arange(30)))
    assert effective == pytest.approx(30**2 / (memory ** (2 * lags)).sum(), rel=0.1)
    errors, covariances, _ = drawn(rng, 600, 30, memory)
    found = consistency(errors, covariances, effective)
    assert found.mean == pytest.approx(1.0, abs=0.05)
    assert 0.92 < found.runs_in_bounds < 0.98
    assert found.runs_in_independent_bounds < (0.98 if memory == 0.0 else 0.8)
    assert found.sets_in_bounds > (0.8 if memory == 0.0 else 0.0)


def test_both_bounds_are_bounds():
    errors, covariances, _ = drawn(np.random.default_rng(3), 60, 30, 0.0)
    for factor in (0.5, 2.0):  # too sure, too cautious
        assert consistency(errors, factor * covariances, 30.0).runs_in_bounds == 0.0


def test_bounds_of_one_set_are_those_of_chi_square():
    np.testing.assert_allclose(mean_bounds(5, 1.0), chi2.ppf([0.025, 0.975], 5))
    low, high = mean_bounds(5, 1e6)
    assert 4.98 < low < 5.0 < high < 5.02
