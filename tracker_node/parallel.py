"""A few threads that share the cameras of one image set, and how they share the interpreter with those that read images."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any

SWITCH_S = 0.0005  # how long another thread may keep one waiting that needs the interpreter for a moment; 5 ms by default


@contextmanager
def short_switches() -> Iterator[None]:
    """While the thread that tracks gets the interpreter soon when others, which decode images or take in messages, have it."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def serial(function: Callable, items: list) -> list:
    """Map a function over cameras on the calling thread.

    Parameters
    ----------
    function, items : what is called, and with what.

    Returns
    -------
    What it returns, in order.
    """
    return [function(item) for item in items]


class Workers:
    """Maps a function over cameras on ``threads`` threads, the calling one among them.

    Each thread takes every n-th item, so that there is one hand-over per thread and call, not one per item. The order of the
    results is that of the items, whatever the number of threads.
    """

    def __init__(self, threads: int):
        self.threads = threads
        self._executor = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def map(self, function: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
        """``[function(item) for item in items]``.

        Parameters
        ----------
        function : of one item; called from several threads at once.
        items : one for each camera.

        Returns
        -------
        In the order of the items.
        """
        if self._executor is None or len(items) < 2:
            return [function(item) for item in items]
        n = min(self.threads, len(items))
        results: list[Any] = [None] * len(items)

        def work(start: int) -> None:
            for i in range(start, len(items), n):
                results[i] = function(items[i])

        others = [self._executor.submit(work, start) for start in range(1, n)]
        try:
            work(0)
        finally:  # also after an error nobody is at work any more
            wait(others)
        for other in others:
            other.result()
        return results
