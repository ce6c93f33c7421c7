"""NEES against draws whose covariance and correlation are known."""

import numpy as np
import pytest
from scipy.stats import chi2

from benchmark.trust._consistency import consistency, nees
from tracker_node.evaluation.consistency import effective_sets, mean_bounds, whitened

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


def test_errors_that_wander_from_axis_to_axis_are_not_independent():
    """Each set's errors are those before it, turned: no axis is like itself from set to set, and yet they all last."""
    rng, memory, n_runs = np.random.default_rng(4), 0.9, 600
    turn = np.linalg.qr(rng.normal(size=(N, N)))[0] @ np.roll(np.eye(N), 1, axis=0)
    white = rng.normal(size=(n_runs, 30, N))
    for t in range(1, 30):
        white[:, t] = memory * white[:, t - 1] @ turn.T + np.sqrt(1.0 - memory**2) * white[:, t]
    effective = effective_sets(white[:300])
    lags = np.abs(np.subtract.outer(np.arange(30), np.arange(30)))
    assert effective == pytest.approx(30**2 / (memory ** (2 * lags)).sum(), rel=0.1)
    found = consistency(white[300:], np.broadcast_to(np.eye(N), (300, 30, N, N)), effective)
    assert 0.92 < found.runs_in_bounds < 0.98


def test_errors_that_are_alike_in_every_set_do_not_widen_the_bounds():
    """One axis has nine times the variance, the others none: misfit of one set is not memory."""
    white = np.random.default_rng(5).normal(size=(200, 30, N)) * np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert effective_sets(white) > 25.0


@pytest.mark.parametrize("memory, least, most", [(0.0, 15.0, 60.0), (0.9, 2.0, 7.0)])
def test_of_one_run_fewer_sets_count_than_are_independent(memory, least, most):
    found = [effective_sets(drawn(np.random.default_rng(seed), 1, 60, memory)[2]) for seed in range(20)]
    assert least < np.median(found) < most


def test_both_bounds_are_bounds():
    errors, covariances, _ = drawn(np.random.default_rng(3), 60, 30, 0.0)
    for factor in (0.5, 2.0):  # too sure, too cautious
        assert consistency(errors, factor * covariances, 30.0).runs_in_bounds == 0.0


def test_bounds_of_one_set_are_those_of_chi_square():
    np.testing.assert_allclose(mean_bounds(5, 1.0), chi2.ppf([0.025, 0.975], 5))
    low, high = mean_bounds(5, 1e6)
    assert 4.98 < low < 5.0 < high < 5.02
