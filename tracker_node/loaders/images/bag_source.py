"""The images of a topic of a bag, with the stamps that they have there."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ...camera.capture_settings import CaptureSettings
from ...errors import FileFormatError, SourceError
from ..bag.images import COMPRESSED, RAW, image_topics, source_content
from ..bag.message_types import NS_PER_S
from ..bag.reader import BagReader
from ..decoding import content_size
from ..source_address import SourceAddress
from .recorded_source import ImageSource, SourceOptions

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
