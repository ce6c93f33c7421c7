"""Truth at the times of the image sets: interpolation in time, with one constant lag.

The lag is counted in images and is positive where the truth is early: row ``i`` of the truth shows what image ``i + lag``
shows. It is one number for a whole run; nothing else is fitted to the truth here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from ..metrics import mean_error, offset_free_errors

LAG_RANGE_IMAGES = (-2.0, 2.0)
LAG_STEP_IMAGES = 0.01
FEW_SETS = 30  # too few to tell a lag from


class OnAClock(Protocol):
    """What has stamps that can be moved."""

    @property
    def stamps_ns(self) -> np.ndarray: ...

    def shifted(self, shift_ns: int) -> Self: ...


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Points over time.

    Parameters
    ----------
    names : m names.
    stamps_ns : (n,) integer nanoseconds, increasing.
    positions_m : (n, m, 3) meters, world frame.
    valid : (n, m), False where a point was not seen.
    """

    names: tuple[str, ...]
    stamps_ns: np.ndarray
    positions_m: np.ndarray
    valid: np.ndarray

    def __post_init__(self):
        n, m = len(self.stamps_ns), len(self.names)
        if self.positions_m.shape != (n, m, 3) or self.valid.shape != (n, m):
            raise ValueError(
                f"expected positions ({n}, {m}, 3) and validity ({n}, {m}), got {self.positions_m.shape} and {self.valid.shape}"
            )
        if n > 1 and not np.all(np.diff(self.stamps_ns) > 0):
            raise ValueError("expected increasing stamps")

    def select(self, names: Sequence[str]) -> Trajectories:
        """The named points only, in the given order."""
        columns = [self.names.index(name) for name in names]
        return Trajectories(tuple(names), self.stamps_ns, self.positions_m[:, columns], self.valid[:, columns])

    def at(self, stamps_ns: np.ndarray, earlier_ns: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate linearly. Nothing is extrapolated.

        Parameters
        ----------
        stamps_ns : (k,) integer nanoseconds.
        earlier_ns : is subtracted from them.

        Returns
        -------
        positions : (k, m, 3) meters, zeros where not valid.
        valid : (k, m), False outside the time covered, or next to a point that was not seen.
        """
        before, after, weight, inside = between(self.stamps_ns, stamps_ns, earlier_ns)
        weight = weight[:, None, None]
        positions = (1.0 - weight) * self.positions_m[before] + weight * self.positions_m[after]
        valid = self.valid[before] & self.valid[after] & inside[:, None]
        return np.where(valid[..., None], positions, 0.0), valid

    def shifted(self, shift_ns: int) -> Trajectories:
        """The same points, ``shift_ns`` later."""
        return Trajectories(self.names, self.stamps_ns + shift_ns, self.positions_m, self.valid)


def between(own_ns: np.ndarray, stamps_ns: np.ndarray, earlier_ns: float = 0.0) -> tuple[np.ndarray, ...]:
    """Between which rows some stamps lie.

    Parameters
    ----------
    own_ns : (n,) of the rows, increasing.
    stamps_ns : (k,).
    earlier_ns : is subtracted from ``stamps_ns``.

    Returns
    -------
    before, after : (k,) rows; the same one where it is hit.
    weight : (k,) of the row after.
    inside : (k,) whether the rows cover the stamp.
    """
    query = (stamps_ns - own_ns[0]).astype(np.float64) - earlier_ns
    own = (own_ns - own_ns[0]).astype(np.float64)
    after = np.clip(np.searchsorted(own, query, side="left"), 0, len(own) - 1)
    hit = own[after] == query
    before = np.where(hit, after, np.maximum(after - 1, 0))
    inside = hit | ((query > own[0]) & (query < own[-1]))
    span = np.where(after == before, 1.0, own[after] - own[before])
    return before, after, np.where(hit, 0.0, (query - own[before]) / span), inside


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
