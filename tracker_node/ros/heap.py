"""Memory of large messages."""

from __future__ import annotations

import ctypes
from contextlib import suppress

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
