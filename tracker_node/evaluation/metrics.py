"""Metrics of joint errors over time: pure functions of arrays; those of poses are in `pose_metrics`.

Arrays over time have the image set first: positions (n, m, 3) in meters, masks (n, m). A mask says where a value counts;
where it is False the value is arbitrary. Means over nothing are not-a-number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LOST_JOINT_M = 0.200  # an image set is lost when any joint is farther off than this
LOST_LIMB_M = 0.150  # a limb is lost when its end joint is farther off than this ...
LOST_LIMB_SETS = 5  # ... for so many sets running, or at the end


def joint_errors(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Distances between positions.

    Parameters
    ----------
    estimate, truth : (n, m, 3) meters.

    Returns
    -------
    (n, m) meters.
    """
    return np.linalg.norm(estimate - truth, axis=-1)


def mean_error(errors: np.ndarray, valid: np.ndarray) -> float:
    """Mean over every valid joint of every set: the MPJPE.

    Parameters
    ----------
    errors : (n, m).
    valid : (n, m).

    Returns
    -------
    In the unit of ``errors``.
    """
    return float(errors[valid].mean()) if valid.any() else float("nan")


def offset_free_errors(
    difference: np.ndarray, valid: np.ndarray, rotations: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Errors that remain when every landmark's constant offset is taken out.

    Parameters
    ----------
    difference : (n, m, 3) estimate minus truth, meters, world frame.
    valid : (n, m).
    rotations : (n, m, 3, 3) R_world_segment of the segment that each landmark's offset is constant in; None for the world
        frame.

    Returns
    -------
    errors (n, m) in meters; offsets (m, 3) in meters in the frame used: the mean of the valid differences, which is the
    constant that leaves the smallest sum of squares.
    """
    if rotations is not None:
        difference = np.einsum("nmji,nmj->nmi", rotations, difference)
    count = np.maximum(valid.sum(axis=0), 1)[:, None]
    offsets = np.where(valid[..., None], difference, 0.0).sum(axis=0) / count
    return np.linalg.norm(difference - offsets, axis=-1), offsets


def lost_sets(has_estimate: np.ndarray, said_lost: np.ndarray, errors: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Sets without an estimate, with status LOST, or with a joint more than `LOST_JOINT_M` from truth.

    Parameters
    ----------
    has_estimate, said_lost : (n,).
    errors : (n, m) meters.
    valid : (n, m).

    Returns
    -------
    (n,) bool.
    """
    off = ((errors > LOST_JOINT_M) & valid).any(axis=1)
    return ~has_estimate | said_lost | off


def lost_limbs(errors: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Limbs that were lost.

    Lost: more than `LOST_LIMB_M` off in `LOST_LIMB_SETS` consecutive sets, or in the last set that can be judged. A set that
    cannot be judged neither begins nor breaks a series.

    Parameters
    ----------
    errors : (n, k) of the limbs' end joints, meters.
    valid : (n, k).

    Returns
    -------
    (k,) bool.
    """
    lost = np.zeros(errors.shape[1], dtype=bool)
    for k in range(errors.shape[1]):
        off = errors[valid[:, k], k] > LOST_LIMB_M
        lost[k] = any(run.n_sets >= LOST_LIMB_SETS for run in intervals(off)) or bool(len(off) and off[-1])
    return lost


def intersection_over_union(a: np.ndarray, b: np.ndarray) -> float:
    """Agreement of two masks.

    Parameters
    ----------
    a, b : of one shape, non-zero inside.

    Returns
    -------
    0 to 1; NaN when both are empty.
    """
    if a.shape != b.shape:
        raise ValueError(f"expected masks of one shape, got {a.shape} and {b.shape}")
    a, b = a != 0, b != 0
    union = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / union if union else float("nan")


SPREAD_TITLES = ("mean", "rms", "p95", "max")


@dataclass(frozen=True)
class Spread:
    """Of the sizes of ``n`` errors, in their own unit; NaN where ``n`` is 0."""

    mean: float
    rms: float
    p95: float
    max: float
    n: int

    @property
    def row(self) -> tuple[float, float, float, float]:
        """In the order of `SPREAD_TITLES`."""
        return self.mean, self.rms, self.p95, self.max


def spread_of(errors: np.ndarray, valid: np.ndarray | None = None) -> Spread:
    """Spread of the sizes of errors.

    Parameters
    ----------
    errors : with or without sign; those that are not finite do not count.
    valid : of the same shape; others do not count.

    Returns
    -------
    In the unit of the errors.
    """
    sizes = np.abs(np.asarray(errors, dtype=np.float64))
    sizes = sizes[np.isfinite(sizes) if valid is None else valid & np.isfinite(sizes)]
    if not len(sizes):
        return Spread(*4 * (float("nan"),), 0)
    p95, top = np.percentile(sizes, [95, 100])
    return Spread(float(sizes.mean()), float(np.sqrt(np.mean(sizes**2))), float(p95), float(top), len(sizes))


@dataclass(frozen=True)
class Interval:
    """Image sets ``first`` to ``last``, both included; ``ended``: another set follows that can be judged."""

    first: int
    last: int
    ended: bool

    @property
    def n_sets(self) -> int:
        return self.last - self.first + 1


def intervals(flags: np.ndarray, known: np.ndarray | None = None) -> tuple[Interval, ...]:
    """The longest series of sets in which something holds.

    Parameters
    ----------
    flags : (n,) bool.
    known : (n,) bool; a set that is not known neither begins nor ends a series, and is not its last one.

    Returns
    -------
    In order of time.
    """
    rows = np.arange(len(flags)) if known is None else np.flatnonzero(known)
    on = np.asarray(flags, dtype=bool)[rows]
    series = np.ma.flatnotmasked_contiguous(np.ma.array(on, mask=~on))
    return tuple(Interval(int(rows[s.start]), int(rows[s.stop - 1]), s.stop < len(rows)) for s in series)


def times_with_gaps(times_s: np.ndarray, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of sets, with the first and the last missing one in every gap of more than 1.5 periods.

    Parameters
    ----------
    times_s : (n,) of the sets, increasing.
    period_s : of the images.

    Returns
    -------
    times : (k,).
    sets : (k,) the set at each; -1 for one that is missing.
    """
    steps = np.diff(times_s)
    after = times_s[:-1][steps > 1.5 * period_s] + period_s
    before = times_s[1:][steps > 2.5 * period_s] - period_s
    times = np.concatenate([times_s, after, before])
    sets = np.concatenate([np.arange(len(times_s)), np.full(len(after) + len(before), -1)])
    order = np.argsort(times, kind="stable")
    return times[order], sets[order]


def reacquisition_times(flags: np.ndarray, times_s: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """Times from the first lost set to the first tracked one after it, for every loss that has ended.

    Parameters
    ----------
    flags : (n,) bool, lost.
    times_s : (n,) of the sets.
    known : (n,) bool; see `intervals`.

    Returns
    -------
    (k,) seconds.
    """
    rows = np.arange(len(flags)) if known is None else np.flatnonzero(known)
    ended = [interval for interval in intervals(flags, known) if interval.ended]
    after = [rows[np.searchsorted(rows, interval.last) + 1] for interval in ended]
    return np.array([times_s[b] - times_s[a.first] for a, b in zip(ended, after, strict=True)])
