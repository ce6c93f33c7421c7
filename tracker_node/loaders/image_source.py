"""Recorded images as a stream of (stamp, image): video files, image folders and file name patterns.

Image ``i`` of a source has the stamp ``base_stamp_ns + round(i * 1e9 / rate_hz)``, computed afresh from the integer ``i``,
so the same file always gives the same stamps; or that of a list (`loaders.stamps`). ``i`` counts from the beginning of the
file also when ``start`` skips some, and goes on counting when a loop begins again.
"""

from __future__ import annotations

import glob
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from ..camera.camera_rig import Camera
from ..errors import CalibrationError, SourceError
from ..observation.deinterlace import check_interlaced, deinterlace
from .stamps import common_ns, field_times, file_times, period_ns

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm")
DEFAULT_FOLDER_RATE_HZ = 30.0  # still images carry no rate
_CHECKED = 12  # images at the beginning that must not contradict a source being interlaced


@dataclass(frozen=True)
class SourceOptions:
    """What part of a source is read, and how.

    Parameters
    ----------
    start, end : image numbers, ``end`` exclusive; None for the last.
    loop : begin again at ``start`` for ever.
    rate_hz : images per second instead of what the file says.
    size : (width, height) to resample to; None keeps the file's.
    base_stamp_ns : stamp of image 0, or, with a list of stamps, added to all of them.
    times_ns : stamp of every image of the file, instead of a rate.
    drift_ppm : by how much common time advances more than these stamps, in millionths.
    """

    start: int = 0
    end: int | None = None
    loop: bool = False
    rate_hz: float | None = None
    size: tuple[int, int] | None = None
    base_stamp_ns: int = 0
    times_ns: tuple[int, ...] | None = None
    drift_ppm: float = 0.0

    def __post_init__(self):
        if self.start < 0 or (self.end is not None and self.end <= self.start):
            raise ValueError(f"expected 0 <= start < end, got {self.start} and {self.end}")
        if self.rate_hz is not None and not 0.0 < self.rate_hz < 1e6:
            raise ValueError(f"expected a positive rate in Hz, got {self.rate_hz}")
        if self.size is not None and min(self.size) < 1:
            raise ValueError(f"expected a positive size in pixels, got {self.size}")


@dataclass
class ReadCounts:
    """What became of the images of the latest pass over a source."""

    read: int = 0
    missing: int = 0  # announced by the file, but not there or not readable
    problems: list[str] = field(default_factory=list)


class ImageSource(ABC):
    """Iterates ``(stamp_ns, bgr)``; each iteration reads the file from the beginning.

    ``width`` and ``height`` are those of the delivered images, ``n_images`` the number in one pass as far as the file says
    (a truncated video delivers fewer, see ``counts``).
    """

    def __init__(self, path: str, options: SourceOptions):
        self.path, self.options = path, options
        self.counts = ReadCounts()
        self.native_width, self.native_height, rate_hz, self._n_in_file = self._open()
        if options.start >= self._n_in_file:
            raise SourceError(path, f"start is image {options.start}, but there are only {self._n_in_file} images")
        if options.times_ns is not None and period_ns(options.times_ns):
            rate_hz = 1e9 / period_ns(options.times_ns)
        self.rate_hz = float(options.rate_hz or rate_hz)
        self.width, self.height = options.size or (self.native_width, self.native_height)

    @property
    def n_images(self) -> int:
        return min(self.options.end or self._n_in_file, self._n_in_file) - self.options.start

    def stamp_ns(self, i: int) -> int:
        """Stamp of image number ``i`` of the file; beyond the last one read, that of a later pass."""
        first_ns = self._own_ns(0)
        return common_ns(self._own_ns(i), first_ns, self.options.base_stamp_ns, self.options.drift_ppm)

    def _own_ns(self, i: int) -> int:
        times, start, n = self.options.times_ns, self.options.start, self.n_images
        if times is None:
            return round(i * 1e9 / self.rate_hz)
        passes = max(i - start, 0) // n
        last_ns = times[start + n - 1] + round(1e9 / self.rate_hz)
        return times[i - passes * n] + passes * (last_ns - times[start])

    def __iter__(self) -> Iterator[tuple[int, np.ndarray]]:
        self.counts = ReadCounts()
        passes = 0
        while True:
            before = self.counts.read
            for i, image in self._read(self.options.start, self.options.start + self.n_images):
                self.counts.read += 1
                yield self.stamp_ns(i + passes * self.n_images), self._resized(image)
            passes += 1
            if not self.options.loop or self.counts.read == before:
                return

    def _resized(self, image: np.ndarray) -> np.ndarray:
        if image.shape[:2] != (self.native_height, self.native_width):
            got = f"{image.shape[1]}x{image.shape[0]}"
            raise SourceError(self.path, f"image size changes from {self.native_width}x{self.native_height} to {got}")
        if self.options.size is None or image.shape[:2] == (self.height, self.width):
            return image
        shrinks = self.width < self.native_width
        return cv2.resize(image, (self.width, self.height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)

    def _missing(self, n: int, problem: str) -> None:
        self.counts.missing += n
        self.counts.problems.append(problem)

    @abstractmethod
    def _open(self) -> tuple[int, int, float, int]:
        """(width, height, rate_hz, number of images); raises SourceError."""

    @abstractmethod
    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray]]:
        """(number, BGR image) of the readable images in [start, end)."""


