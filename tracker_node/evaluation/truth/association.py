"""Truth at the times of the image sets: interpolation in time, with one constant lag.

The lag is counted in images and is positive where the truth is early: row ``i`` of the truth shows what image ``i + lag``
shows. It is one number for a whole run; nothing else is fitted to the truth here.
"""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np

from ...loaders.motion.trajectory_file import Trajectories
from ..metrics import mean_error, offset_free_errors

LAG_RANGE_IMAGES = (-2.0, 2.0)
LAG_STEP_IMAGES = 0.01
FEW_SETS = 30  # too few to tell a lag from


class OnAClock(Protocol):
    """What has stamps that can be moved."""

    @property
    def stamps_ns(self) -> np.ndarray: ...

    def shifted(self, shift_ns: int) -> Self: ...


def image_period_ns(stamps_ns: np.ndarray) -> float:
    """Time from one image set to the next: the median, which missing sets do not disturb. Needs two sets."""
    if len(stamps_ns) < 2:
        raise ValueError(f"expected at least two stamps, got {len(stamps_ns)}")
    return float(np.median(np.diff(stamps_ns)))


def truth_at(truth: Trajectories, stamps_ns: np.ndarray, lag_images: float, period_ns: float) -> Trajectories:
    """Truth for every image set, the lag taken out.

    Parameters
    ----------
    truth : joints over time.
    stamps_ns : (k,) of the sets.
    lag_images : of the images behind the truth.
    period_ns : of the images.

    Returns
    -------
    With the stamps of the sets.
    """
    return Trajectories(truth.names, stamps_ns, *truth.at(stamps_ns, lag_images * period_ns))


def estimate_lag(estimate: Trajectories, truth: Trajectories, period_ns: float, rotations: np.ndarray | None = None) -> float:
    """The constant lag that makes the mean offset-free joint error smallest.

    Constant offsets are left out of the search: while a body moves one way, an offset along its path looks like a lag.
    Searched over `LAG_RANGE_IMAGES` on the sets that have truth at both ends of the range, so that every lag is judged on
    the same sets.

    Parameters
    ----------
    estimate : tracked joints over time.
    truth : the same joints.
    period_ns : of the images.
    rotations : as of `metrics.offset_free_errors`.

    Returns
    -------
    Images; 0 when no set has truth at both ends.
    """
    ends = [truth_at(truth, estimate.stamps_ns, lag, period_ns).valid for lag in LAG_RANGE_IMAGES]
    judged = estimate.valid & ends[0] & ends[1]
    low, high = LAG_RANGE_IMAGES
    lags = np.linspace(low, high, round((high - low) / LAG_STEP_IMAGES) + 1)
    costs = np.full(len(lags), np.inf)
    for i, lag in enumerate(lags):
        moved = truth_at(truth, estimate.stamps_ns, float(lag), period_ns)
        both = judged & moved.valid
        if both.any():
            errors, _ = offset_free_errors(estimate.positions_m - moved.positions_m, both, rotations)
            costs[i] = mean_error(errors, both)
    if not np.isfinite(costs).any():
        return 0.0
    return round(float(lags[int(np.argmin(costs))]), 6)
