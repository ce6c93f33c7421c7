"""Memory of large messages, and of what stays for ever."""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
_LARGEST = 32 * 2**20  # bytes; glibc takes no more
_KEPT = 256 * 2**20


def keep_freed_memory() -> None:
    """Let this process keep the memory of messages for the next ones; nothing where the C library is not glibc.

    By default glibc gives the memory of an image back to the system and fetches it anew for the next one, a page at a time:
    six cameras' raw images are some 6000 page faults a second.
    """
    with suppress(OSError, AttributeError):
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_MMAP_THRESHOLD, _LARGEST)
        libc.mallopt(_M_TRIM_THRESHOLD, _KEPT)


@contextmanager
def kept_for_ever() -> Iterator[None]:
    """What is made meanwhile, and all that is there, is no garbage, and is never searched for any: for imports.

    They make hundreds of thousands of objects: to search them is a seventh of the time of a start, and later as much as
    an image set may take.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        if enabled:
            gc.enable()


def keep_for_ever() -> None:
    """All that is there is kept, and never searched for garbage again: a collection later is as short as can be.

    No other thread runs while garbage is collected, and so no image is received.
    """
    gc.collect()
    gc.freeze()
