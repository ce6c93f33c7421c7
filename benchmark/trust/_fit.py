"""Thresholds and scales of trust, from clips that are not those judged: what `limb_status` and `StatusConfig` hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from benchmark.trust._consistency import nees
from benchmark.trust._runs import Run

_SOUND = 0.53  # of what is lost, a limb whose end is nearer than this is sound; between that and lost nothing is learned
_RIDGE = 2e-3
_HIDING = ("occluded", "exit", "hidden")


def coefficients(runs: Sequence[Run]) -> np.ndarray:
    """(1 + n_measures,) of the logistic regression of lost limbs on their measures; both kinds weigh the same."""
    rows, lost = [], []
    for run in runs:
        hiding = run.on[:, None] & (run.kind in _HIDING)
        known = np.isfinite(run.shares).all(axis=-1)
        gone, sound = run.tip_errors > run.lost_tip_m, (run.tip_errors < _SOUND * run.lost_tip_m) & ~hiding
        keep = known & (gone | sound)
        rows.append(run.shares[keep])
        lost.append(gone[keep])
    X, y = np.concatenate(rows), np.concatenate(lost).astype(float)
    X = np.column_stack([np.ones(len(X)), X])
    weight = np.where(y > 0.0, 0.5 / y.sum(), 0.5 / (1.0 - y).sum())

    def cost(b: np.ndarray) -> float:
        z = X @ b
        return float((weight * (np.logaddexp(0.0, z) - y * z)).sum() + _RIDGE * (b[1:] ** 2).sum())

    bounds = [(None, None)] + [(None, 0.0)] * (X.shape[1] - 1)  # the more is found, the less a limb is lost
    return minimize(cost, np.zeros(X.shape[1]), bounds=bounds).x


def covariance_factor(runs: Sequence[Run]) -> float:
    """By what the covariances of sound runs would have to be multiplied to be as large as the errors: 1 where they are."""
    return float(np.mean([nees(run.errors, run.covariances).mean() / run.errors.shape[-1] for run in runs]))
