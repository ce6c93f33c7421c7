"""Truth at the times of the image sets: interpolation in time, with one constant lag.

The lag is counted in images and is positive where the truth is early: row ``i`` of the truth shows what image ``i + lag``
shows. It is one number for a whole run; nothing else is fitted to the truth.

Truth that is far from all that was tracked may be of another unit, other sides, another rate, another world (`doubts_of_truth`).
A run that is lost is far from its truth, too; but no other unit, and no one motion of the whole, brings that near.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol, Self

import numpy as np

from ...geometry import se3, so3
from ...loaders.motion.trajectory_file import Trajectories
from ...model.humans.measures import mirrored_rows
from ..metrics import mean_error, offset_free_errors

_FAR_M = 0.15  # mean error of a person, from which on something else is asked for
_SIZE = 1.5  # times as large as what was tracked, or as small, no body is fitted wrongly
_EXPLAINS = 0.4  # of the error that is left, at most, where it was that
_RATES = (0.25, 0.5, 5.0 / 6.0, 1.2, 2.0, 4.0)  # times its own that truth may have: 25, 30, 50, 60, 120 Hz are taken for others


def doubts_of_truth(estimate: Trajectories, truth: Trajectories, image_0_ns: int, length_scale: float = 1.0) -> list[str]:
    """Why truth may not be what it is taken for.

    Parameters
    ----------
    estimate : joints as they were tracked.
    truth : the same joints on the clock of the run, as they were recorded.
    image_0_ns : stamp of the run's first image.
    length_scale : of the body, 1 of people.

    Returns
    -------
    One sentence; none where truth is near, or nothing else suits better.
    """
    at_sets = truth_at(truth, estimate.stamps_ns, 0.0, 1.0)
    both = estimate.valid & at_sets.valid
    error_m = _mean_error(estimate, at_sets, 1)
    if not _FAR_M * length_scale < error_m < np.inf:
        return []
    size = _size(at_sets, both) / _size(estimate, both)
    if not 1.0 / _SIZE < size < _SIZE:
        return [f"The truth's joints are {float(f'{size:.2g}'):g} times as far from each other as the run's: is its unit right?"]
    least, others = int(both.sum()) // 2, _otherwise(estimate, at_sets, truth, image_0_ns)
    tried = [(_mean_error(estimate, other, least), said) for other, said in others]
    left_m, said = min(tried)
    if left_m > min(_EXPLAINS * error_m, _FAR_M * length_scale):
        return []
    return [f"The truth is {1e3 * error_m:.0f} mm from the run, and {1e3 * left_m:.0f} {said}"]


def _otherwise(
    estimate: Trajectories, at_sets: Trajectories, truth: Trajectories, image_0_ns: int
) -> Iterator[tuple[Trajectories, str]]:
    """The truth as it would be if one thing was otherwise, and what is said then."""
    rows = list(mirrored_rows(truth.names))
    exchanged = Trajectories(at_sets.names, at_sets.stamps_ns, at_sets.positions_m[:, rows], at_sets.valid[:, rows])
    yield exchanged, "with left and right of its names exchanged: are its sides right?"
    for factor in _RATES:
        stamps = image_0_ns + np.round((truth.stamps_ns - image_0_ns) / factor).astype(np.int64)
        faster = Trajectories(truth.names, stamps, truth.positions_m, truth.valid)
        yield truth_at(faster, estimate.stamps_ns, 0.0, 1.0), f"at {factor:.2g} times its rate: is its rate right?"
    both = estimate.valid & at_sets.valid
    T = se3.rigid_fit(at_sets.positions_m[both], estimate.positions_m[both])
    moved = Trajectories(at_sets.names, at_sets.stamps_ns, at_sets.positions_m @ T[:3, :3].T + T[:3, 3], at_sets.valid)
    turn = so3.log(T[:3, :3])
    angle = float(np.linalg.norm(turn))
    axis = ", ".join(f"{x:.1f}" for x in turn / angle + 0.0) if angle > 0.0 else "0, 0, 1"
    turned = f"turned as a whole by {np.degrees(angle):.0f} degrees about ({axis}) and moved by {np.linalg.norm(T[:3, 3]):.2f} m"
    yield moved, f"{turned}: has it the run's world, and its axes (--y-up, --no-y-up)?"


def _mean_error(estimate: Trajectories, truth: Trajectories, least: int) -> float:
    """Meters; infinite where fewer joints than ``least`` have truth."""
    both = estimate.valid & truth.valid
    if both.sum() < max(least, 1):
        return np.inf
    return float(np.linalg.norm(estimate.positions_m - truth.positions_m, axis=2)[both].mean())


def _size(points: Trajectories, use: np.ndarray) -> float:
    """Meters: root mean square of the distances of points from their middle, the median over time."""
    sizes = [np.sqrt(each[rows].var(axis=0).sum()) for each, rows in zip(points.positions_m, use, strict=True) if rows.sum() > 1]
    return float(np.median(sizes)) if sizes else 1.0


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
