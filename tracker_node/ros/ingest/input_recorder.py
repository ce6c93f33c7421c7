"""The images that go in, to a bag: as they came, before anything is done to them, and without a way through the network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message

from ...loaders.bag.images import COMPRESSED, RAW
from ...loaders.bag.message_types import message_type
from ...loaders.bag.metadata import OfferedQos
from ...loaders.bag.queue import BagQueue
from ...loaders.bag.writer import BagWriter
from ..conversions import camera_info_message, image_message, jpeg_message
from .cameras import IngestCamera

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


class InputRecorder:
    """Writes ``/<cam>/image_raw``, or ``/<cam>/image_raw/compressed`` of JPEG images, and ``/<cam>/camera_info`` where known.

    `record` may be called from several threads; it never waits for the disk. What that cannot take is counted.

    Raises
    ------
    BagExistsError : there is something already.
    """

    def __init__(self, path: Path):
        self._bag = BagQueue(BagWriter(path))

    def record(self, camera: IngestCamera, stamp_ns: int, content: np.ndarray | bytes, bayer: str | None = None) -> None:
        """An image as its source gave it: pixels (h, w, 3) in BGR or (h, w), a mosaic where there is a pattern, or a JPEG."""
        if isinstance(content, bytes):
            image = jpeg_message(stamp_ns, camera.frame_id, content)
            type_name, topic = COMPRESSED, "image_raw/compressed"
        else:
            image = image_message(stamp_ns, camera.frame_id, content, _encoding(content, bayer))
            type_name, topic = RAW, "image_raw"
        self._put(f"/{camera.name}/{topic}", type_name, stamp_ns, image)
        if camera.lens is not None:
            info = camera_info_message(stamp_ns, camera.frame_id, camera.lens)
            self._put(f"/{camera.name}/camera_info", CAMERA_INFO, stamp_ns, info)

    def _put(self, topic: str, type_name: str, stamp_ns: int, message) -> None:
        self._bag.add_topic(topic, type_name, OfferedQos(), message_type(type_name))
        self._bag.put(topic, stamp_ns, serialize_message(message))

    @property
    def problem(self) -> str:
        """Why nothing can be written any more; empty if it can."""
        return self._bag.problem

    @property
    def written(self) -> int:
        """Messages in the bag."""
        return sum(self._bag.written.values())

    @property
    def dropped(self) -> int:
        """Messages for which the disk was too slow."""
        return sum(self._bag.dropped.values())

    def abandon(self) -> None:
        """Leave out what waits."""
        self._bag.abandon()

    def close(self) -> None:
        """Write what waits, and the bag's index.

        Raises
        ------
        TrackerError : the disk is full, or the like.
        """
        self._bag.close()


def _encoding(pixels: np.ndarray, bayer: str | None) -> str:
    if pixels.ndim == 3:
        return "bgr8"
    return f"bayer_{bayer}8" if bayer else "mono8"
