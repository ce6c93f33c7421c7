"""Series of image sets in which something holds, such as being lost, and how long it takes to end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
    """The longest series of sets in which ``flags`` (n,) holds.

    A set that is not ``known`` (n,) neither begins nor ends a series, and is not its last one.
    """
    rows = np.arange(len(flags)) if known is None else np.flatnonzero(known)
    on = np.concatenate([[False], np.asarray(flags, dtype=bool)[rows], [False]])
    changes = np.flatnonzero(np.diff(on.astype(np.int8)))
    pairs = zip(changes[::2], changes[1::2], strict=True)
    return tuple(Interval(int(rows[a]), int(rows[b - 1]), bool(b < len(rows))) for a, b in pairs)


def instants(times_s: np.ndarray, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Instants of sets, increasing (n,), with the first and the last missing one in every gap of more than 1.5 periods.

    Returns
    -------
    (k,) times, and (k,) the set at each; -1 for one that is missing.
    """
    steps = np.diff(times_s)
    after = times_s[:-1][steps > 1.5 * period_s] + period_s
    before = times_s[1:][steps > 2.5 * period_s] - period_s
    times = np.concatenate([times_s, after, before])
    sets = np.concatenate([np.arange(len(times_s)), np.full(len(after) + len(before), -1)])
    order = np.argsort(times, kind="stable")
    return times[order], sets[order]


def reacquisition_times(flags: np.ndarray, times_s: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """Seconds from the first lost set to the first sound one after it, for every loss that has ended; times (n,) of the sets."""
    rows = np.arange(len(flags)) if known is None else np.flatnonzero(known)
    ended = [interval for interval in intervals(flags, known) if interval.ended]
    after = [rows[np.searchsorted(rows, interval.last) + 1] for interval in ended]
    return np.array([times_s[b] - times_s[a.first] for a, b in zip(ended, after, strict=True)])
