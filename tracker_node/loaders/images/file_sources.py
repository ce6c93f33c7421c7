"""Recorded images: video files, folders of images, and the topics of bags, with the stamps that they have there."""

from __future__ import annotations

import dataclasses
import glob
import os
import re
from bisect import bisect_left
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from ...camera.rig import CaptureSettings
from ...errors import FileFormatError, SourceError
from ..bag.images import COMPRESSED, RAW, image_topics, source_content
from ..bag.message_types import NS_PER_S
from ..bag.reader import BagReader
from ..decoding import IMAGE_SUFFIXES, JPEG, content_size, is_whole, jpeg_size
from ..source_address import SourceAddress, natural
from .recorded_source import ImageSource, SourceOptions
from .stamps import varying_times

DEFAULT_FOLDER_RATE_HZ = 30.0  # still images carry no rate
_MJPG = cv2.VideoWriter.fourcc(*"MJPG")
READ_ON = 20  # images that are rather read in passing than jumped over
_JPEG_SUFFIXES = (".jpg", ".jpeg")
_TRIED = 20  # files of a folder, of which one is whole
_NUMBERED = re.compile(r"(.*?)([0-9]+)([^0-9]*)", re.DOTALL)
_MOST_NUMBERED = 10  # times as many numbers as files: more are no recording with gaps
_PNG_BEGIN = b"\x89PNG\r\n\x1a\n"
_ENDS = {b"\xff\xd8": b"\xff\xd9", _PNG_BEGIN: b"IEND\xaeB`\x82"}  # what JPEG and PNG begin and end with


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
    """Image files of a folder, or of a pattern, in natural order (``image9`` before ``image10``).

    A number that is missing between those of the others is an image that is missing, as the note says, so that the others keep
    their time; but not where there is a time for each file.
    """

    def _open(self) -> tuple[int, int, float, int]:
        found = list_images(self.path)
        self._files, self._n_stored = found, len(found)
        if self.options.times_ns is None:
            self.rate_is_assumed = self.options.rate_hz is None and len(found) > 1
            self._files, self.first_number = _with_missing(found)
        self._absent = set(self._files).difference(found)
        if self._absent:
            first = Path(min(self._absent, key=natural)).name
            self.note = f"{len(self._absent)} of {len(self._files)} numbered images are missing, first {first}"
        jpegs = [file for file in found[:_TRIED] if file.lower().endswith(_JPEG_SUFFIXES)]
        self._have_ends = not jpegs or not all(map(_damage, jpegs))  # some cameras never write that of a JPEG
        for file in found:
            image = None if self._have_ends and _damage(file) else cv2.imread(file, cv2.IMREAD_COLOR)
            if image is not None:
                return image.shape[1], image.shape[0], DEFAULT_FOLDER_RATE_HZ, len(self._files)
        raise SourceError(self.path, f"none of its {len(found)} image files can be read")

    @property
    def n_stored(self) -> int:
        return self._n_stored

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray | bytes]]:
        for i in range(start, end):
            if self._skips(i):
                continue
            file = self._files[i]
            if file in self._absent:
                self.counts.missing += 1
                continue
            damage = _damage(file) if self._have_ends else ""
            content = None if damage else self._content(file)
            if content is None:
                self._missing(1, damage or f"cannot read {file}")
                continue
            yield i, content

    def _name_of(self, i: int) -> str:
        return self._files[i]

    def _content(self, file: str) -> np.ndarray | bytes | None:
        publish, keep = self.options.capture.publish, self.options.keep
        gray = self.options.capture.bayer or (publish == "mono" and not keep)
        is_jpeg = file.lower().endswith(_JPEG_SUFFIXES)
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


def _damage(file: str) -> str:
    """What is wrong with an image file, as far as its two ends tell: of one that is cut off, decoders make up the rest."""
    try:
        with open(file, "rb") as stream:
            begin = stream.read(len(_PNG_BEGIN))
            end = next((end for first, end in _ENDS.items() if begin.startswith(first)), b"")
            stream.seek(-min(len(end), len(begin)), os.SEEK_END)
            if stream.read() == end or not end:
                return ""
            stream.seek(0)
            return "" if is_whole(stream.read()) else f"{file} is cut off: the end of the image is missing"
    except FileNotFoundError:
        return f"{file} is missing"
    except OSError:
        return f"cannot read {file}"


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
        files = (file for file in Path(path).iterdir() if not file.name.startswith("."))
        found = [str(file) for file in files if file.suffix.lower() in IMAGE_SUFFIXES]
    else:
        printf = re.search(r"%0?\d*d", path)
        pattern = path[: printf.start()] + "[0-9]*" + path[printf.end() :] if printf else path
        found = [file for file in glob.glob(pattern) if Path(file).suffix.lower() in IMAGE_SUFFIXES]
    if not found:
        raise SourceError(path, f"no image files there (of {' '.join(IMAGE_SUFFIXES)})")
    return sorted(found, key=natural)


