"""Live cameras, devices and topics of other nodes: a thread takes the images as they come, and one publishes them."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image

from ...errors import SourceError, TrackerError
from ...loaders.bag.images import COMPRESSED, RAW
from ...loaders.bag.metadata import OfferedQos
from ...loaders.decoding import Preparation, SourceImage, bayer_pattern, content_size, is_plain_jpeg
from ...loaders.images.feed import is_repetition
from ...loaders.images.live_capture import Connection
from ...loaders.images.recorded_source import SourceOptions
from ...loaders.images.stamps import common_ns
from ...observation.deinterlace import deinterlace
from ..conversions import bgr_of_compressed, camera_image_of, stamp_ns_of
from ..qos import offered_qos, qos_profile
from .cameras import IngestCamera, check_size
from .outlet import CameraCounts

_INTERVALS = 15  # between images, of which the median is their period
WAITING = 3  # images that may wait to be published; then the oldest is dropped and counted


class LiveImages(Protocol):
    """What `LiveSource` and `TopicSource` are."""

    connection: Connection

    def close(self) -> None: ...

    def __iter__(self) -> Iterator[tuple[int, np.ndarray | bytes]]: ...


class LiveCamera:
    """Takes, prepares and publishes the images of one camera.

    Parameters
    ----------
    camera : its lens is compared with the images' size.
    source : its images.
    options : size, and whether originals are kept.
    publish : called in a thread of this camera's own with each image and the size (width, height) that it has in the source.
    record : called before, with the stamp and the image as it came.

    Attributes
    ----------
    counts : what became of the images.
    problem : why images are not published, as of the latest image; empty if they are.
    """

    def __init__(
        self,
        camera: IngestCamera,
        source: LiveImages,
        options: SourceOptions,
        publish: Callable[[SourceImage, tuple[int, int]], None],
        record: Callable[[int, np.ndarray | bytes], None] = lambda stamp_ns, content: None,
    ):
        self._camera, self.source, self._options = camera, source, options
        self._publish, self._record = publish, record
        self.counts, self.problem = CameraCounts(), ""
        self._waiting: deque[tuple[int, np.ndarray | bytes]] = deque()
        self._condition = threading.Condition()
        self._ended = False
        self._before: SourceImage | None = None
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._intervals_ns: deque[int] = deque(maxlen=_INTERVALS)
        self._preparation: Preparation | None = None
        self._prepared_for: tuple[tuple[int, int], str | None] = ((0, 0), None)
        self._threads = [
            threading.Thread(target=target, name=f"{what} {camera.name}", daemon=True)
            for target, what in ((self._take, "read"), (self._publish_all, "publish"))
        ]

    def start(self) -> None:
        """Begin."""
        for thread in self._threads:
            thread.start()

    def close(self, timeout_s: float = 10.0) -> None:
        """End both threads; what waits is published first."""
        self.source.close()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(timeout=timeout_s)

    def _take(self) -> None:
        for item in self.source:
            with self._condition:
                if len(self._waiting) >= WAITING:
                    self._waiting.popleft()
                    self.counts.dropped += 1
                self._waiting.append(item)
                self._condition.notify()
        with self._condition:
            self._ended = True
            self._condition.notify()

    def _publish_all(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: bool(self._waiting) or self._ended)
                if not self._waiting:
                    return
                own_ns, content = self._waiting.popleft()
            try:
                self._handle(self._common(own_ns), content)
                self.problem = ""
            except TrackerError as error:
                self.counts.unusable += 1
                self.problem = str(error)
            except Exception as error:  # a decoder's own failure must not end the camera
                self.counts.unusable += 1
                self.problem = f"{type(error).__name__}: {error}"

    def _common(self, own_ns: int) -> int:
        self._first_ns = own_ns if self._first_ns is None else self._first_ns
        of_rig = self._camera.of_rig
        return own_ns if of_rig is None else common_ns(own_ns, self._first_ns, of_rig.time_offset_ns, of_rig.time_drift_ppm)

    def _handle(self, stamp_ns: int, content: np.ndarray | bytes) -> None:
        native_size = content_size(content)
        check_size(self._camera, native_size)
        self._record(stamp_ns, content)
        preparation = self._prepared(native_size)
        for at_ns, part in self._fields(stamp_ns, content, preparation):
            image = preparation.image(at_ns, part)
            self.counts.duplicated += self._before is not None and is_repetition(self._before, image)
            self._before = image
            self._publish(image, native_size)
            self.counts.published += 1
        self._last_ns = stamp_ns

    def _prepared(self, native_size: tuple[int, int]) -> Preparation:
        bayer = self._camera.capture.bayer or self.source.connection.bayer
        if self._preparation is None or self._prepared_for != (native_size, bayer):
            size = self._options.output_size(*native_size)
            settings = replace(self._camera.capture, bayer=bayer)
            self._preparation = Preparation(settings, size if size != native_size else None, self._camera.address.shown)
            self._prepared_for = native_size, bayer
        return self._preparation

    def _fields(
        self, stamp_ns: int, content: np.ndarray | bytes, preparation: Preparation
    ) -> Iterable[tuple[int, np.ndarray | bytes]]:
        """The image, or its two fields, the second half a period after the first."""
        order = self._camera.interlaced
        if order is None:
            return [(stamp_ns, content)]
        woven = replace(preparation, size=None).image(stamp_ns, content).bgr
        earlier, later = deinterlace(woven, order)
        period_ns = self._period_ns(stamp_ns)
        if not period_ns:
            self.counts.unstamped += 1  # when the second field was exposed is not known before the second image
            return [(stamp_ns, earlier)]
        return [(stamp_ns, earlier), (stamp_ns + period_ns // 2, later)]

    def _period_ns(self, stamp_ns: int) -> int:
        if self._camera.capture.rate_hz is not None:
            return round(1e9 / self._camera.capture.rate_hz)
        if self._last_ns is not None:
            self._intervals_ns.append(stamp_ns - self._last_ns)
        return int(np.median(self._intervals_ns)) if self._intervals_ns else 0  # a dropped image makes one interval longer


_LOOK_S = 0.2
_DEPTH = 10
_SILENT_S = 4.0  # from then on a topic that is published, but gives nothing, is reported as a problem


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
            return stamp_ns, data if is_plain_jpeg(data, message.format) else bgr_of_compressed(self._topic, message).pixels
        self.connection.bayer = bayer_pattern(message.encoding)
        if self.connection.bayer:
            message.encoding = "mono8"
        image = camera_image_of(self._topic, message)
        return stamp_ns, image.pixels if image.encoding == "mono8" else np.ascontiguousarray(image.bgr)
