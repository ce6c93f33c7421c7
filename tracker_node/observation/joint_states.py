"""What a robot says of its joints, at the times at which images are taken."""

from __future__ import annotations

import math
import threading
from bisect import bisect_left, insort
from collections.abc import Collection, Iterable

import numpy as np

_NEAR_NS = 100_000_000  # readings further apart than this, or from the time asked for, say nothing of what is between
_STEP_NS = 5_000_000  # between two readings that a velocity is taken from
_BEFORE = 100  # readings before a gap that a velocity is taken from
_Reading = tuple[int, float]


class JointStates:
    """Positions of joints over time, each joint by itself: a gripper may say its own at a rate of its own.

    Readings may be added from any thread, in any order.

    Parameters
    ----------
    most : how many readings of a joint are kept, the newest; None: all. One with a stamp far ahead does not push others out.
    endless : names of joints that turn without end, whose readings may begin anew after a turn.
    """

    def __init__(self, most: int | None = None, endless: Collection[str] = ()):
        self._most, self._endless = most, frozenset(endless)
        self._lock = threading.Condition()
        self._readings: dict[str, list[_Reading]] = {}
        self._newest_ns: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of all joints that something has been said of."""
        with self._lock:
            return tuple(self._readings)

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """Stamps of the first and the last reading of any joint; None where there is none."""
        with self._lock:
            ends = [(readings[0][0], readings[-1][0]) for readings in self._readings.values() if readings]
        return (min(first for first, _ in ends), max(last for _, last in ends)) if ends else None

    def positions(self, name: str) -> np.ndarray:
        """(n,) all readings of a joint, radians or meters."""
        with self._lock:
            return np.array([position for _, position in self._readings.get(name, ())])

    def add(self, stamp_ns: int, positions: Iterable[tuple[str, float]]) -> None:
        """Take in a reading.

        Parameters
        ----------
        stamp_ns : when it was so.
        positions : (name, radians or meters) of some joints.
        """
        with self._lock:
            for name, position in positions:
                readings = self._readings.setdefault(name, [])
                insort(readings, (stamp_ns, float(position)))
                if self._most is not None:
                    del readings[: -self._most]
            self._newest_ns = stamp_ns if self._newest_ns is None else max(stamp_ns, self._newest_ns)
            self._lock.notify_all()

    def clear(self) -> None:
        """Forget all, as where stamps go back."""
        with self._lock:
            self._readings.clear()
            self._newest_ns = None

    def wait_beyond(self, stamp_ns: int, timeout_s: float) -> bool:
        """Wait for a reading at or after a time.

        Parameters
        ----------
        stamp_ns, timeout_s : the time; how long to wait at most.

        Returns
        -------
        Whether there is one.
        """
        with self._lock:
            return self._lock.wait_for(lambda: self._newest_ns is not None and self._newest_ns >= stamp_ns, timeout_s)

    def at(self, stamp_ns: int) -> dict[str, float]:
        """Positions at a time: between two readings on the line through them, just beyond one that none follows for long, as fast
        as before it.

        Parameters
        ----------
        stamp_ns : the time.

        Returns
        -------
        By name; without the joints of which no reading is near.
        """
        with self._lock:
            found = ((name, _position(readings, stamp_ns, name in self._endless)) for name, readings in self._readings.items())
            return {name: position for name, position in found if position is not None}


def _position(readings: list[_Reading], stamp_ns: int, endless: bool) -> float | None:
    after = bisect_left(readings, (stamp_ns,))
    if after == len(readings):
        return _beyond(readings, stamp_ns, endless)
    (last_ns, last), before = readings[after], after - 1
    if last_ns == stamp_ns:
        return last
    if before < 0:
        return last if last_ns - stamp_ns <= _STEP_NS else None
    first_ns, first = readings[before]
    if last_ns - first_ns > _NEAR_NS:
        return _beyond(readings[max(0, after - _BEFORE) : after], stamp_ns, endless)
    return first + _moved(first, last, endless) * (stamp_ns - first_ns) / (last_ns - first_ns)


def _beyond(readings: list[_Reading], stamp_ns: int, endless: bool) -> float | None:
    if not readings or stamp_ns - readings[-1][0] > _NEAR_NS:
        return None
    last_ns, last = readings[-1]
    before = bisect_left(readings, (last_ns - _STEP_NS + 1,)) - 1
    if before < 0 or last_ns - readings[before][0] > _NEAR_NS:
        return last
    first_ns, first = readings[before]
    return last + _moved(first, last, endless) * (stamp_ns - last_ns) / (last_ns - first_ns)


def _moved(first: float, last: float, endless: bool) -> float:
    return math.remainder(last - first, math.tau) if endless else last - first
