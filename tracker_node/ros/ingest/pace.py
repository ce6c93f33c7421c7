"""When recorded images are due."""

from __future__ import annotations

import threading
import time


class Pace:
    """When an instant is due: its distance in stamps from the first, on the steady clock.

    ``epoch_ns`` added to a stamp gives the time of day at which it is due.
    """

    def __init__(self) -> None:
        self._epoch_s: float | None = None
        self.epoch_ns = 0

    def wait(self, stamp_ns: int, stop: threading.Event) -> float:
        """Sleep until it is due; returns by how much that was missed, in seconds."""
        now = time.monotonic()
        if self._epoch_s is None:
            self._epoch_s, self.epoch_ns = now - 1e-9 * stamp_ns, time.time_ns() - stamp_ns
        due = self._epoch_s + 1e-9 * stamp_ns
        if due > now:
            stop.wait(due - now)
        return max(0.0, time.monotonic() - due)