class VideoSource(ImageSource):
    """A video file, through OpenCV."""

    def _capture(self) -> cv2.VideoCapture:
        capture = cv2.VideoCapture(self.path)
        if not capture.isOpened():
            raise SourceError(self.path, "cannot be opened as a video (damaged, or a format that OpenCV cannot decode)")
        return capture

    def _open(self) -> tuple[int, int, float, int]:
        capture = self._capture()
        try:
            rate_hz, count = capture.get(cv2.CAP_PROP_FPS), int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
            ok, image = capture.read()  # the size after a rotation in the metadata is known for sure from an image only
        finally:
            capture.release()
        if not ok:
            raise SourceError(self.path, "not a single image can be read")
        if not 0.0 < rate_hz < 1e6 and self.options.rate_hz is None:
            raise SourceError(self.path, "does not say its image rate; give one")
        return image.shape[1], image.shape[0], rate_hz, max(count, 1)

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray]]:
        capture = self._capture()
        try:
            for i in range(end):
                # Skipped images are decoded too: seeking is inexact with some codecs.
                ok, image = (capture.grab(), None) if i < start else capture.read()
                if not ok:
                    first = max(i, start)
                    self._missing(end - first, f"ends after {i} images, {end} were expected")
                    return
                if image is not None:
                    yield i, image
        finally:
            capture.release()


class FolderSource(ImageSource):
    """Image files of a folder, or of a pattern, in natural order (``image9`` before ``image10``)."""

    def _open(self) -> tuple[int, int, float, int]:
        self._files = list_images(self.path)
        for file in self._files:
            image = cv2.imread(file, cv2.IMREAD_COLOR)
            if image is not None:
                return image.shape[1], image.shape[0], DEFAULT_FOLDER_RATE_HZ, len(self._files)
        raise SourceError(self.path, f"none of its {len(self._files)} image files can be read")

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray]]:
        for i in range(start, end):
            image = cv2.imread(self._files[i], cv2.IMREAD_COLOR)
            if image is None:
                self._missing(1, f"cannot read {self._files[i]}")
                continue
            yield i, image


class PreloadedSource(ImageSource):
    """Another source's images, all decoded before the first is delivered."""

    def __init__(self, source: ImageSource):
        self._source = source
        first = source.options.start
        self._images = [(i, source._resized(image)) for i, image in source._read(first, first + source.n_images)]
        super().__init__(source.path, replace(source.options, size=None, rate_hz=source.rate_hz))

    def _open(self) -> tuple[int, int, float, int]:
        return self._source.width, self._source.height, self._source.rate_hz, self._source._n_in_file

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray]]:
        yield from self._images


