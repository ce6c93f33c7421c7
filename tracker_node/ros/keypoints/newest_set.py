"""The newest image set of ROS cameras, matched as a tracker matches its own; older ones are dropped and counted."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from ...errors import TrackerError
from ...observation.image_set import ImageSet
from ...runs.set_formation import SetFormation
from ...tracking.config import SynchronizerConfig
from ..conversions import bgr_of_compressed, decode_raw_image
from ..diagnostics import QosMismatches
from ..qos import LIVE_IMAGES, overridable


class NewestSet:
    """Subscriptions to ``<cam>/image_raw``; one thread of the node's own takes.

    Parameters
    ----------
    node : subscribes.
    cameras : names, in the order of the rig.
    config : how images are matched.
    compressed : JPEG images instead of raw ones.
    mismatches : is informed when a publisher offers what we cannot take.

    Attributes
    ----------
    formed, dropped : image sets, and those of them that a newer one has replaced.
    problems : camera -> why its latest image cannot be used.
    """

    def __init__(
        self, node: Node, cameras: Sequence[str], config: SynchronizerConfig, compressed: bool, mismatches: QosMismatches
    ):
        self._formation = SetFormation(tuple(cameras), config)
        self._condition = threading.Condition()
        self._newest: ImageSet | None = None
        self.formed = self.dropped = 0
        self.problems: dict[str, str] = {}
        kind, topic = (CompressedImage, "image_raw/compressed") if compressed else (Image, "image_raw")
        for camera in cameras:
            name = f"{camera}/{topic}"
            node.create_subscription(
                kind, name, partial(self._add, camera), **overridable(LIVE_IMAGES),
                event_callbacks=mismatches.of_subscription(camera, name), raw=kind is Image,
            )  # fmt: skip

    def _add(self, camera: str, data: Any) -> None:
        """``data``: a serialized image, or a compressed one."""
        try:
            image = bgr_of_compressed(camera, data) if isinstance(data, CompressedImage) else decode_raw_image(camera, data)
        except TrackerError as error:
            self.problems[camera] = str(error)
            return
        self.problems.pop(camera, None)
        for image_set in self._formation.add(image):
            with self._condition:
                self.formed += 1
                self.dropped += self._newest is not None
                self._newest = image_set
                self._condition.notify()

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Camera -> what became of its images."""
        return self._formation.counters

    def take(self, timeout_s: float) -> ImageSet | None:
        """The newest set, once; waits for one if there is none, and returns None if none comes."""
        with self._condition:
            if self._newest is None:
                self._condition.wait(timeout=timeout_s)
            taken, self._newest = self._newest, None
            return taken

    def wake(self) -> None:
        """Let `take` return at once."""
        with self._condition:
            self._condition.notify()
