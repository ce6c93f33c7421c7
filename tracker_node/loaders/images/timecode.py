"""Timecode of videos: when their first image was exposed, as the camera has written it into the file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from ...errors import FileFormatError, extra_module

DAY_S = 86400.0
_LABEL = re.compile(r"(\d\d):(\d\d):(\d\d)([:;.])(\d\d+)")
_DROP = ";."  # before the number of the frame, where numbers are left out so that labels keep to the time of day


@dataclass(frozen=True)
class Timecode:
    """Timecode of a file's first image.

    Attributes
    ----------
    label : as the file has it, ``hh:mm:ss:ff``, or ``hh:mm:ss;ff`` where numbers are dropped.
    rate_hz : images a second.
    """

    label: str
    rate_hz: float

    @property
    def seconds(self) -> float:
        """Since the timecode was zero: images counted since then, at their rate (SMPTE ST 12-1 for what is dropped)."""
        found = _LABEL.fullmatch(self.label)
        assert found is not None
        hours, minutes, seconds, frame = (int(found[i]) for i in (1, 2, 3, 5))
        whole, passed = round(self.rate_hz), 60 * hours + minutes
        frames = (60 * passed + seconds) * whole + frame
        if found[4] in _DROP:
            frames -= round(whole / 15.0) * (passed - passed // 10)
        return frames / self.rate_hz


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
    return Timecode(label, float(rate))
