"""Whether many runs of one clip err as their covariances say, each with as many independent sets as other runs tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracker_node.evaluation.consistency import mean_bounds, whitened


@dataclass(frozen=True, eq=False)
class Consistency:
    """NEES (n_runs, T) of ``n`` numbers, judged with ``effective_sets`` independent sets a run."""

    nees: np.ndarray
    n: int
    effective_sets: float

    @property
    def mean(self) -> float:
        """Over all, divided by n: 1 where covariances are right."""
        return float(self.nees.mean()) / self.n

    @property
    def runs_in_bounds(self) -> float:
        """Fraction of the runs whose mean lies within its bounds, both of them."""
        return _share_within(self.nees.mean(axis=1), mean_bounds(self.n, self.effective_sets))

    @property
    def runs_in_independent_bounds(self) -> float:
        """The same as if the errors of all sets were independent: bounds that are too narrow."""
        return _share_within(self.nees.mean(axis=1), mean_bounds(self.n, self.nees.shape[1]))

    @property
    def sets_in_bounds(self) -> float:
        """Fraction of the instants at which the mean over the runs, which are independent, lies within its bounds."""
        return _share_within(self.nees.mean(axis=0), mean_bounds(self.n, self.nees.shape[0]))


def _share_within(values: np.ndarray, bounds: tuple[float, float]) -> float:
    return float(((values >= bounds[0]) & (values <= bounds[1])).mean())


def nees(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Normalized errors squared (...): n on average where the covariances (..., n, n) of the errors (..., n) are right."""
    return (whitened(errors, covariances) ** 2).sum(axis=-1)


def consistency(errors: np.ndarray, covariances: np.ndarray, effective: float) -> Consistency:
    """Of errors (n_runs, T, n) with covariances (n_runs, T, n, n); ``effective``: `effective_sets` of other runs."""
    return Consistency(nees(errors, covariances), errors.shape[-1], effective)
