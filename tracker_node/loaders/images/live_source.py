"""Cameras that come and go: images as they come, and the connection made again when it is lost."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...errors import TrackerError
from .live_capture import LiveCapture

FIRST_RETRY_S, LAST_RETRY_S = 0.5, 8.0


@dataclass
class Connection:
    """State of a live source.

    ``problem`` says why there is no connection; empty while there is one, and before the first. ``bayer`` is the pattern of
    mosaics that say it of themselves.
    """

    connected: bool = False
    problem: str = ""
    times: int = 0  # that it has been made
    received: int = 0
    bayer: str | None = None


class LiveSource:
    """Images of one live camera until it is closed.

    Whatever goes wrong, the connection is tried again: after half a second at first, then at intervals that double to eight
    seconds, so that a camera that has been unplugged is back soon and one that is away costs nothing.

    Parameters
    ----------
    open_capture : makes a connection, or raises `TrackerError`.

    Iterating yields (own stamp in ns, pixels or JPEG) and ends after `close`.
    """

    def __init__(self, open_capture: Callable[[], LiveCapture], retry_s: tuple[float, float] = (FIRST_RETRY_S, LAST_RETRY_S)):
        self._open, self._retry_s = open_capture, retry_s
        self._closed = threading.Event()
        self.connection = Connection()

    def close(self) -> None:
        """End the iteration, from any thread; it notices after the image that it waits for, or the time-out of that."""
        self._closed.set()

    def __iter__(self) -> Iterator[tuple[int, np.ndarray | bytes]]:
        wait_s = self._retry_s[0]
        while not self._closed.is_set():
            before = self.connection.received
            try:
                yield from self._one_connection()
            except TrackerError as error:
                self._lost(str(error))
            except Exception as error:  # a decoder's own failure
                self._lost(f"{type(error).__name__}: {error}")
            wait_s = self._retry_s[0] if self.connection.received > before else min(2.0 * wait_s, self._retry_s[1])
            self._closed.wait(wait_s)

    def _one_connection(self) -> Iterator[tuple[int, np.ndarray | bytes]]:
        capture = self._open()
        try:
            while not self._closed.is_set():
                image = capture.read()
                if image is None:
                    self._lost("gives no more images; trying to connect again")
                    return
                if not self.connection.connected:
                    self.connection.connected, self.connection.problem = True, ""
                    self.connection.times += 1
                self.connection.received += 1
                yield image
        finally:
            capture.close()

    def _lost(self, problem: str) -> None:
        self.connection.connected, self.connection.problem = False, problem
