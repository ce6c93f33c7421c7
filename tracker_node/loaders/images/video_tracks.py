"""Sound and timecode of videos, beside their images; and sound files.

Timecode is when the first image was exposed, as the camera has written it into the file. SMPTE ST 12-1 counts to 30 a second at
most. Above, some cameras give two images or more the same number, others count on; the track of timecode of MOV and MP4 says
which (`tmcd`: QuickTime File Format, "Timecode Sample Description"), other files do not.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, extra_module


@dataclass(frozen=True, eq=False)
class SoundTrack:
    """The sound of a file, all channels together.

    Attributes
    ----------
    rate_hz : of the samples.
    after_images_s : of the first sample, seconds after the first image of the same file; 0 in a file without images.
    samples : (n,) float32.
    """

    rate_hz: float
    after_images_s: float
    samples: np.ndarray


def read_sound(path: str | Path, seconds: float = 60.0) -> SoundTrack:
    """The beginning of a sound track. How it stands to the images of its file is taken as the file says.

    Parameters
    ----------
    path, seconds : a video or a sound file; how much of it is read.

    Returns
    -------
    The sound.

    Raises
    ------
    FileFormatError : no such file, or none with sound.
    MissingExtraError : the extra ``sound`` is not installed.
    """
    av = extra_module("av", "sound")
    if not Path(path).is_file():
        raise FileFormatError(path, "(file)", "a video or a sound file", "a folder" if Path(path).is_dir() else "no such file")
    try:
        with av.open(str(path)) as container:
            if not container.streams.audio:
                raise FileFormatError(path, "(content)", "a sound track", "none")
            stream = container.streams.audio[0]
            images_s = _start_s(container.streams.video[0]) if container.streams.video else None
            first_s, parts, n = None, [], 0
            for frame in container.decode(stream):
                first_s = float(frame.pts * frame.time_base) if first_s is None and frame.pts is not None else first_s
                values = frame.to_ndarray()
                loudest = np.iinfo(values.dtype).max if np.issubdtype(values.dtype, np.integer) else 1.0
                values = values.astype(np.float32) / loudest
                channels = max(frame.layout.nb_channels, 1)
                values = values.mean(axis=0) if values.shape[0] > 1 else values.reshape(-1, channels).mean(axis=1)
                parts.append(values)
                n += len(values)
                if n >= seconds * stream.rate:
                    break
    except (av.error.FFmpegError, OSError) as error:
        raise FileFormatError(path, "(content)", "a video or a sound file that can be decoded", str(error)) from None
    if not parts:
        raise FileFormatError(path, "(content)", "a sound track", "an empty one")
    after = (first_s or 0.0) - (images_s if images_s is not None else first_s or 0.0)
    return SoundTrack(float(stream.rate), after, np.concatenate(parts).astype(np.float32))


def _start_s(stream) -> float:
    return float((stream.start_time or 0) * stream.time_base)


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
