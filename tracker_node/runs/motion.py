"""The motion of a body in a run: its states over time, gaps where there are none, at the run's stamps or at a constant rate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy  # imports its modules when they are first used

from ..errors import FileFormatError
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..tracking.estimate import LimbStatus
from ..tracking.limbs.tree import limbs_of
from .data import RunData

LOST = ("gap", "limbs", "keep")
MOST_TIME_STEPS = 5_000_000
ON_GRID = 0.25  # of a period: stamps that lie so near to those of a constant rate are taken for them
_SAME_RATE = 0.01  # by which fraction a rate may differ from the run's own to be taken for it
_GAP = 1.5  # periods between two sets: further apart, one is missing between them


@dataclass(frozen=True, eq=False)
class RunMotion:
    """States at n time steps.

    Parameters
    ----------
    stamps_ns : (n,) int64, increasing.
    values : (n, n_dof) as `model.configuration.State.to_values`; zeros where not valid.
    valid : (n,) bool; False where the body was lost, or no image set was tracked.
    period_ns : from one time step to the next, where one is missing too.
    uniform : True where the stamps are a constant period apart.
    unknown_links : (n, n_links) bool, links of limbs that are lost or not seen while the body is tracked; None: none.
    """

    model: ArticulatedModel
    stamps_ns: np.ndarray
    values: np.ndarray
    valid: np.ndarray
    period_ns: float
    uniform: bool = False
    unknown_links: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def rate_hz(self) -> float:
        return 1e9 / self.period_ns

    @property
    def times_s(self) -> np.ndarray:
        """(n,) seconds since the first time step."""
        return (self.stamps_ns - self.stamps_ns[0]) * 1e-9

    def links_valid(self) -> np.ndarray:
        """(n, n_links) bool."""
        valid = np.repeat(self.valid[:, None], len(self.model.chain.links), axis=1)
        return valid if self.unknown_links is None else valid & ~self.unknown_links

    def landmarks_valid(self) -> np.ndarray:
        """(n, n_landmarks) bool."""
        return self.links_valid()[:, self.model.landmark_links]

    def landmarks_m(self) -> np.ndarray:
        """(n, n_landmarks, 3) in the world; zeros where not valid."""
        points = np.zeros((len(self), len(self.model.landmarks), 3))
        for i in np.flatnonzero(self.valid):
            points[i] = self.configuration(i).landmarks_world
        return points

    def landmarks_or_nan_m(self) -> np.ndarray:
        """(n, n_landmarks, 3) in the world; not-a-number where not valid."""
        return np.where(self.landmarks_valid()[..., None], self.landmarks_m(), np.nan)

    def Ts_world_link(self) -> np.ndarray:
        """(n, n_links, 4, 4); identities where not valid."""
        transforms = np.tile(np.eye(4), (len(self), len(self.model.chain.links), 1, 1))
        for i in np.flatnonzero(self.valid):
            transforms[i] = self.configuration(i).Ts_world_link
        return transforms

    def configuration(self, i: int | np.integer) -> Configuration:
        """The model at time step ``i``."""
        return Configuration(self.model, State.from_values(self.values[i]))


def motion_of_run(run: RunData, model: ArticulatedModel, lost: str = "gap") -> RunMotion:
    """The motion that a run has found.

    Parameters
    ----------
    run : with states.
    model : of the run.
    lost : one of `LOST`. States that are lost leave a gap, or are kept as they stand; with "limbs" single limbs that are lost or
        not seen have gaps, too. Where no state had been found yet there is always a gap.

    Returns
    -------
    motion : at the stamps of the run.

    Raises
    ------
    FileFormatError : no state is left, or limbs are asked for of a run that does not judge them.
    """
    valid = run.has_state if lost == "keep" else run.tracked
    if not valid.any():
        raise FileFormatError(run.path, "(states)", "at least one image set with a state that is not LOST", run.status_text)
    values = np.where(valid[:, None], run.values, 0.0)
    unknown = _unknown_links(run, model) if lost == "limbs" else None
    return RunMotion(model, run.stamps_ns, values, valid, steady_period_ns(run.stamps_ns), unknown_links=unknown)


def _unknown_links(run: RunData, model: ArticulatedModel) -> np.ndarray:
    if run.details is None or not run.details.limbs:
        raise FileFormatError(run.path, "limb_status", "a run whose bag tells of limbs", "none")
    unknown = np.zeros((len(run), len(model.chain.links)), dtype=bool)
    links = {limb.name: limb.links for limb in limbs_of(model)}
    for name, status in zip(run.details.limbs, run.details.limb_status.T, strict=True):
        unknown |= np.isin(status, [int(LimbStatus.LOST), int(LimbStatus.UNSEEN)])[:, None] & links[name]
    return unknown


def steady_period_ns(stamps_ns: np.ndarray) -> float:
    """From one image set to the next; a second where there is only one.

    The slope of the straight line through stamps over image numbers, which are counted by the median of the differences: jitter
    averages out, and neither missing sets nor second ones shortly after another disturb.
    """
    if len(stamps_ns) < 2:
        return 1e9
    differences = np.diff(stamps_ns).astype(np.float64)
    numbers = np.concatenate([[0.0], np.cumsum(np.round(differences / np.median(differences)))])
    return float(np.polyfit(numbers, (stamps_ns - stamps_ns[0]).astype(np.float64), 1)[0])


def at_constant_rate(motion: RunMotion, rate_hz: float | None = None) -> tuple[RunMotion, str]:
    """The motion at time steps a constant period apart, from its first one on, and in words what had to be done for that.

    States are taken as they are where all stamps lie near such time steps (`ON_GRID`), of several near one the nearest; otherwise
    they are interpolated, positions and angles linearly, the root's orientation along the shortest rotation. Nothing is
    interpolated across a gap.

    Parameters
    ----------
    motion : at any stamps.
    rate_hz : default: that of the run.

    Returns
    -------
    motion, text : at a constant rate; for people.

    Raises
    ------
    FileFormatError : more than `MOST_TIME_STEPS`: a rate, or a gap between stamps, that cannot be meant.
    """
    period = motion.period_ns if rate_hz is None else 1e9 / rate_hz
    elapsed = (motion.stamps_ns - motion.stamps_ns[0]).astype(np.float64)
    rows = np.round(elapsed / period).astype(int)
    off = np.abs(elapsed - rows * period)
    as_they_are = abs(period / motion.period_ns - 1.0) < _SAME_RATE and off.max() <= ON_GRID * period
    n = int(rows[-1]) + 1 if as_they_are else int(elapsed[-1] / period * (1.0 + 1e-12)) + 1
    if n > MOST_TIME_STEPS:
        raise FileFormatError("stamps", f"{1e9 / period:.6g} Hz", f"at most {MOST_TIME_STEPS} time steps from first to last", n)
    grid = np.round(np.arange(n) * period)  # nanoseconds, so that a time step of the run is met exactly
    unknown = motion.unknown_links
    if as_they_are:
        taken = _nearest(rows, off)
        values, valid = (_placed(of_state[taken], rows[taken], n) for of_state in (motion.values, motion.valid))
        unknown = None if unknown is None else _placed(unknown[taken], rows[taken], n)
        done = f"states as they are, at {1e9 / period:.6g} Hz; stamps are within {1e-6 * off.max():.2g} ms of that"
        if len(taken) < len(rows):
            done += f"; {len(rows) - len(taken)} left out, each beside a state nearer to the same time step"
    else:
        values, valid = _interpolated(motion, elapsed, grid)
        if unknown is not None:
            after = np.clip(np.searchsorted(elapsed, grid), 0, len(elapsed) - 1)
            unknown = unknown[np.where(elapsed[after] == grid, after, np.maximum(after - 1, 0))] | unknown[after]
        done = f"states interpolated to {1e9 / period:.6g} Hz"
    stamps = motion.stamps_ns[0] + grid.astype(np.int64)
    at_rate = replace(motion, stamps_ns=stamps, values=values, valid=valid, period_ns=period, uniform=True, unknown_links=unknown)
    return at_rate, done


def _nearest(rows: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Indices of those of ``rows`` (n,) that stand there once, or with the least ``off`` (n,) of their equals."""
    by_distance = np.argsort(off, kind="stable")
    return by_distance[np.unique(rows[by_distance], return_index=True)[1]]


