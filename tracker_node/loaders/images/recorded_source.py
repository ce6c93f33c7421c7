"""What recorded images have in common: a stream of stamps and images, the same each time.

Image ``i`` of a source has the stamp ``base_stamp_ns + round(i * 1e9 / rate_hz)``, computed afresh from the integer ``i``,
so the same file always gives the same stamps; or that of a list (`loaders.images.stamps`), or its own. ``i`` counts from the
beginning of the file also when ``start`` skips some, and goes on counting when a loop begins again.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...camera.rig import CaptureSettings
from ...errors import SourceError
from ..decoding import Preparation, SourceImage, content_size
from .stamps import MOST_NS, common_ns, describe, period_ns

_MOST_STRETCH = 1.02  # of images that are resampled: codecs want multiples of 16, and lenses are scaled along
_MOST_SKIPPED = 4  # in a row: where decoding alone takes too long, a fifth of the images still comes


@dataclass(frozen=True)
class SourceOptions:
    """What part of a source is read, and how.

    Parameters
    ----------
    start, end : image numbers, ``end`` exclusive; None for the last.
    loop : begin again at ``start`` for ever.
    rate_hz : images per second instead of what the file says.
    size : (width, height) to resample to; None keeps the file's.
    shrink : whole factor by which images are made smaller, by area averages, unless there is a ``size``.
    base_stamp_ns : stamp of image 0, or, with a list of stamps, added to all of them.
    times_ns : stamp of every image of the file, instead of a rate.
    drift_ppm : by how much common time advances more than these stamps, in millionths.
    capture : pattern of a mosaic, and as what images are published; the rest is for devices.
    threads : of the decoder; None leaves it to OpenCV.
    ahead : decode in a thread of its own, some images ahead; False: by the thread that takes them.
    keep : hand on the images as they were in the source too.
    own_times : where a video's images are not evenly apart, their stamps are the times of its container, unless there are
        ``times_ns`` or a rate.
    """

    start: int = 0
    end: int | None = None
    loop: bool = False
    rate_hz: float | None = None
    size: tuple[int, int] | None = None
    base_stamp_ns: int = 0
    times_ns: tuple[int, ...] | None = None
    drift_ppm: float = 0.0
    shrink: int = 1
    capture: CaptureSettings = field(default_factory=CaptureSettings)
    threads: int | None = None
    ahead: bool = True
    keep: bool = False
    own_times: bool = True

    def __post_init__(self):
        if self.start < 0 or (self.end is not None and self.end <= self.start):
            raise ValueError(f"expected 0 <= start < end, got {self.start} and {self.end}")
        if self.rate_hz is not None and not 0.0 < self.rate_hz < 1e6:
            raise ValueError(f"expected a positive rate in Hz, got {self.rate_hz}")
        if self.size is not None and min(self.size) < 1:
            raise ValueError(f"expected a positive size in pixels, got {self.size}")
        if self.shrink < 1 or (self.threads is not None and self.threads < 1):
            raise ValueError(f"expected a factor and a number of threads of at least 1, got {self.shrink} and {self.threads}")

    def check_aspect(self, width: int, height: int, name: str) -> None:
        """Refuse to resample images to another aspect: what is round would not be.

        Parameters
        ----------
        width, height : of the images, px.
        name : of the source, for messages.

        Raises
        ------
        SourceError : naming both aspects and the nearest sizes.
        """
        if self.size is None:
            return
        wide, high = self.size
        same_width, same_height = (wide, max(1, round(wide * height / width))), (max(1, round(high * width / height)), high)
        stretch = wide * height / (high * width)
        if self.size not in (same_width, same_height) and not 1 / _MOST_STRETCH < stretch < _MOST_STRETCH:
            aspects = f"{wide}x{high} (aspect {wide / high:.3f}) of images of {width}x{height} ({width / height:.3f})"
            nearest = f"{same_width[0]}x{same_width[1]} or {same_height[0]}x{same_height[1]}"
            raise SourceError(name, f"resampling to {aspects} would stretch them: give {nearest}")

    def output_size(self, width: int, height: int) -> tuple[int, int]:
        """Size of the delivered images.

        Parameters
        ----------
        width, height : of the source's images, px.

        Returns
        -------
        (width, height), px.
        """
        return self.size or (max(1, width // self.shrink), max(1, height // self.shrink))


@dataclass
class ReadCounts:
    """What became of the images of the latest pass over a source."""

    read: int = 0
    missing: int = 0  # announced by the file, but not there or not readable
    unusable: int = 0  # of another size than the first
    skipped: int = 0  # left out, because their time was over
    problems: list[str] = field(default_factory=list)


class ImageSource(ABC):
    """Iterates ``(stamp_ns, bgr)``, or by `images` what is to be published; each iteration reads the file from the beginning.

    ``width`` and ``height`` are those of the delivered images, ``n_images`` the number in one pass as far as the file says
    (a truncated video delivers fewer, see ``counts``). ``note``: what is unusual about it and good to know, a sentence.
    ``first_number``: in the name of the first file of a folder; None where files are not numbered.
    ``rate_is_assumed``: nothing says the rate.
    """

    first_number: int | None = None
    rate_is_assumed = False

    def __init__(self, path: str, options: SourceOptions):
        self.path, self.options, self.note = path, options, ""
        self.counts = ReadCounts()
        self._skip_before_ns: int | None = None
        self._most_skipped: float = _MOST_SKIPPED
        self._n_before_pass = self._skipped_in_a_row = 0
        self.native_width, self.native_height, rate_hz, self._n_in_file = self._open()
        own = self._own_times() if options.own_times and options.times_ns is None and options.rate_hz is None else None
        if own is not None:
            self.options = options = replace(options, times_ns=own)
            self.note = describe(own)
        if options.start >= self._n_in_file:
            raise SourceError(path, f"start is image {options.start}, but there are only {self._n_in_file} images")
        if options.times_ns is not None and period_ns(options.times_ns):
            rate_hz = 1e9 / period_ns(options.times_ns)
        self.rate_hz = float(options.rate_hz or rate_hz)
        self.width, self.height = options.output_size(self.native_width, self.native_height)
        shrinks = (self.width, self.height) != (self.native_width, self.native_height)
        self._preparation = Preparation(self._settings(), (self.width, self.height) if shrinks else None, path, options.keep)

    def _own_times(self) -> tuple[int, ...] | None:
        """Of the images of the file, ns, where it says times that a rate does not give."""
        return None

    def _settings(self) -> CaptureSettings:
        """Known once the source has been opened."""
        return self.options.capture

    @property
    def bayer(self) -> str | None:
        """Pattern of the mosaics that it gives, by its options or by what it says itself; None for images that are none."""
        return self._settings().bayer

    @property
    def numbers(self) -> range:
        """Of the images that the options choose, in the file."""
        return range(self.options.start, min(self.options.end or self._n_in_file, self._n_in_file))

    @property
    def n_images(self) -> int:
        return len(self.numbers)

    @property
    def n_stored(self) -> int:
        """Number of images in the file, without those that a folder lacks."""
        return self._n_in_file

    def stamp_ns(self, i: int) -> int:
        """Stamp of image number ``i`` of the file; beyond the last one read, that of a later pass."""
        first_ns = self._own_ns(0)
        stamp_ns = common_ns(self._own_ns(i), first_ns, self.options.base_stamp_ns, self.options.drift_ppm)
        if not -MOST_NS <= stamp_ns <= MOST_NS:
            beyond = "beyond what a ROS time can hold: look at time_offset_s, time_drift_ppm and the base stamp"
            raise SourceError(self.path, f"image {i} would have the stamp {stamp_ns} ns, {beyond}")
        return stamp_ns

    def _own_ns(self, i: int) -> int:
        times, start, n = self.options.times_ns, self.options.start, self.n_images
        if times is None:
            return round(i * 1e9 / self.rate_hz)
        passes = max(i - start, 0) // n
        last_ns = times[start + n - 1] + round(1e9 / self.rate_hz)
        return times[i - passes * n] + passes * (last_ns - times[start])

    def __iter__(self) -> Iterator[tuple[int, np.ndarray]]:
        for image in self.images():
            yield image.stamp_ns, image.bgr

    def images(self, first: int | None = None) -> Iterator[SourceImage]:
        """Images as they are to be published, from number ``first`` of the file on, which is in what the options choose."""
        self.counts = ReadCounts()
        self._skip_before_ns, self._n_before_pass = None, 0
        while True:
            before = self.counts.read + self.counts.skipped
            for i, content in self._usable(self.numbers.start if first is None else first, self.numbers.stop):
                self.counts.read += 1
                yield self._prepared(self.stamp_ns(i + self._n_before_pass), content)
            self._n_before_pass, first = self._n_before_pass + self.n_images, None
            if not self.options.loop or self.counts.read + self.counts.skipped == before:
                return

    def _usable(self, start: int, end: int) -> Iterator[tuple[int, Any]]:
        """The images in [start, end), without those of another size than the first, which are counted."""
        for i, content in self._read(start, end):
            width, height = content_size(content)
            if (width, height) == (self.native_width, self.native_height):
                yield i, content
            else:
                self.counts.unusable += 1
                sizes = f"{width}x{height} pixels, not {self.native_width}x{self.native_height}"
                self.counts.problems.append(f"{self._name_of(i)} is of {sizes}")

    def _name_of(self, i: int) -> str:
        return f"image {i}"

    def _prepared(self, stamp_ns: int, content: Any) -> SourceImage:
        return self._preparation.image(stamp_ns, content)

    def skip_before(self, stamp_ns: int, most: float = _MOST_SKIPPED) -> None:
        """From any thread: images before this stamp are not wanted any more, and as little as possible is done for them.

        Parameters
        ----------
        stamp_ns : nanoseconds.
        most : so many in a row are left out before one is read in any case.
        """
        self._skip_before_ns, self._most_skipped = stamp_ns, most

    def _skips(self, i: int) -> bool:
        """Whether image ``i`` of the current pass is to be left out; then it is counted. Some are read in any case."""
        late = self._skip_before_ns is not None and self.stamp_ns(i + self._n_before_pass) < self._skip_before_ns
        skips = late and self._skipped_in_a_row < self._most_skipped
        self._skipped_in_a_row = self._skipped_in_a_row + 1 if skips else 0
        self.counts.skipped += skips
        return skips

    def _missing(self, n: int, problem: str) -> None:
        self.counts.missing += n
        self.counts.problems.append(problem)

    @abstractmethod
    def _open(self) -> tuple[int, int, float, int]:
        """(width, height, rate_hz, number of images); raises SourceError."""

    @abstractmethod
    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray | bytes]]:
        """(number, pixels (h, w[, 3]) or JPEG) of the readable images in [start, end)."""
