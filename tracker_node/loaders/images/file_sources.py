"""Video files and folders of images."""

from __future__ import annotations

import glob
import re
from bisect import bisect_left
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from ...errors import SourceError
from ..decoding import IMAGE_SUFFIXES, JPEG, jpeg_size
from .recorded_source import ImageSource
from .stamps import varying_times

DEFAULT_FOLDER_RATE_HZ = 30.0  # still images carry no rate
_MJPG = cv2.VideoWriter.fourcc(*"MJPG")
READ_ON = 20  # images that are rather read in passing than jumped over


class VideoSource(ImageSource):
    """A video file, through OpenCV.

    Images that have been passed once are found again by their times, so that a later pass need not begin at the beginning.
    """

    def _capture(self) -> cv2.VideoCapture:
        threads = self.options.threads
        capture = cv2.VideoCapture(self.path, cv2.CAP_ANY, [cv2.CAP_PROP_N_THREADS, threads] if threads else [])
        if not capture.isOpened():
            raise SourceError(self.path, "cannot be opened as a video (damaged, or a format that OpenCV cannot decode)")
        return capture

    def _open(self) -> tuple[int, int, float, int]:
        self._passed_ms: list[float] = []
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

    def _own_times(self) -> tuple[int, ...] | None:
        return varying_times(self.path, self._n_in_file)

    def _packets(self) -> cv2.VideoCapture:
        """The file's own JPEG images, not decoded."""
        capture = cv2.VideoCapture(self.path, cv2.CAP_FFMPEG)
        if int(capture.get(cv2.CAP_PROP_FOURCC)) != _MJPG or not capture.set(cv2.CAP_PROP_FORMAT, -1):
            capture.release()
            raise SourceError(self.path, "is no video of JPEG images that could be passed on as they are")
        return capture

    def _pass(self, i: int, capture: cv2.VideoCapture) -> None:
        """Keep the time of an image; of files whose images have none of their own, only those before."""
        if i == len(self._passed_ms):
            time_ms = capture.get(cv2.CAP_PROP_POS_MSEC)
            if not self._passed_ms or time_ms > self._passed_ms[-1]:
                self._passed_ms.append(time_ms)

    def _capture_near(self, start: int) -> tuple[cv2.VideoCapture, int]:
        """The file, open before image ``start`` or one not long before it, and which one comes next.

        Where a jump ends is inexact with some codecs; the time of the image there tells.
        """
        capture, last = self._capture(), min(start, len(self._passed_ms)) - 1
        if last < READ_ON:
            return capture, 0
        if capture.set(cv2.CAP_PROP_POS_FRAMES, last) and capture.grab():
            time_ms = capture.get(cv2.CAP_PROP_POS_MSEC)
            i = bisect_left(self._passed_ms, time_ms)
            if i <= last and self._passed_ms[i] == time_ms:
                return capture, i + 1
        capture.release()
        return self._capture(), 0

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray | bytes]]:
        as_jpeg = self.options.capture.publish == JPEG
        capture, begin = (self._packets(), 0) if as_jpeg else self._capture_near(start)
        try:
            for i in range(begin, end):
                # Skipped images are decoded too: others are made from them.
                ok, image = (capture.grab(), None) if i < start or self._skips(i) else capture.read()
                if not ok:
                    first = max(i, start)
                    self._missing(end - first, f"ends after {i} images, {end} were expected")
                    return
                self._pass(i, capture)
                if image is not None:
                    yield i, image.tobytes() if as_jpeg else image
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

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray | bytes]]:
        for i in range(start, end):
            if self._skips(i):
                continue
            content = self._content(self._files[i])
            if content is None:
                self._missing(1, f"cannot read {self._files[i]}")
                continue
            yield i, content

    def _content(self, file: str) -> np.ndarray | bytes | None:
        publish, keep = self.options.capture.publish, self.options.keep
        gray = self.options.capture.bayer or (publish == "mono" and not keep)
        is_jpeg = Path(file).suffix.lower() in (".jpg", ".jpeg")
        shrinks = (self.width, self.height) != (self.native_width, self.native_height)
        if publish == JPEG or (is_jpeg and (shrinks or keep) and publish == "color" and not gray):
            data = _bytes(file)
            if publish == JPEG or _plain_size(data) == (self.native_width, self.native_height):
                return data
        flags = cv2.IMREAD_ANYCOLOR if publish == "native" else cv2.IMREAD_COLOR
        return cv2.imread(file, cv2.IMREAD_GRAYSCALE if gray else flags)


def _bytes(file: str) -> bytes | None:
    try:
        return Path(file).read_bytes()
    except OSError:
        return None


def _plain_size(data: bytes | None) -> tuple[int, int] | None:
    """Size of a JPEG as it lies in the file (a camera held upright may say that it is to be turned); None if it is none."""
    try:
        return None if data is None else jpeg_size(data)
    except SourceError:
        return None


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
        raise SourceError(path, f"no image files there (of {' '.join(IMAGE_SUFFIXES)})")
    return sorted(found, key=_natural_key)


def _natural_key(path: str) -> list[tuple[int, int, str]]:
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", path) if part]
