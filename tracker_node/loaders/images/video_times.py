"""Videos of a variable frame rate, such as phones make: told from their containers' times, which are then the stamps."""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

from ...errors import SourceError
from .stamps import period_ns, presentation_times

_VARIES = 0.1  # of the period that an image is off its place in even times
_ROUNDED_NS = 1_500_000  # containers round to milliseconds
_KEPT = 64  # files whose times are kept in memory


def varying_times(path: str, n_images: int) -> tuple[int, ...] | None:
    """Times of the images of a video in ns, the first at 0; None where they are even, or where the file has none.

    Nothing is decoded, but the whole file is read once: some tenths of a second for each gigabyte that is in the memory already.

    Parameters
    ----------
    n_images : that the file announces; times of those that are missing follow at the usual distance.
    """
    status = os.stat(path)
    times = _varying(path, status.st_mtime_ns, status.st_size)
    if times is None or len(times) >= n_images:
        return times
    period = period_ns(times)
    return (*times, *(times[-1] + i * period for i in range(1, n_images - len(times) + 1)))


def describe(times: tuple[int, ...]) -> str:
    """The sentence for a video of a variable frame rate."""
    steps_ms = 1e-6 * np.diff(np.array(times, dtype=np.int64))
    return (
        f"variable frame rate: its images are {steps_ms.min():.1f} to {steps_ms.max():.1f} ms apart; their stamps are the times"
        " of the container (stamps: rate would make them even)"
    )


@lru_cache(maxsize=_KEPT)
def _varying(path: str, _changed_ns: int, _size: int) -> tuple[int, ...] | None:
    try:
        times = np.array(presentation_times(path), dtype=np.int64)
    except SourceError:  # no times, or the same for several images
        return None
    if len(times) < 3:
        return None
    times -= times[0]
    numbers = np.arange(len(times), dtype=np.float64)
    slope, offset = np.polyfit(numbers, times.astype(np.float64), 1)
    off_ns = np.abs(times - (slope * numbers + offset)).max()
    if off_ns <= max(_VARIES * slope, _ROUNDED_NS):
        return None
    return tuple(int(time) for time in times)
