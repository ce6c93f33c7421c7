"""Timecode of videos: when their first image was exposed, as the camera has written it into the file.

SMPTE ST 12-1 counts to 30 a second at most. Above, some cameras give two images or more the same number, others count on; the
track of timecode of MOV and MP4 says which (`tmcd`: QuickTime File Format, "Timecode Sample Description"), other files do not.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from ...errors import FileFormatError, extra_module

DAY_S = 86400.0
_LABEL = re.compile(r"(\d\d):(\d\d):(\d\d)([:;.])(\d\d+)")
_MOST_COUNTED_HZ = 30.0  # by SMPTE ST 12-1
_MOST_BYTES = 64_000_000  # of tables in a file
_DROP = ";."  # before the number of the frame, where numbers are left out so that labels keep to the time of day


@dataclass(frozen=True)
class Timecode:
    """Timecode of a file's first image.

    Attributes
    ----------
    label : as the file has it, ``hh:mm:ss:ff``, or ``hh:mm:ss;ff`` where numbers are dropped.
    rate_hz : images a second.
    counted_hz : numbers a second; None: the file does not say, and above 30 images a second it may be either.
    """

    label: str
    rate_hz: float
    counted_hz: float | None = None

    @property
    def seconds(self) -> float:
        """Since the timecode was zero: what was counted since then, at its rate (SMPTE ST 12-1 for what is dropped)."""
        hours, minutes, seconds, frame = self._numbers
        counted_hz = self.counted_hz or self.rate_hz
        whole, passed = round(counted_hz), 60 * hours + minutes
        frames = (60 * passed + seconds) * whole + frame
        if self.label[8] in _DROP:
            frames -= round(whole / 15.0) * (passed - passed // 10)
        return frames / counted_hz

    @property
    def sigma_s(self) -> float:
        """Standard deviation of that, as the time of the first image: it is exposed at any time within the period of its number.

        Where the file does not say what is counted, the number may stand for twice its time.
        """
        period_s = 1.0 / (self.counted_hz or self.rate_hz)
        if self.counted_hz is None and self.rate_hz > _MOST_COUNTED_HZ and self._numbers[3] < _MOST_COUNTED_HZ:
            period_s += self._numbers[3] * (1.0 / _MOST_COUNTED_HZ - 1.0 / self.rate_hz)
        return period_s / math.sqrt(12.0)

    @property
    def _numbers(self) -> tuple[int, ...]:
        found = _LABEL.fullmatch(self.label)
        assert found is not None
        return tuple(int(found[i]) for i in (1, 2, 3, 5))


def read_timecode(path: str | Path) -> Timecode:
    """The timecode of a video.

    Parameters
    ----------
    path : a video; MOV, MP4, MXF and AVI can hold one.

    Returns
    -------
    That of its first image.

    Raises
    ------
    FileFormatError : no such file, no images, or no timecode.
    MissingExtraError : the extra ``sound``, which reads videos, is not installed.
    """
    av = extra_module("av", "sound")
    if not Path(path).is_file():
        raise FileFormatError(path, "(file)", "a video", "a folder" if Path(path).is_dir() else "no such file")
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise FileFormatError(path, "(content)", "images", "none")
            rate: Fraction | None = container.streams.video[0].average_rate
            places = [container.metadata, *(stream.metadata for stream in container.streams)]
            label = next((place["timecode"] for place in places if "timecode" in place), None)
    except (av.error.FFmpegError, OSError) as error:
        raise FileFormatError(path, "(content)", "a video", str(error)) from None
    if label is None:
        raise FileFormatError(path, "(content)", "a timecode", "none")
    if not _LABEL.fullmatch(label) or not rate:
        raise FileFormatError(path, "timecode", "hh:mm:ss:ff, and a rate of images", f"{label}, {rate or 'none'}")
    return Timecode(label, float(rate), _counted_hz(Path(path)))


def _counted_hz(path: Path) -> float | None:
    """Numbers a second of a track of timecode; None of other files, and where that is damaged."""
    with open(path, "rb") as stream:
        head = stream.read(16)
        while len(head) >= 8:
            size, kind = struct.unpack_from(">I4s", head)
            start, ahead = stream.tell() - len(head), 8
            if size == 1 and len(head) == 16:
                (size,), ahead = struct.unpack_from(">Q", head, 8), 16
            if kind == b"moov":
                stream.seek(start + ahead)
                return _counted_in(stream.read(min(size or _MOST_BYTES, _MOST_BYTES)))
            if size < ahead:
                return None
            stream.seek(start + size)
            head = stream.read(16)
    return None


def _counted_in(moov: bytes) -> float | None:
    """Of the description of samples: size, ``tmcd``, reserved, index, reserved, flags, time scale, duration, numbers a second."""
    found = re.search(rb"stsd.{12}tmcd.{16}(.{9})", moov, re.DOTALL)
    scale, duration, whole = struct.unpack(">IIB", found[1]) if found else (0, 0, 0)
    return scale / duration if duration and whole and round(scale / duration) == whole else None