def _with_missing(files: list[str]) -> tuple[list[str], int | None]:
    """Files with the names of those that are missing in between, and the first number; as they are, and None, without numbers.

    Names are numbered where they differ in one number only, which mostly grows by the same step: times of images do not.
    """
    parts = [_NUMBERED.fullmatch(file) for file in files]
    first = parts[0]
    if first is None or any(part is None or (part[1], part[3]) != (first[1], first[3]) for part in parts):
        return files, None
    digits = [part[2] for part in parts if part is not None]
    numbers = list(map(int, digits))
    steps = [after - before for before, after in pairwise(numbers)]
    step = min(steps, default=0)
    regular = sum(each == step for each in steps)
    if step < 1 or any(each % step for each in steps) or 2 * regular < len(steps):
        return files, None
    n = (numbers[-1] - numbers[0]) // step + 1
    if n == len(files):
        return files, numbers[0]
    if n > _MOST_NUMBERED * len(files):
        return files, None
    width, known = min(map(len, digits)), set(numbers)
    names = dict(zip(numbers, files, strict=True))
    for number in range(numbers[0], numbers[-1], step):
        if number not in known:
            names[number] = f"{first[1]}{number:0{width}}{first[3]}"
            if os.path.exists(names[number]):  # a pattern has chosen among the files
                return files, None
    return [names[number] for number in sorted(names)], numbers[0]


_DEFAULT_RATE_HZ = 30.0  # of a bag with one image


class BagSource(ImageSource):
    """Raw or compressed images of one topic; JPEG images are decoded only where they have to be.

    Stamps are those of the messages' headers, unless the options have others.

    Raises
    ------
    SourceError : no images there, or those of several topics and no word which.
    FileFormatError : no bag.
    UnknownNameError : a topic that the bag does not have.
    """

    def __init__(self, address: SourceAddress, options: SourceOptions):
        self._address = address
        self._pattern: str | None = None
        self._header_ns: list[int] = []  # as far as it has been read
        super().__init__(str(address), options)

    def _open(self) -> tuple[int, int, float, int]:
        with BagReader(self._address.target) as reader:
            self._topic = self._address.topic or _only_image_topic(reader)
            topic = reader.topic(self._topic)
            if topic.type_name not in (RAW, COMPRESSED):
                raise SourceError(self.path, f"expected a topic of images, {self._topic} has {topic.type_name}")
            message = next(iter(reader.messages([self._topic])), None)
            if message is None:
                raise SourceError(self.path, f"no image on {self._topic}")
            _, content, self._pattern = source_content(reader, message)
            duration_s = (reader.end_ns - reader.start_ns) / NS_PER_S
        n = topic.message_count
        rate_hz = (n - 1) / duration_s if n > 1 and duration_s > 0 else _DEFAULT_RATE_HZ
        return *content_size(content), rate_hz, n

    def _settings(self) -> CaptureSettings:
        settings = self.options.capture
        return settings if settings.bayer or not self._pattern else dataclasses.replace(settings, bayer=self._pattern)

    def _own_ns(self, i: int) -> int:
        if self.options.times_ns is not None or self.options.rate_hz is not None:
            return super()._own_ns(i)
        start, n = self.options.start, self.n_images
        passes = max(i - start, 0) // n
        own_ns = self._header_stamp(i - passes * n)
        if not passes:
            return own_ns
        span_ns = self._header_stamp(start + n - 1) - self._header_stamp(start) + round(NS_PER_S / self.rate_hz)
        return own_ns + passes * span_ns

    def _header_stamp(self, i: int) -> int:
        if i >= len(self._header_ns):  # asked for before it has been read
            for _ in self._read(i, i + 1):
                pass
        if i >= len(self._header_ns):
            raise SourceError(self.path, f"image {i} cannot be read")
        return self._header_ns[i]

    def _read(self, start: int, end: int) -> Iterator[tuple[int, np.ndarray | bytes]]:
        with BagReader(self._address.target) as reader:
            n = 0
            try:
                for i, message in enumerate(reader.messages([self._topic])):
                    if i >= end:
                        return
                    n = i + 1
                    stamp_ns, content, _ = source_content(reader, message)
                    if i == len(self._header_ns):
                        self._header_ns.append(stamp_ns)
                    if i >= start:
                        yield i, content
            except FileFormatError as error:
                self._missing(end - max(n, start), str(error))
                return
        if n < end:
            self._missing(end - max(n, start), f"ends after {n} images, {end} were expected")


def topic_of_camera(address: SourceAddress, camera: str) -> SourceAddress:
    """Source in a bag with the topic of a camera.

    Parameters
    ----------
    address, camera : source, kept if it has a topic; name.

    Returns
    -------
    The same bag with a topic.

    Raises
    ------
    SourceError : none, or several.
    FileFormatError : no bag.
    """
    if address.topic:
        return address
    with BagReader(address.target) as reader:
        topics = image_topics(reader, [camera])
    if not topics:
        raise SourceError(str(address), f"no images of camera '{camera}'; name the topic: {address}#/TOPIC")
    return dataclasses.replace(address, topic=next(iter(topics)))


def _only_image_topic(reader: BagReader) -> str:
    topics = sorted((*reader.topics_of_type(RAW), *reader.topics_of_type(COMPRESSED)))
    if len(topics) != 1:
        found = ", ".join(topics) or "none"
        raise SourceError(reader.path, f"expected one topic of images, found {found}; name it: bag:{reader.path}#/TOPIC")
    return topics[0]
