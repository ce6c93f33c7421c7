"""Exposure times of images: stamp files, the times in a video's container, and from a camera's own clock to common time.

A camera's own clock may be wrong by an offset, and run fast or slow (drift). Common time is
``own + offset + drift * (own - own stamp of its first image)``; the drift counts from the first image, since stamps may be
times of day, of which a millionth part is half an hour.

Videos of a variable frame rate, such as phones make, have the times of their containers as stamps.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from ...camera.rig import Camera
from ...errors import FileFormatError, SourceError
from ..csv_file import CsvCells, CsvTable
from ..source_address import last_number

FILE_STAMPS = ("rate", "container")
"""Where a file's stamps may come from, besides a stamp file: its image rate, or the times of its images in the container."""

_CAMERA = ("camera", "cam", "cam_id", "camera_id", "port")
_NUMBER = ("image", "image_index", "frame", "frame_index", "frame_id", "frame_number", "index")
_TIME = ("time", "timestamp", "stamp", "frame_time", "t", "seconds")
_UNITS_NS = {"": 10**9, "_s": 10**9, "_ms": 10**6, "_us": 10**3, "_ns": 1}
_TIME_COLUMNS = {f"{name}{suffix}": scale for name in _TIME for suffix, scale in _UNITS_NS.items()}
MOST_NS = 2**31 * 10**9 - 1  # of a stamp, either way: seconds of a ROS time have 32 bits
_LONGEST_SPAN_S = 3.2e9
_LONGEST_PERIOD_S = 100.0  # between images; more is a wrong unit


def common_ns(own_ns: int, first_ns: int, offset_ns: int = 0, drift_ppm: float = 0.0) -> int:
    """Common time of an image.

    Parameters
    ----------
    own_ns, first_ns : stamps of the image and of its camera's first image, on the camera's clock.
    offset_ns, drift_ppm : common time minus the camera's at its first image; by how much it advances more, in millionths.

    Returns
    -------
    Nanoseconds.
    """
    return own_ns + offset_ns + round(1e-6 * drift_ppm * (own_ns - first_ns))


def file_times(camera: Camera, n_images: int) -> tuple[int, ...] | None:
    """Stamps of the images of a camera's file, on the camera's clock.

    Parameters
    ----------
    camera, n_images : of the rig; number of images in its file.

    Returns
    -------
    (n_images,) ns; None where they follow from the file's image rate.

    Raises
    ------
    FileFormatError : a stamp file that cannot be used.
    SourceError : a stamp file with not as many times as images, or a kind of stamps that files do not have.
    """
    if camera.stamp_file is not None:
        times = load_stamp_file(camera.stamp_file, camera.name)
        if len(times) != n_images:
            problem = f"has {len(times)} times for camera '{camera.name}', but {camera.source} has {n_images} images"
            raise SourceError(camera.stamp_file, problem)
        return times
    if camera.stamps in (None, "rate"):
        return None
    if camera.stamps not in FILE_STAMPS:
        problem = f"the rig asks for {camera.stamps} stamps; files have {' or '.join(FILE_STAMPS)}, or a stamp_file"
        raise SourceError(f"{camera.name}: {camera.source}", problem)
    times = presentation_times(str(camera.source))
    missing = range(1, n_images - len(times) + 1)  # announced, but the file has been cut off
    return (*times, *(times[-1] + i * period_ns(times) for i in missing))


def period_ns(times: Sequence[int]) -> int:
    """Median time between two images; 0 of fewer than two."""
    return int(np.median(np.diff(np.array(times, dtype=np.int64)))) if len(times) > 1 else 0


def stamps_of_times_ns(path: str | Path, times_s: np.ndarray) -> np.ndarray:
    """Stamps from a file's times, which may begin anywhere; their differences are exact to a nanosecond.

    Parameters
    ----------
    path, times_s : file, for messages; (n,) increasing seconds.

    Returns
    -------
    (n,) int64 nanoseconds.

    Raises
    ------
    FileFormatError : times that are not a nanosecond apart, span more than a hundred years or begin as far from 0.
    """
    elapsed = np.asarray(times_s, dtype=np.float64) - times_s[0]
    if not elapsed[-1] < _LONGEST_SPAN_S:
        raise FileFormatError(path, "times", f"a span of less than {_LONGEST_SPAN_S:.0f} s", elapsed[-1])
    if not abs(times_s[0]) < _LONGEST_SPAN_S:
        raise FileFormatError(path, "times", f"a first one within {_LONGEST_SPAN_S:.0f} s of 0", times_s[0])
    stamps = np.round(elapsed * 1e9).astype(np.int64) + round(float(times_s[0]) * 1e9)
    if np.any(np.diff(stamps) <= 0):
        raise FileFormatError(path, "times", "times a nanosecond apart at least", "closer ones")
    return stamps


def field_times(times: Sequence[int]) -> tuple[int, ...]:
    """Stamps of both fields of interlaced images; the second is exposed half a period after the first."""
    half_ns = period_ns(times) // 2
    return tuple(time for first in times for time in (first, first + half_ns))


def presentation_times(path: str | Path) -> tuple[int, ...]:
    """When each image of a video file is to be shown, ns, in the order of showing, as its container says; nothing is decoded.

    Raises
    ------
    SourceError : not a video file, or one in which two images have the same time.
    """
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])  # packets as they are
    try:
        times = []
        while capture.grab():
            times.append(round(1e6 * capture.get(cv2.CAP_PROP_POS_MSEC)))
    finally:
        capture.release()
    if not times:
        raise SourceError(path, "its container has no times of images (stamps: container is for video files)")
    times.sort()  # packets come in the order of decoding
    if any(b <= a for a, b in itertools.pairwise(times)):
        raise SourceError(path, "its container gives the same time to two images")
    return tuple(times)


