"""The quadratic in a box against scipy, and against the conditions that define its minimum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from tracker_node.optimize.levenberg_marquardt import minimize_quadratic


def problem(seed: int, n: int, correlation: float):
    """Least squares |A x - b|^2 with strongly correlated columns, and limits that hold many of the variables."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n + 5, n)) @ (np.eye(n) + correlation * rng.normal(size=(n, n)) / np.sqrt(n))
    A *= np.exp(rng.normal(size=n))  # units
    b = 3.0 * rng.normal(size=n + 5)
    lower, upper = -rng.exponential(size=n), rng.exponential(size=n)
    lower[rng.random(n) < 0.2], upper[rng.random(n) < 0.2] = -np.inf, np.inf
    return A, b, lower, upper


def solve(A, b, lower, upper, patience=10):
    x = np.empty(A.shape[1])
    solutions = minimize_quadratic(A.T @ A, -A.T @ b, lower, upper, x, patience)
    return x, solutions


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 45), st.sampled_from([0.0, 1.0, 5.0]))
def test_it_is_the_minimum(seed, n, correlation):
    """Karush, Kuhn, Tucker: no free variable is pulled anywhere, none at a limit is pulled inside."""
    A, b, lower, upper = problem(seed, n, correlation)
    x, solutions = solve(A, b, lower, upper)
    assert 1 <= solutions <= 50
    assert (x >= lower).all() and (x <= upper).all()
    pull = A.T @ (A @ x - b)
    scale = np.abs(A.T) @ (np.abs(A) @ np.abs(x) + np.abs(b)) * 1e-9
    at_lower, at_upper = x == lower, x == upper
    assert (np.abs(pull) <= scale)[~at_lower & ~at_upper].all()
    assert (pull >= -scale)[at_lower].all()
    assert (pull <= scale)[at_upper].all()


@pytest.mark.parametrize("seed", range(20))
def test_it_is_where_scipy_finds_it(seed):
    A, b, lower, upper = problem(seed, 12, 2.0)
    reference = lsq_linear(A, b, (lower, upper), method="bvls", tol=1e-14)
    x, _ = solve(A, b, lower, upper)
    np.testing.assert_allclose(x, reference.x, atol=1e-7 * max(1.0, np.abs(reference.x).max()))
    held = np.count_nonzero((x == lower) | (x == upper))
    assert held == np.count_nonzero(reference.active_mask)


@pytest.mark.parametrize("seed", range(10))
def test_corrections_one_at_a_time_come_to_the_same(seed):
    A, b, lower, upper = problem(seed, 12, 2.0)
    x, _ = solve(A, b, lower, upper, patience=0)
    all_at_once, _ = solve(A, b, lower, upper)
    np.testing.assert_allclose(x, all_at_once, atol=1e-9)


def test_a_correlated_neighbour_makes_up_for_a_stop():
    """Clipping the free solution would leave the second variable at 3: the stop of the first moves it to 1.9."""
    H, g = np.array([[1.0, 0.9], [0.9, 1.0]]), np.empty(2)
    g[:] = -H @ np.array([-2.0, 3.0])
    x = np.empty(2)
    assert minimize_quadratic(H, g, np.array([-1.0, -np.inf]), np.full(2, np.inf), x) == 2
    np.testing.assert_allclose(x, [-1.0, 3.0 - 0.9], atol=1e-12)


def test_a_variable_without_room_stays():
    x = np.empty(2)
    assert minimize_quadratic(np.eye(2), np.array([-5.0, -1.0]), np.array([0.5, -9.0]), np.array([0.5, 9.0]), x) > 0
    np.testing.assert_allclose(x, [0.5, 1.0])


@pytest.mark.parametrize("H", [np.diag([1.0, -1.0]), np.full((2, 2), np.nan), np.zeros((2, 2))])
def test_no_minimum_is_said(H):
    assert minimize_quadratic(H, np.ones(2), np.full(2, -np.inf), np.full(2, np.inf), np.empty(2)) == -1
