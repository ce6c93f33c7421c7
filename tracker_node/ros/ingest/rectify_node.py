"""Images without distortion, for programs that cannot do without: ``<camera>/image_rect`` from ``image_raw`` and ``camera_info``.

The tracker has no use for it: distortion is part of its projection. An image is worked on only while somebody listens.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image

from ...camera.model import CameraModel
from ...errors import TrackerError
from ...observation.small_view import straight_maps
from ...runs.messages import lens_of
from ..conversions import camera_image_of, image_message, stamp_ns_of
from ..guarded_node import GuardedNode
from ..qos import SENSOR, images_published


class RectifyNode(GuardedNode):
    """Serves the cameras of the given names."""

    def __init__(self, cameras: Sequence[str]):
        super().__init__("rectify")
        self.rectifiers = [_Rectifier(self, name) for name in cameras]


class _Rectifier:
    """One camera. As ROS has it (REP 104), ``image_rect`` is the image of a pinhole camera K', P = [K' 0] of ``camera_info``."""

    def __init__(self, node: Node, name: str):
        self._node, self._name = node, name
        self._info: CameraInfo | None = None
        self._maps: tuple[np.ndarray, np.ndarray] | None = None
        self._size = (0, 0)
        self._publisher = node.create_publisher(Image, f"{name}/image_rect", images_published())
        node.create_subscription(CameraInfo, f"{name}/camera_info", self._on_info, SENSOR)
        node.create_subscription(Image, f"{name}/image_raw", self._on_image, SENSOR)

    def _on_info(self, info: CameraInfo) -> None:
        if self._info is not None and _same_lens(info, self._info):
            return
        self._info, self._maps = info, None
        try:
            model = lens_of(self._name, info)
        except TrackerError as error:
            self._node.get_logger().error(str(error))
            return
        self._size = (model.width, model.height)
        self._maps = cv2.convertMaps(*straight_maps(model, _projection_of(info, model)), cv2.CV_16SC2)

    def _on_image(self, message: Image) -> None:
        if self._maps is None or not self._publisher.get_subscription_count():
            return
        try:
            image = camera_image_of(self._name, message)
        except TrackerError as error:
            self._node.get_logger().error(str(error), throttle_duration_sec=5.0)
            return
        if image.pixels.shape[1::-1] != self._size:
            problem = f"{self._name}: an image of {image.pixels.shape[1::-1]}, camera_info is for {self._size}"
            self._node.get_logger().error(problem, throttle_duration_sec=5.0)
            return
        straight = cv2.remap(image.pixels, *self._maps, cv2.INTER_LINEAR)
        stamp_ns = stamp_ns_of(message.header.stamp)
        self._publisher.publish(image_message(stamp_ns, message.header.frame_id, straight, image.encoding))


def _projection_of(info: CameraInfo, model: CameraModel) -> np.ndarray:
    """K' (3, 3) that ``camera_info`` states; K itself where it states none, or for images that are cropped or binned."""
    K = np.array(info.p).reshape(3, 4)[:, :3]
    cropped = info.roi.width or info.roi.height or info.binning_x > 1 or info.binning_y > 1
    return model.K if cropped or K[0, 0] <= 0.0 or K[1, 1] <= 0.0 else K


def _same_lens(a: CameraInfo, b: CameraInfo) -> bool:
    fields = ("width", "height", "distortion_model", "binning_x", "binning_y", "roi")
    same_arrays = all(np.array_equal(getattr(a, field), getattr(b, field)) for field in ("k", "d", "p"))
    return same_arrays and all(getattr(a, field) == getattr(b, field) for field in fields)