class InterlacedSource(ImageSource):
    """A source of interlaced images as twice as many images of one instant each, missing lines interpolated.

    Numbers, rate and ``start`` and ``end`` of the options are those of the delivered images.

    Raises
    ------
    SourceError : an odd number of lines, or what moves in the first images shows that they are progressive.
    """

    def __init__(self, path: str | Path, options: SourceOptions, order: str):
        self._order = order
        self._woven = open_source(path)
        super().__init__(str(path), options)
        check_interlaced([image for _, image in self._woven._read(0, min(_CHECKED, self._woven.n_images))], str(path))

    def _open(self) -> tuple[int, int, float, int]:
        source = self._woven
        if source.native_height % 2:
            raise SourceError(source.path, f"marked as interlaced, but its {source.native_height} lines are not an even number")
        return source.native_width, source.native_height, 2.0 * source.rate_hz, 2 * source.n_images

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray]]:
        self._woven.counts = self.counts
        for i, image in self._woven._read(start // 2, (end + 1) // 2):
            for number, instant in enumerate(deinterlace(image, self._order), start=2 * i):
                if start <= number < end:
                    yield number, instant


def list_images(path: str) -> list[str]:
    """Image files of a folder or a pattern (``*``, ``?``, or ``%04d``) in natural order.

    Raises
    ------
    SourceError : when there are none.
    """
    if Path(path).is_dir():
        found = [str(file) for file in Path(path).iterdir() if file.suffix.lower() in IMAGE_SUFFIXES]
    else:
        printf = re.search(r"%0?\d*d", path)
        pattern = path[: printf.start()] + "[0-9]*" + path[printf.end() :] if printf else path
        found = [file for file in glob.glob(pattern) if Path(file).suffix.lower() in IMAGE_SUFFIXES]
    if not found:
        raise SourceError(path, f"no image files there (looked for {' '.join(IMAGE_SUFFIXES)})")
    return sorted(found, key=_natural_key)


def _natural_key(path: str) -> list[tuple[int, int, str]]:
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", path) if part]


def open_source(path: str | Path, options: SourceOptions | None = None, **changes) -> ImageSource:
    """Open a video file, an image folder or a pattern of image files.

    ``changes`` are fields of `SourceOptions`, for short calls: ``open_source("cam01.mp4", start=10, end=20)``.

    Raises
    ------
    SourceError : naming the path, when it is missing or unreadable.
    """
    if options is not None and changes:
        raise ValueError("expected options or single fields, got both")
    options = options or SourceOptions(**changes)
    text = str(path)
    if Path(text).is_dir() or (re.search(r"[*?\[]|%0?\d*d", text) and not Path(text).exists()):
        return FolderSource(text, options)
    if not Path(text).exists():
        raise SourceError(text, "no such file or folder")
    if Path(text).suffix.lower() in IMAGE_SUFFIXES:
        return FolderSource(glob.escape(text), options)
    return VideoSource(text, options)


def open_camera_source(camera: Camera, options: SourceOptions | None = None) -> ImageSource:
    """Source of a rig's camera: its size is held against the calibration, its stamps get the camera's time offset.

    With ``options.size`` the images are resampled; the lens for them is ``camera.model.resized(*options.size)``.

    Raises
    ------
    SourceError : no source given, missing or unreadable, progressive though the camera is said to be interlaced, or stamps
        that are not those of its images.
    FileFormatError : a stamp file that cannot be used.
    CalibrationError : the file's image size is not that of the calibration.
    """
    if not camera.source:
        raise SourceError(camera.name, "the rig names no source for this camera")
    options = options or SourceOptions()
    base_ns = options.base_stamp_ns + camera.time_offset_ns
    shifted = replace(options, base_stamp_ns=base_ns, drift_ppm=camera.time_drift_ppm)
    if camera.stamp_file is not None or camera.stamps is not None:
        times = file_times(camera, open_source(camera.source)._n_in_file)
        shifted = replace(shifted, times_ns=field_times(times) if camera.interlaced and times else times)
    if camera.interlaced:
        source: ImageSource = InterlacedSource(camera.source, shifted, camera.interlaced)
    else:
        source = open_source(camera.source, shifted)
    expected, got = (camera.model.width, camera.model.height), (source.native_width, source.native_height)
    if expected != got:
        raise CalibrationError(
            camera.name,
            f"image size contradicts the calibration: expected {expected[0]}x{expected[1]}, got {got[0]}x{got[1]}"
            f" in {camera.source}",
        )
    return source
