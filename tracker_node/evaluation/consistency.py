"""Consistency of errors with covariances: the normalized estimation error squared (NEES), in general and of a run.

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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..runs.data import RunData
from .evaluate import Evaluation

CONFIDENCE = 0.95


def whitened(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Errors in units of their covariance: L^-1 e with P = L L^T.

    Parameters
    ----------
    errors : (..., n).
    covariances : (..., n, n) of them.

    Returns
    -------
    (..., n), of unit covariance where P is right.
    """
    return np.linalg.solve(np.linalg.cholesky(covariances), errors[..., None])[..., 0]


def effective_sets(white: np.ndarray) -> float:
    """T_eff of runs: as many independent sets would average as well as the T sets of these do.

    Correlations are about zero, not about the mean of a run: an error that stays the same throughout a run counts as one. They
    are divided by those of one set: errors that are too large, or alike, in every set do not make the bounds wider.
    Of a single run only the axes' own are taken, and chance makes T_eff smaller than it is, the bounds wider.

    Parameters
    ----------
    white : (n_runs, T, n) of `whitened`.

    Returns
    -------
    From 1 to T.
    """
    n_runs, n_sets = white.shape[:2]
    powers = _own_powers(white[0]) if n_runs == 1 else np.array([_power(white, lag) for lag in range(n_sets)])
    pairs = 2.0 * np.arange(n_sets, 0, -1)  # of sets so far apart
    pairs[0] = n_sets
    return float(np.clip(n_sets**2 * powers[0] / (pairs @ powers), 1.0, n_sets))


def _own_powers(white: np.ndarray) -> np.ndarray:
    """(T,) ||R(lag)||^2 of each axis of one run (T, n) alone, in that of lag 0; as products of spectra."""
    n_sets = len(white)
    spectrum = np.fft.rfft(white, 2 * n_sets, axis=0)
    products = np.fft.irfft(spectrum * spectrum.conj(), 2 * n_sets, axis=0)[:n_sets]
    correlations = products / np.arange(n_sets, 0, -1)[:, None]
    return np.sum((correlations / correlations[0]) ** 2, axis=1)


def _power(white: np.ndarray, lag: int) -> float:
    """||R(lag)||^2, without what chance adds to the square of an estimate: products of different runs."""
    n_runs, n_sets = white.shape[:2]
    earlier, later = white[:, : n_sets - lag], white[:, lag:]
    R = np.swapaxes(earlier, 1, 2) @ later / (n_sets - lag)
    return float(((R.sum(axis=0) ** 2).sum() - (R**2).sum()) / (n_runs * (n_runs - 1)))


def mean_bounds(n: int, n_sets: float) -> tuple[float, float]:
    """Bounds of a mean NEES in `CONFIDENCE` of all cases.

    Parameters
    ----------
    n : numbers of each error.
    n_sets : how many independent NEES the mean is of.

    Returns
    -------
    low, high.
    """
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = 2.0 * gammaincinv(0.5 * n * n_sets, [tail, 1.0 - tail]) / n_sets  # of chi squared
    return float(low), float(high)


_SMALLEST = 1e-12  # fraction of the largest eigenvalue: below it a covariance has no inverse


@dataclass(frozen=True, eq=False)
class NeesSeries:
    """NEES over n, (n, m) of m things with ``n_numbers`` numbers each: 1 is right; NaN where there is no truth or covariance.

    ``bounds`` (m, 2): within which each mean lies in 95 % of all cases, for as many independent sets as the run's errors come to.
    """

    names: tuple[str, ...]
    n_numbers: int
    values: np.ndarray
    bounds: np.ndarray

    @property
    def means(self) -> np.ndarray:
        """(m,)."""
        known = np.isfinite(self.values)
        total = np.where(known, self.values, 0.0).sum(axis=0)
        return np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)

    @property
    def in_bounds(self) -> np.ndarray:
        """(m,)."""
        return (self.means >= self.bounds[:, 0]) & (self.means <= self.bounds[:, 1])

    @property
    def set_bounds(self) -> tuple[float, float]:
        """Of a single image set."""
        low, high = mean_bounds(self.n_numbers, 1.0)
        return low / self.n_numbers, high / self.n_numbers