def load_stamp_file(path: str | Path, camera: str) -> tuple[int, ...]:
    """Stamps of a camera's images from a file, in the order of the images.

    A CSV file with a column of times (``time``, ``timestamp``, ``stamp`` or ``frame_time``, in seconds, or with the unit behind,
    ``time_ns``), and optionally one of cameras (``camera``, ``cam_id``, ``port``; their names, or the numbers that these end
    with) and one of image numbers (``image``, ``frame``); or a text file of one number of seconds a line. Other columns
    (Caliscope's ``sync_index``) are not read. Without image numbers the lines of a camera are its images in order of time.

    Parameters
    ----------
    path, camera : file; name.

    Returns
    -------
    (n,) ns.

    Raises
    ------
    FileFormatError : naming line and column: no such column, no line of the camera, a time that is no number, or times that do
        not increase with the image.
    """
    table = CsvTable(path)
    names = [name.strip().lower() for name in table.header]
    if len(names) == 1 and _decimal(names[0]) is not None:
        return _increasing(path, [(1, table.header[0].strip()), *((row.line, row.text[0]) for row in table.rows())], 10**9)
    column = _time_column(path, names)
    scale = _TIME_COLUMNS[names[column]]
    rows = list(table.rows())
    by_camera = [i for i, name in enumerate(names) if name in _CAMERA]
    if by_camera:
        rows = _of_camera(path, rows, by_camera[0], camera)
    numbers = [i for i, name in enumerate(names) if name in _NUMBER]
    if numbers:
        rows.sort(key=lambda row: row.integer(numbers[0]))
        _check_numbers(rows, numbers[0])
    elif all(_decimal(row.text[column]) is not None for row in rows):
        rows.sort(key=lambda row: Decimal(row.text[column]))
    return _increasing(path, [(row.line, row.text[column]) for row in rows], scale)


def _time_column(path: str | Path, names: Sequence[str]) -> int:
    found = [i for i, name in enumerate(names) if name in _TIME_COLUMNS]
    if len(found) != 1:
        expected = f"one column of times ({', '.join(_TIME)}, with _ns, _us or _ms behind)"
        raise FileFormatError(path, "header", expected, names)
    return found[0]


def _of_camera(path: str | Path, rows: list[CsvCells], column: int, camera: str) -> list[CsvCells]:
    found = sorted({row.text[column].strip() for row in rows})
    number = re.search(r"[0-9]$", camera)
    named = [name for name in found if name == camera]
    numbered = [name for name in found if number and re.search(r"[0-9]$", name) and last_number(name) == last_number(camera)]
    if not named and len(numbered) != 1:
        raise FileFormatError(path, rows[0].header[column] if rows else "(file)", f"camera '{camera}', or its number", found)
    return [row for row in rows if row.text[column].strip() == (named or numbered)[0]]


def _check_numbers(rows: Sequence[CsvCells], column: int) -> None:
    """Every image has one line; numbers may begin at 0 or at 1."""
    first = rows[0].integer(column) if rows else 0
    for i, row in enumerate(rows):
        if first not in (0, 1) or row.integer(column) != first + i:
            expected = f"one line for every image from 0 or 1 on, here {first + i if first in (0, 1) else 0}"
            raise FileFormatError(row.path, f"line {row.line}, column '{row.header[column]}'", expected, row.text[column])


def _increasing(path: str | Path, cells: Sequence[tuple[int, str]], scale: int) -> tuple[int, ...]:
    times: list[int] = []
    for line, text in cells:
        value = _decimal(text)
        if value is None:
            raise FileFormatError(path, f"line {line}", "a time", text)
        if not abs(value) <= MOST_NS // scale:
            most = f"of at most {MOST_NS // scale}, what a ROS time can hold"
            raise FileFormatError(path, f"line {line}", f"a time in its column's unit (seconds, if it names none), {most}", text)
        time = int((value * scale).to_integral_value())
        if times and time <= times[-1]:
            raise FileFormatError(path, f"line {line}", f"a time after that of the image before ({1e-9 * times[-1]:.6f} s)", text)
        times.append(time)
    if not times:
        raise FileFormatError(path, "(file)", "a line for each image", "none")
    if period_ns(times) > _LONGEST_PERIOD_S * 1e9:
        got = f"{1e-9 * period_ns(times):g} s between two images"
        raise FileFormatError(path, "(file)", "times in seconds, or the unit in the column's name (time_ns)", got)
    return tuple(times)


def _decimal(text: str) -> Decimal | None:
    try:
        value = Decimal(text.strip())
    except InvalidOperation:
        return None
    return value if value.is_finite() else None


_VARIES = 0.1  # of the period that an image is off its place in even times
_ROUNDED_NS = 1_500_000  # containers round to milliseconds
_KEPT = 64  # files whose times are kept in memory


def varying_times(path: str, n_images: int) -> tuple[int, ...] | None:
    """Times of a video's images that are not evenly apart.

    Nothing is decoded, but the whole file is read once: some tenths of a second for each gigabyte that is in the memory already.

    Parameters
    ----------
    path : video file.
    n_images : that the file announces; times of those that are missing follow at the usual distance.

    Returns
    -------
    (n,) ns, the first at 0; None where they are even, or where the file has none.
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
