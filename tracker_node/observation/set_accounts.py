"""Counts of time steps without an image set, by reason."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

_REMEMBERED = 256  # time steps that images may be late for


class SetAccounts:
    """Counts time steps of which some camera has sent an image and that got no set, each once.

    Parameters
    ----------
    tolerance_ns : images at most so far after the first belong to one time step.
    reasons : for which a time step may go without a set.
    """

    def __init__(self, tolerance_ns: int, reasons: Sequence[str]):
        self._tolerance_ns = tolerance_ns
        self._counts = dict.fromkeys(reasons, 0)
        self._failed: tuple[int, str] | None = None  # first stamp of the latest time step without a set so far, and why
        self._decided: deque[int] = deque(maxlen=_REMEMBERED)  # first stamps of time steps that have a set or are counted

    @property
    def counts(self) -> dict[str, int]:
        """Time steps without a set by reason."""
        counts = dict(self._counts)
        if self._failed is not None:
            counts[self._failed[1]] += 1
        return counts

    def formed(self, start_ns: int) -> None:
        """A set whose earliest image has this stamp."""
        if self._failed is not None and abs(start_ns - self._failed[0]) <= self._tolerance_ns:
            self._failed = None  # its time step has a set after all, of other images
        self._settle()
        self._decided.append(start_ns)

    def failed(self, stamp_ns: int, reason: str) -> None:
        """An image goes without a set: of a new time step, or of that of the image before.

        Parameters
        ----------
        stamp_ns : of the image.
        reason : one of those given at first.
        """
        if self._failed is None or abs(stamp_ns - self._failed[0]) > self._tolerance_ns:
            self._settle()
            self._failed = stamp_ns, reason

    def late(self, stamp_ns: int) -> None:
        """An image came when a later set was out: there may never have been one of its time step."""
        known = [*self._decided, *([self._failed[0]] if self._failed else [])]
        if all(abs(stamp_ns - other_ns) > self._tolerance_ns for other_ns in known):
            self._decided.append(stamp_ns)
            self._counts["late"] += 1

    def forget(self) -> None:
        """Time begins anew; the counts stay."""
        self._settle()
        self._decided.clear()

    def _settle(self) -> None:
        if self._failed is not None:
            self._decided.append(self._failed[0])
            self._counts[self._failed[1]] += 1
            self._failed = None