def landmark_sds(run: RunData, model: ArticulatedModel) -> np.ndarray | None:
    """What the tracker says of how well it knows each landmark.

    Parameters
    ----------
    run : with covariances, or without.
    model : body of the run.

    Returns
    -------
    (n, n_landmarks) standard deviations in meters, over three directions; 0 where nothing is said; None without covariances.
    """
    if run.details is None or not run.details.covariances.any():
        return None
    found = np.zeros((len(run), len(model.landmarks)))
    for i in np.flatnonzero(run.has_state):
        J = run.configuration(model, int(i)).landmark_jacobian()
        variances = np.einsum("mka,ab,mkb->m", J, run.details.covariances[i].astype(np.float64), J)
        found[i] = np.sqrt(np.maximum(variances, 0.0) / 3.0)
    return found


def landmark_nees(run: RunData, model: ArticulatedModel, joints: Evaluation, offset_free: bool) -> NeesSeries | None:
    """NEES of every joint's position.

    Parameters
    ----------
    run : with covariances, or without.
    model : body of the run.
    joints : the run compared with true joints.
    offset_free : take the constant offset of each joint out.

    Returns
    -------
    One column a joint; None for a run without covariances.
    """
    if run.details is None:
        return None
    columns = [model.landmark_index(joint) for joint in joints.joints]
    errors = (joints.corrected_m if offset_free else joints.estimate_m) - joints.truth_m
    covariances = np.zeros((*errors.shape, 3))
    for i in np.flatnonzero(run.has_state):
        J = run.configuration(model, int(i)).landmark_jacobian()[columns]
        covariances[i] = J @ run.details.covariances[i].astype(np.float64) @ np.swapaxes(J, 1, 2)
    return _series(joints.joints, errors, covariances, joints.raw.valid)


def state_nees(run: RunData, truth: Sequence[State | None]) -> NeesSeries | None:
    """NEES of the whole state.

    Parameters
    ----------
    run : with covariances, or without.
    truth : (n,) the true state of each image set of the run, or None.

    Returns
    -------
    One column; None for a run without covariances, or where no covariance has an inverse.
    """
    if run.details is None:
        return None
    valid = np.array([state is not None for state in truth])
    errors = np.zeros(run.values.shape)
    for i, true in enumerate(truth):
        if true is not None:
            errors[i] = true.difference(State.from_values(run.values[i]))
    covariances = run.details.covariances.astype(np.float64)
    return _series(("state",), errors[:, None], covariances[:, None], valid[:, None])


def _series(names: tuple[str, ...], errors: np.ndarray, covariances: np.ndarray, valid: np.ndarray) -> NeesSeries | None:
    """Of errors (n, m, k) with covariances (n, m, k, k) where ``valid`` (n, m); None where no covariance has an inverse."""
    k = errors.shape[-1]
    finite = np.isfinite(covariances).all(axis=(-2, -1))
    covariances = np.where(finite[..., None, None], covariances, 0.0)
    eigenvalues = np.linalg.eigvalsh(covariances)
    known = valid & (eigenvalues[..., 0] > _SMALLEST * np.maximum(eigenvalues[..., -1], np.finfo(float).tiny))
    if not known.any():
        return None
    white = np.full(errors.shape, np.nan)
    white[known] = whitened(errors[known], covariances[known])
    bounds = np.full((len(names), 2), np.nan)
    for j in range(len(names)):
        series = white[known[:, j], j]
        if len(series):
            independent = effective_sets(series[None]) if np.any(series, axis=0).all() else float(len(series))
            bounds[j] = np.array(mean_bounds(k, independent)) / k
    return NeesSeries(names, k, (white**2).mean(axis=-1), bounds)
