"""Thresholds and scales of trust, from clips that are not those judged: what `tracking.limb_status` and `StatusConfig` hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from _trust_runs import Run
from scipy.optimize import minimize

from tracker_node.evaluation.consistency import nees
from tracker_node.evaluation.metrics import LOST_LIMB_M

_SOUND_M = 0.080  # a limb whose end is nearer than this is sound; between that and lost nothing is learnt
_RIDGE = 2e-3
_HIDING = ("occluded", "exit", "hidden")


def coefficients(runs: Sequence[Run]) -> np.ndarray:
    """(1 + n_measures,) of the logistic regression of lost limbs on their measures; both kinds weigh the same."""
    rows, lost = [], []
    for run in runs:
        hiding = run.on[:, None] & (run.kind in _HIDING)
        known = np.isfinite(run.shares).all(axis=-1)
        gone, sound = run.tip_errors > LOST_LIMB_M, (run.tip_errors < _SOUND_M) & ~hiding
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


def covariance_scale(runs: Sequence[Run], curvature: float) -> float:
    """``status.covariance_scale`` of greatest likelihood, from sound runs that were made with a scale of 1 and no curvature."""

    def cost(log_scale: np.ndarray) -> float:
        total = 0.0
        for run in runs:
            P = np.exp(log_scale[0]) * run.covariances
            joints = np.arange(6, P.shape[-1])
            variance = P[:, joints, joints]
            P[:, joints, joints] += variance * (curvature * variance) / (1.0 + curvature * variance)
            total += float((nees(run.errors, P) + np.linalg.slogdet(P)[1]).mean()) / P.shape[-1]
        return total

    return float(np.exp(minimize(cost, np.zeros(1), method="Nelder-Mead").x[0]))
