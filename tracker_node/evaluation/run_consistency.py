"""Whether the errors of a run are as large as its covariances say, landmark by landmark and for the whole state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..runs.data import RunData
from .consistency import effective_sets, mean_bounds, whitened
from .evaluate import Evaluation

_SMALLEST = 1e-12  # share of the largest eigenvalue: below it a covariance has no inverse


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


def landmark_nees(run: RunData, model: ArticulatedModel, joints: Evaluation, offset_free: bool) -> NeesSeries | None:
    """Of every joint's position, as it is or without its constant offset; None for a run without covariances."""
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
    """Of the whole state, of a run with covariances against a true state for every set of it; None where either has none."""
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
