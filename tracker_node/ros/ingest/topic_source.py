"""Another node's images as a source."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from functools import partial

import numpy as np
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image

from ...errors import SourceError
from ...loaders.bag.images import COMPRESSED, RAW
from ...loaders.bag.metadata import OfferedQos
from ...loaders.decoding import bayer_pattern
from ...loaders.images.live_capture import Connection
from ..conversions import bgr_of_compressed, camera_image_of, stamp_ns_of
from ..message_classes import offered_qos, qos_profile

_LOOK_S = 0.2
_DEPTH = 10
_SILENT_S = 4.0  # from then on a topic that is published, but gives nothing, is told as a problem


class TopicSource:
    """Images of a topic, raw, or compressed where its name ends with ``/compressed``, until it is closed.

    It is subscribed to when somebody publishes it, with the quality of service that is offered, and anew when that changes; a
    publisher that vanishes is waited for. Images that cannot be used are left out, and `connection` says why.

    Parameters
    ----------
    own_clock : stamps are the times of arrival instead of those in the messages.
    """

    def __init__(self, node: Node, topic: str, own_clock: bool = False):
        self._node, self._topic, self._own_clock = node, node.resolve_topic_name(topic), own_clock
        self._type_name = COMPRESSED if self._topic.endswith("/compressed") else RAW
        self._queue: queue.SimpleQueue = queue.SimpleQueue()
        self._subscriptions: dict[str, Subscription] = {}  # by reliability; destroying one crashes the events executor
        self._reliability, self._last_s = "", 0.0  # that is offered; when the latest image came, or a publisher
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
        """Whether somebody publishes, and how; subscribe to that."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        if not publishers:
            self.connection.connected, self.connection.problem = False, f"nobody publishes {self._topic}"
            return
        types = sorted({publisher.topic_type for publisher in publishers})
        if types != [self._type_name]:
            self.connection.problem = f"{self._topic}: expected {self._type_name}, it is published as {', '.join(types)}"
            return
        reliability = offered_qos([publisher.qos_profile for publisher in publishers]).reliability
        if reliability != self._reliability:
            self._subscribe(reliability)
        if not self.connection.connected:
            self.connection.connected, self.connection.problem = True, ""
            self.connection.times += 1
            self._last_s = time.monotonic()
        elif time.monotonic() - self._last_s > _SILENT_S:
            self.connection.problem = f"{self._topic} is published, but nothing has come for {_SILENT_S:.0f} s"

    def _subscribe(self, reliability: str) -> None:
        self._reliability = reliability
        if reliability in self._subscriptions:
            return
        qos = qos_profile(OfferedQos(reliability, "volatile", "keep_last", _DEPTH))
        class_ = CompressedImage if self._type_name == COMPRESSED else Image
        on_image = partial(self._on_image, reliability)
        self._subscriptions[reliability] = self._node.create_subscription(class_, self._topic, on_image, qos)

    def _on_image(self, reliability: str, message: Image | CompressedImage) -> None:
        if reliability != self._reliability:
            return  # the other subscription has it too
        self._last_s = time.monotonic()
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
