"""The receiving end of the cameras: callbacks only enqueue, one thread of the node's own takes."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ...observation.image_set import CameraImage
from ..conversions import bgr_of_compressed, decode_raw_image, raw_stamp_ns, stamp_ns_of
from ..diagnostics import QosMismatches
from ..direct_images import DirectImages
from ..qos import SequenceGaps, images_subscribed, overridable, with_number

MOST_BYTES = 2 * 2**30  # some 39 s of two cameras of 640x480 at 30 Hz


@dataclass(frozen=True)
class Received:
    """An image as it came: serialized, compressed, or, from a node of this process, as it is."""

    camera: str
    content: bytes | CompressedImage | CameraImage

    @property
    def size(self) -> int:
        """Bytes."""
        if isinstance(self.content, CameraImage):
            return self.content.pixels.nbytes
        return len(self.content.data if isinstance(self.content, CompressedImage) else self.content)

    @property
    def stamp_ns(self) -> int | None:
        """Of the image; None where its bytes are no image."""
        if isinstance(self.content, CameraImage):
            return self.content.stamp_ns
        if isinstance(self.content, CompressedImage):
            return stamp_ns_of(self.content.header.stamp)
        return raw_stamp_ns(self.content)

    def decode(self) -> CameraImage:
        """The pixels; of a raw image a view. Raises SourceError when they cannot be used."""
        if isinstance(self.content, CameraImage):
            return self.content
        if isinstance(self.content, CompressedImage):
            return bgr_of_compressed(self.camera, self.content)
        return decode_raw_image(self.camera, self.content)


@dataclass(frozen=True)
class InboxOptions:
    """How images are subscribed to.

    Parameters
    ----------
    lossless : reliable, and nothing is thrown away here below ``most_bytes``; otherwise the newest images as they come.
    compressed : JPEG images instead of raw ones.
    capacity : images per camera that may wait, unless lossless.
    most_bytes : of images that may wait if lossless; those that come then are thrown away, which is an error.
    direct : where images of this process are handed over; the cameras that it has are not subscribed to.
    """

    lossless: bool = False
    compressed: bool = False
    capacity: int = 30
    most_bytes: int = MOST_BYTES
    direct: DirectImages | None = None


class ImageInbox:
    """Subscriptions to ``<cam>/image_raw`` and ``<cam>/camera_info`` and the images that wait.

    Parameters
    ----------
    mismatches : is informed when a publisher offers what we cannot take.
    on_image : told of each image that waits, by camera and stamp.

    Attributes
    ----------
    arrived : camera -> images received.
    overflowed : camera -> images thrown away because too many waited.
    lost : camera -> images that were sent and did not arrive, or were replaced by newer ones before we took them.
    infos : camera -> its latest calibration message.
    last_arrival_s : camera -> steady time of its latest image.
    """

    def __init__(
        self,
        node: Node,
        cameras: Sequence[str],
        options: InboxOptions,
        mismatches: QosMismatches,
        on_image: Callable[[str, int], None] = lambda camera, stamp_ns: None,
    ):
        self._node, self._options, self._mismatches, self._on_image = node, options, mismatches, on_image
        self._condition = threading.Condition()
        self._waiting: deque[Received] = deque()
        self._n_waiting = dict.fromkeys(cameras, 0)
        self._bytes_waiting = 0
        self._subscriptions: dict[str, list[Subscription]] = {}
        self.arrived = dict.fromkeys(cameras, 0)
        self.overflowed = dict.fromkeys(cameras, 0)
        self.lost = dict.fromkeys(cameras, 0)
        self.infos: dict[str, CameraInfo] = {}
        self.last_arrival_s: dict[str, float] = {}

    def subscribe(self, cameras: Collection[str]) -> None:
        """Listen to these cameras and to no others."""
        for camera in [name for name in self._subscriptions if name not in cameras]:
            for subscription in self._subscriptions.pop(camera):
                self._node.destroy_subscription(subscription)
            if self._options.direct is not None:
                self._options.direct.leave(camera)
            self.last_arrival_s.pop(camera, None)
            self.infos.pop(camera, None)
        for camera in cameras:
            if camera not in self._subscriptions:
                self._subscriptions[camera] = self._subscribed(camera)

    def _subscribed(self, camera: str) -> list[Subscription]:
        images: list[Subscription] = []  # none while it is being made, when an image may already come
        gaps = SequenceGaps(lambda: sum(each.get_publisher_count() for each in images))
        lost_before = self.lost[camera]  # by earlier subscriptions

        def enqueue(content, number: int | None) -> None:
            gaps.came(number)
            self.lost[camera] = lost_before + gaps.lost
            self._enqueue(Received(camera, content))

        def remember(info: CameraInfo) -> None:
            with self._condition:
                self.infos[camera] = info
                self._condition.notify()

        qos, create, direct = images_subscribed(self._options.lossless), self._node.create_subscription, self._options.direct
        # One that is lost is no matter, the next one says the same.
        calibration = create(CameraInfo, f"{camera}/camera_info", remember, images_subscribed(False))
        if direct is not None and camera in direct.cameras:
            direct.listen(camera, lambda image: self._enqueue(Received(camera, image)))
            return [calibration]
        topic, kind = f"{camera}/image_raw", Image
        if self._options.compressed:
            topic, kind = f"{topic}/compressed", CompressedImage
        self._mismatches.of_subscription(camera, topic)
        images.append(create(kind, topic, with_number(enqueue), **overridable(qos), raw=kind is Image))
        return [*images, calibration]

    def _enqueue(self, received: Received) -> None:
        camera = received.camera
        with self._condition:
            self.last_arrival_s[camera] = time.monotonic()
            self.arrived[camera] += 1
            if self._options.lossless and self._bytes_waiting + received.size > self._options.most_bytes:
                self.overflowed[camera] += 1
                return
            if not self._options.lossless and self._n_waiting[camera] >= self._options.capacity:
                self._drop_oldest(camera)
            if (stamp_ns := received.stamp_ns) is not None:
                self._on_image(camera, stamp_ns)  # before it can be taken
            self._waiting.append(received)
            self._n_waiting[camera] += 1
            self._bytes_waiting += received.size
            self._condition.notify()

    def _drop_oldest(self, camera: str) -> None:
        oldest = next(i for i, received in enumerate(self._waiting) if received.camera == camera)
        self._bytes_waiting -= self._waiting[oldest].size
        del self._waiting[oldest]
        self._n_waiting[camera] -= 1
        self.overflowed[camera] += 1

    def take(self, timeout_s: float) -> list[Received]:
        """All images that wait, in the order of their arrival; waits for one if there is none."""
        with self._condition:
            if not self._waiting:
                self._condition.wait(timeout=timeout_s)
            taken = list(self._waiting)
            self._waiting.clear()
            self._bytes_waiting = 0
            self._n_waiting = dict.fromkeys(self._n_waiting, 0)
            return taken

    @property
    def waiting(self) -> int:
        """Images that have come and have not been taken."""
        return len(self._waiting)

    @property
    def most_bytes(self) -> int | None:
        """Of images that may wait; None where they are counted instead."""
        return self._options.most_bytes if self._options.lossless else None

    def wake(self) -> None:
        """Let `take` return at once."""
        with self._condition:
            self._condition.notify()
