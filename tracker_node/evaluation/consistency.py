"""Whether errors are as large as covariances say: the normalized estimation error squared (NEES).

For an error e of n numbers with covariance P, NEES = e^T P^-1 e has the mean n. Averages of it have bounds on both sides: above
them a tracker is too sure of itself, below them it asks for more caution than there is need for (Bar-Shalom, Li & Kirubarajan,
Estimation with Applications to Tracking and Navigation, 2001, sec. 5.4).

The errors of neighboring image sets are not independent: an error that lasts is not 30 errors. The average over a run of T sets
then varies more than that of T draws. With white errors w = L^-1 e (P = L L^T) that are Gaussian and stationary, with
correlation R(k) = E[w_t w_(t+k)^T], (n, n), its variance is

    2 / T^2 * sum over s, t of ||R(s - t)||^2

(Isserlis; the norm is Frobenius'), which is 2 n / T_eff with T_eff <= T. All of R counts: what lasts in a direction across the
axes of L shows beside its diagonal. Bounds of a run are those of a chi-square variable with n T_eff degrees of freedom, divided
by T_eff. Benchmarks measure T_eff on other runs than those judged; a report, which has one run, on that run itself.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

CONFIDENCE = 0.95


def nees(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """(...) of errors (..., n) with covariances (..., n, n)."""
    return (whitened(errors, covariances) ** 2).sum(axis=-1)


def whitened(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """(..., n) L^-1 e with P = L L^T: unit covariance, where P is right."""
    return np.linalg.solve(np.linalg.cholesky(covariances), errors[..., None])[..., 0]


def effective_sets(white: np.ndarray) -> float:
    """T_eff of runs (n_runs, T, n) of white errors: as many independent sets would average as well as T of these do.

    Correlations are about zero, not about the mean of a run: an error that stays the same throughout a run counts as one. They
    are taken as shares of those of one set: errors that are too large, or alike, in every set do not make the bounds wider.
    Of a single run only the axes' own are taken, and chance makes T_eff smaller than it is, the bounds wider.
    """
    n_sets = white.shape[1]
    powers = np.array([_correlation_power(white, lag) for lag in range(n_sets)])
    pairs = 2.0 * np.arange(n_sets, 0, -1)  # of sets so far apart
    pairs[0] = n_sets
    return float(np.clip(n_sets**2 * powers[0] / (pairs @ powers), 1.0, n_sets))


def _correlation_power(white: np.ndarray, lag: int) -> float:
    """||R(lag)||^2, without what chance adds to the square of an estimate: products of different runs."""
    n_runs, n_sets = white.shape[:2]
    earlier, later = white[:, : n_sets - lag], white[:, lag:]
    if n_runs == 1:
        return float((((earlier * later).mean(axis=(0, 1)) / (white**2).mean(axis=(0, 1))) ** 2).sum())
    R = np.swapaxes(earlier, 1, 2) @ later / (n_sets - lag)
    return float(((R.sum(axis=0) ** 2).sum() - (R**2).sum()) / (n_runs * (n_runs - 1)))


def mean_bounds(n: int, n_sets: float) -> tuple[float, float]:
    """Within which the mean of ``n_sets`` independent NEES of ``n`` numbers lies in `CONFIDENCE` of all cases."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = chi2.ppf([tail, 1.0 - tail], n * n_sets) / n_sets
    return float(low), float(high)
