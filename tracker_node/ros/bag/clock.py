"""The time of a bag that is played."""

from __future__ import annotations

import threading
import time

from ...errors import TrackerError

MIN_RATE, MAX_RATE = 0.001, 1000.0


class BagTime:
    """Runs at a rate, and can be paused from another thread."""

    def __init__(self, rate: float = 1.0, paused: bool = False):
        if not MIN_RATE <= rate <= MAX_RATE:
            raise TrackerError(f"rate: expected a positive number from {MIN_RATE} to {MAX_RATE:g}, got {rate}")
        self._rate, self._paused = rate, paused
        self._condition = threading.Condition()
        self._bag_ns, self._wall_s, self._tick_s = 0, time.monotonic(), 0.0

    @property
    def paused(self) -> bool:
        return self._paused

    def begin(self, bag_ns: int) -> None:
        """It is ``bag_ns`` now."""
        with self._condition:
            self._bag_ns, self._wall_s = bag_ns, time.monotonic()
            self._tick_s = 0.0

    def now_ns(self) -> int:
        """The bag's time now."""
        with self._condition:
            return self._now_ns()

    def _now_ns(self) -> int:
        return self._bag_ns if self._paused else self._bag_ns + round((time.monotonic() - self._wall_s) * self._rate * 1e9)

    def pause(self, paused: bool) -> None:
        """Stop, or go on from where it stopped."""
        with self._condition:
            self._bag_ns, self._wall_s = self._now_ns(), time.monotonic()
            self._paused = paused
            self._condition.notify_all()

    def set_rate(self, rate: float) -> None:
        """Go on from here at another speed."""
        with self._condition:
            self._bag_ns, self._wall_s = self._now_ns(), time.monotonic()
            self._rate = rate
            self._condition.notify_all()

    def wake(self) -> None:
        """End every `sleep`."""
        with self._condition:
            self._condition.notify_all()

    def tick_is_due(self, period_s: float) -> bool:
        """True once every ``period_s`` of wall time."""
        now = time.monotonic()
        if now < self._tick_s:
            return False
        self._tick_s = now + period_s
        return True

    def sleep(self, until_ns: int, at_most_s: float) -> None:
        """Wait for a time of the bag.

        Parameters
        ----------
        until_ns : time of the bag, nanoseconds.
        at_most_s : seconds of wall time, after which the wait ends in any case.
        """
        with self._condition:
            left_s = at_most_s if self._paused else (until_ns - self._now_ns()) * 1e-9 / self._rate
            if left_s > 0.0:
                self._condition.wait(min(left_s, at_most_s))
