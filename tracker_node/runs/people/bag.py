"""Points of people in a bag, by the images that they were found in."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

import lz4.frame

from ...loaders.bag.message_types import KEYPOINTS, stamp_ns_of
from ...loaders.bag.reader import BagMessage, BagReader
from ..points import DetectedPeople, detected_people

ImageKey = tuple[str, int]
"""Camera, and stamp of an image in nanoseconds."""


class BagPoints:
    """The messages of a bag with people, the first of those of one image, as live; packed, since silhouettes are large and even.

    Parameters
    ----------
    reader : of the bag.
    needed : images whose people are asked for; None: all.
    """

    def __init__(self, reader: BagReader, needed: Container[ImageKey] | None = None):
        self._reader = reader
        self._messages: dict[ImageKey, BagMessage] = {}
        topics = reader.topics_of_type(KEYPOINTS)
        for message in reader.messages(topics) if topics else ():
            content = reader.decode(message)
            key = str(content.camera), stamp_ns_of(content.header.stamp)
            if key not in self._messages and (needed is None or key in needed):
                self._messages[key] = replace(message, data=lz4.frame.compress(message.data))

    def __contains__(self, key: ImageKey) -> bool:
        return key in self._messages

    def people(self, key: ImageKey) -> DetectedPeople:
        """Who was found in an image.

        Raises
        ------
        CalibrationError : the message contradicts itself.
        """
        message = self._messages[key]
        return detected_people(self._reader.decode(replace(message, data=lz4.frame.decompress(message.data))))
