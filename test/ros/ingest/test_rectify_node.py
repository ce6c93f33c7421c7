"""``image_rect``: against OpenCV's own undistortion, over a real graph."""

import cv2
import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="ROS is not installed")

from sensor_msgs.msg import CameraInfo, Image  # noqa: E402

from tracker_node.camera.model import CameraModel  # noqa: E402
from tracker_node.observation.small_view import straight_maps  # noqa: E402
from tracker_node.ros.conversions import camera_image_of, camera_info_message, image_message  # noqa: E402
from tracker_node.ros.ingest.rectify_node import RectifyNode  # noqa: E402
from tracker_node.ros.qos import RESULT, images_published  # noqa: E402

K = np.array([[300.0, 0.0, 161.0], [0.0, 305.0, 118.0], [0.0, 0.0, 1.0]])
LENSES = {
    "plumb_bob": CameraModel(320, 240, K, "plumb_bob", np.array([-0.2, 0.05, 0.001, -0.002, 0.01])),
    "rational_polynomial": CameraModel(320, 240, K, "rational_polynomial", np.array([0.2, 0.1, 0.001, 0.0, 0.0, 0.3, 0.1, 0.0])),
    "equidistant": CameraModel(320, 240, K, "equidistant", np.array([0.05, -0.01, 0.002, 0.0])),
}


def picture():
    coarse = np.random.default_rng(0).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    return cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_CUBIC)


def undistorted(lens, image):
    if lens.distortion_model == "equidistant":
        return cv2.fisheye.undistortImage(image, lens.K, lens.distortion, Knew=lens.K)
    return cv2.undistort(image, lens.K, lens.distortion)


@pytest.mark.parametrize("kind", LENSES)
def test_maps_undistort_as_opencv_does(kind):
    lens = LENSES[kind]
    straight = cv2.remap(picture(), *straight_maps(lens, lens.K), cv2.INTER_LINEAR)
    difference = np.abs(straight.astype(int) - undistorted(lens, picture()))[20:-20, 20:-20]
    assert difference.mean() < 0.5 and np.percentile(difference, 99) < 6


def test_images_come_out_straight_with_their_stamps(probe):
    lens = LENSES["plumb_bob"]
    node = RectifyNode(["cam01"])
    probe.add_node(node)
    infos = probe.node.create_publisher(CameraInfo, "cam01/camera_info", RESULT)
    images = probe.node.create_publisher(Image, "cam01/image_raw", images_published())
    received = probe.listen(Image, "cam01/image_rect")
    probe.spin_until(lambda: images.get_subscription_count() and infos.get_subscription_count(), "the node listens")

    def came() -> bool:
        infos.publish(camera_info_message(1, "cam01_optical_frame", lens))
        images.publish(image_message(1_000_000_007, "cam01_optical_frame", picture()))
        return bool(received)

    probe.spin_until(came, "a straight image")
    image = camera_image_of("cam01", received[0])
    assert (image.stamp_ns, received[0].header.frame_id, image.encoding) == (1_000_000_007, "cam01_optical_frame", "bgr8")
    difference = np.abs(image.pixels.astype(int) - undistorted(lens, picture()))[20:-20, 20:-20]
    assert difference.mean() < 0.5
    node.destroy_node()
