"""CameraInfo there and back, and the calibrations that are refused."""

import numpy as np
import pytest

pytest.importorskip("rclpy")
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo

from tracker_node.camera.camera_model import CameraModel
from tracker_node.errors import CalibrationError
from tracker_node.ros.conversions import camera_info_message, camera_model_of

K = np.array([[600.0, 0.5, 319.0], [0.0, 610.0, 241.0], [0.0, 0.0, 1.0]])
LENSES = [
    ("none", []),
    ("plumb_bob", [0.1, -0.2, 0.001, 0.002]),
    ("plumb_bob", [0.1, -0.2, 0.001, 0.002, 0.03]),
    ("rational_polynomial", [0.1, -0.2, 0.001, 0.002, 0.03, 0.04, 0.05, 0.06]),
    ("equidistant", [0.01, -0.02, 0.003, 0.0]),
]


def sent(message: CameraInfo) -> CameraInfo:
    return deserialize_message(serialize_message(message), CameraInfo)


@pytest.mark.parametrize(("name", "coefficients"), LENSES)
def test_there_and_back_projects_alike(name: str, coefficients: list[float]):
    lens = CameraModel(640, 480, K, name, np.array(coefficients))
    back = camera_model_of("left", sent(camera_info_message(5, "left_optical_frame", lens)))
    assert (back.width, back.height) == (640, 480)
    assert np.array_equal(back.K, K)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1.5], [0.5, 0.4, 3.0], (50, 3))
    assert np.array_equal(back.project(points)[0], lens.project(points)[0])  # bit for bit


def test_header_and_projection_matrix():
    message = sent(camera_info_message(5_000_000_006, "left_optical_frame", CameraModel(640, 480, K)))
    assert message.header.frame_id == "left_optical_frame"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 6)
    assert message.distortion_model == "plumb_bob" and list(message.d) == [0.0] * 5
    assert np.array_equal(np.array(message.p).reshape(3, 4)[:, :3], K)


def test_uncalibrated_is_refused():
    with pytest.raises(CalibrationError, match=r"left.*K\[0\] = 0"):
        camera_model_of("left", CameraInfo(width=640, height=480))


def test_unknown_distortion_is_refused_with_the_known_ones():
    message = camera_info_message(0, "f", CameraModel(640, 480, K))
    message.distortion_model, message.d = "thin_prism", [1.0]
    with pytest.raises(CalibrationError, match=r"left.*equidistant.*thin_prism"):
        camera_model_of("left", message)


def test_region_and_binning_are_folded_into_K():
    lens = CameraModel(640, 480, K, "plumb_bob", np.array([0.1, -0.2, 0.001, 0.002]))
    message = camera_info_message(0, "f", lens)
    message.roi.x_offset, message.roi.y_offset, message.roi.width, message.roi.height = 100, 60, 400, 320
    message.binning_x = message.binning_y = 2
    cut = camera_model_of("left", message)
    assert (cut.width, cut.height) == (200, 160)
    points = np.random.default_rng(0).uniform([-0.3, -0.2, 1.5], [0.3, 0.2, 3.0], (50, 3))
    full_px, cut_px = lens.project(points)[0], cut.project(points)[0]
    # A binned pixel's centre lies between the centres of the two it was made of.
    assert np.allclose(cut_px, (full_px - [100, 60] + 0.5) / 2 - 0.5, atol=1e-9)
