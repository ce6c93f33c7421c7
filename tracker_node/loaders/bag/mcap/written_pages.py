"""Memory of what has been written to a file is given back once it is on the disk."""

from __future__ import annotations

import os
import queue
import threading
from contextlib import suppress

KEPT_BYTES = 64 * 2**20
"""At the end of the file, that stay in memory."""
_AGAIN_BYTES = 512 * 2**20  # before, looked at again: what was not on the disk yet the last time


class WrittenPages:
    """Has the operating system forget the beginning of a growing file.

    A recording is not read again soon, yet the system keeps all of it as long as there is memory, and takes fresh memory for
    every page. On a virtual machine writing then took 1.4 s of processor time a gigabyte, five times as much as in memory that is
    used again (its host had to find it first, it seems); and what other programs had read is not pushed out.

    The system begins to write what is not on the disk. That may wait for the disk, so it is done in a thread; where it is not
    possible, memory stays as it is.
    """

    def __init__(self, descriptor: int):
        self._descriptor = descriptor
        self._sizes: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def grown(self, size: int) -> None:
        """The file has so many bytes now; returns at once."""
        if size <= KEPT_BYTES or not hasattr(os, "posix_fadvise"):
            return
        if self._thread is None:
            try:
                descriptor = os.dup(self._descriptor)  # the file may be closed while the thread is at it
            except OSError:
                return
            self._thread = threading.Thread(target=_forget, args=(descriptor, self._sizes), name="forget pages", daemon=True)
            self._thread.start()
        self._sizes.put(size)

    def close(self) -> None:
        """Nothing more is to be forgotten; does not wait."""
        if self._thread is not None:
            self._sizes.put(None)


def _forget(descriptor: int, sizes: queue.SimpleQueue[int | None]) -> None:
    done = 0
    while (size := sizes.get()) is not None:
        start, done = max(0, done - _AGAIN_BYTES), size - KEPT_BYTES
        with suppress(OSError):
            os.posix_fadvise(descriptor, start, done - start, os.POSIX_FADV_DONTNEED)
    os.close(descriptor)
