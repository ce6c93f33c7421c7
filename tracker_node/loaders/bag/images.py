"""Images in the messages of a bag, and their pixels without a copy."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from ...errors import SourceError, shown
from ...observation.image_set import CameraImage
from ..decoding import bayer_pattern, decoded_message, is_plain_jpeg, pixels_of
from .message_types import stamp_ns_of
from .reader import BagMessage, BagReader

RAW = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
_TOPIC_ENDS = ((RAW, "image_raw"), (COMPRESSED, "image_raw/compressed"))


def image_topics(reader: BagReader, cameras: Iterable[str]) -> dict[str, str]:
    """Topics with the images of cameras, raw ones before compressed ones.

    Parameters
    ----------
    reader, cameras : open bag; names. Any namespace may stand before a camera's name, but only one topic may fit.

    Returns
    -------
    Topic -> camera, of the cameras whose images the bag holds.

    Raises
    ------
    SourceError : several topics fit one camera.
    """
    chosen: dict[str, str] = {}
    for camera in cameras:
        for type_name, end in _TOPIC_ENDS:
            topics = [t for t in reader.topics_of_type(type_name) if f"/{t}".endswith(f"/{camera}/{end}")]
            topics = [t for t in topics if reader.topics[t].message_count]
            if len(topics) > 1:
                raise SourceError(reader.path, f"several topics fit camera '{camera}': {', '.join(sorted(topics))}")
            if topics:
                chosen[topics[0]] = camera
                break
    return chosen


def image_of(reader: BagReader, message: BagMessage, camera: str) -> CameraImage:
    """The image in a message.

    Parameters
    ----------
    reader, message : open bag, and a message of it of type `RAW` or `COMPRESSED`.
    camera : its name, also for messages.

    Returns
    -------
    Image with the stamp of the message's header.

    Raises
    ------
    SourceError : an encoding that cannot be used, or a damaged image.
    """
    content = reader.decode(message)
    stamp_ns = stamp_ns_of(content.header.stamp)
    if message.type_name == COMPRESSED:
        pixels = decoded_message(content.data, content.format)
        if pixels is None:
            raise SourceError(camera, f"compressed image at {stamp_ns} ns cannot be decoded (format {shown(content.format)})")
        return CameraImage(camera, stamp_ns, pixels, "bgr8")
    return CameraImage(camera, stamp_ns, *_pixels(content, content.encoding, camera, stamp_ns))


def _pixels(content: Any, encoding: str, camera: str, stamp_ns: int) -> tuple[np.ndarray, str]:
    what, size, swapped = f"image at {stamp_ns} ns", (content.width, content.height), bool(content.is_bigendian)
    pixels, encoding = pixels_of(camera, size, encoding, content.step, content.data, what, swapped)
    pixels.setflags(write=False)
    return pixels, encoding


def source_content(reader: BagReader, message: BagMessage) -> tuple[int, np.ndarray | bytes, str | None]:
    """The image in a message as a source delivers it.

    Parameters
    ----------
    reader, message : open bag, and a message of it of type `RAW` or `COMPRESSED`.

    Returns
    -------
    Stamp (ns), pixels (h, w, 3) in BGR or (h, w), or a JPEG as it is, and the Bayer pattern of a mosaic or None.

    Raises
    ------
    SourceError : an encoding that cannot be used, or a damaged image.
    """
    content = reader.decode(message)
    stamp_ns = stamp_ns_of(content.header.stamp)
    if message.type_name == COMPRESSED and is_plain_jpeg(data := content.data.tobytes(), content.format):
        return stamp_ns, data, None
    pattern = bayer_pattern(getattr(content, "encoding", ""))
    if pattern:
        return stamp_ns, _pixels(content, "mono8", message.topic, stamp_ns)[0], pattern
    image = image_of(reader, message, message.topic)
    return stamp_ns, image.pixels if image.encoding == "mono8" else np.ascontiguousarray(image.bgr), None


def only_topic(reader: BagReader, type_name: str, wanted: Collection[str] = ()) -> str:
    """The one topic of a type.

    Parameters
    ----------
    reader, type_name : open bag; such as ``sensor_msgs/msg/Image``.
    wanted : topics to choose from; empty for all.

    Returns
    -------
    Its name.

    Raises
    ------
    SourceError : none, or several to choose from.
    """
    topics = [topic for topic in reader.topics_of_type(type_name) if not wanted or topic in wanted]
    if len(topics) != 1:
        found = ", ".join(sorted(topics)) or "none"
        raise SourceError(reader.path, f"expected one topic of type {type_name}, found {found}")
    return topics[0]