def _placed(values: np.ndarray, rows: np.ndarray, n: int) -> np.ndarray:
    """``n`` rows of zeros, but ``values`` in ``rows``."""
    placed = np.zeros((n, *values.shape[1:]), dtype=values.dtype)
    placed[rows] = values
    return placed


def without_gaps(motion: RunMotion) -> RunMotion:
    """For formats that know no gaps: states interpolated across them; before the first state that one, after the last that."""
    times, good = motion.stamps_ns.astype(np.float64), motion.valid
    within = np.clip(times, times[good][0], times[good][-1])
    values = _between(times[good], motion.values[good], within)
    return replace(motion, values=np.where(good[:, None], motion.values, values), valid=np.ones_like(good))


def _interpolated(motion: RunMotion, elapsed: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (k, n_dof) and validity (k,) at ``grid`` (k,), nanoseconds since the first stamp."""
    good = np.flatnonzero(motion.valid)
    times, known = elapsed[good], motion.values[good]
    after = np.clip(np.searchsorted(times, grid), 0, len(times) - 1)
    before = np.where(times[after] == grid, after, np.maximum(after - 1, 0))
    inside = (times[before] <= grid) & (grid <= times[after])
    # Two valid states are neighbors unless the run has a state between them that is not, or none for more than a period
    unbroken = (good[after] - good[before] <= 1) & (times[after] - times[before] <= _GAP * motion.period_ns)
    valid = inside & unbroken
    values = np.zeros((len(grid), known.shape[1]))
    values[valid] = _between(times, known, grid[valid])
    return values, valid


def _between(times: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(k, n_dof) at ``wanted`` (k,), within ``times`` (n,) of ``values`` (n, n_dof)."""
    result = np.array([np.interp(wanted, times, column) for column in values.T]).T.reshape(len(wanted), values.shape[1])
    if len(times) > 1:
        turns = scipy.spatial.transform.Rotation.from_rotvec(values[:, 3:6])
        result[:, 3:6] = scipy.spatial.transform.Slerp(times, turns)(wanted).as_rotvec()
    return result
