"""Another node's images as a source."""

from __future__ import annotations

import queue
from collections.abc import Iterator

import numpy as np
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image

from ..errors import SourceError
from ..loaders.bag_images import COMPRESSED, RAW
from ..loaders.bag_metadata import OfferedQos
from ..loaders.live_source import Connection
from ..loaders.source_image import bayer_pattern
from .conversions import bgr_of_compressed, camera_image_of, stamp_ns_of
from .message_classes import offered_qos, qos_profile

_LOOK_S = 0.2
_DEPTH = 10


class TopicSource:
    """Images of a topic, raw, or compressed where its name ends with ``/compressed``, until it is closed.

    It is subscribed to when somebody publishes it, with the quality of service that is offered; a publisher that vanishes is
    waited for. Images that cannot be used are left out, and `connection` says why.

    Parameters
    ----------
    own_clock : stamps are the times of arrival instead of those in the messages.
    """

    def __init__(self, node: Node, topic: str, own_clock: bool = False):
        self._node, self._topic, self._own_clock = node, node.resolve_topic_name(topic), own_clock
        self._type_name = COMPRESSED if self._topic.endswith("/compressed") else RAW
        self._queue: queue.SimpleQueue = queue.SimpleQueue()
        self._subscription: Subscription | None = None
        self.connection = Connection(problem=f"nobody publishes {self._topic}")
        self._timer = node.create_timer(_LOOK_S, self._look)

    def close(self) -> None:
        """End the iteration, from any thread."""
        self._queue.put(None)

    def __iter__(self) -> Iterator[tuple[int, np.ndarray | bytes]]:
        while (item := self._queue.get()) is not None:
            arrival_ns, message = item
            try:
                stamp_ns, content = self._content(message)
            except SourceError as error:
                self.connection.problem = str(error)
                continue
            self.connection.problem = ""
            self.connection.received += 1
            yield arrival_ns if self._own_clock else stamp_ns, content

    def _look(self) -> None:
        """Whether somebody publishes; the first time, subscribe."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        if not publishers:
            self.connection.connected, self.connection.problem = False, f"nobody publishes {self._topic}"
            return
        types = sorted({publisher.topic_type for publisher in publishers})
        if types != [self._type_name]:
            self.connection.problem = f"{self._topic}: expected {self._type_name}, it is published as {', '.join(types)}"
            return
        if self._subscription is None:
            offered = offered_qos([publisher.qos_profile for publisher in publishers])
            qos = qos_profile(OfferedQos(offered.reliability, "volatile", "keep_last", _DEPTH))
            class_ = CompressedImage if self._type_name == COMPRESSED else Image
            self._subscription = self._node.create_subscription(class_, self._topic, self._on_image, qos)
        if not self.connection.connected:
            self.connection.connected, self.connection.problem = True, ""
            self.connection.times += 1

    def _on_image(self, message: Image | CompressedImage) -> None:
        self._queue.put((self._node.get_clock().now().nanoseconds, message))

    def _content(self, message: Image | CompressedImage) -> tuple[int, np.ndarray | bytes]:
        stamp_ns = stamp_ns_of(message.header.stamp)
        if isinstance(message, CompressedImage):
            data = bytes(message.data)
            return stamp_ns, data if data[:2] == b"\xff\xd8" else bgr_of_compressed(self._topic, message).pixels
        self.connection.bayer = bayer_pattern(message.encoding)
        if self.connection.bayer:
            message.encoding = "mono8"
        image = camera_image_of(self._topic, message)
        return stamp_ns, image.pixels if image.encoding == "mono8" else np.ascontiguousarray(image.bgr)
