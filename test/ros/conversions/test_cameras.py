"""CameraInfo there and back, and the calibrations that are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy")
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo

from tracker_node.camera.model import CameraModel
from tracker_node.errors import CalibrationError
from tracker_node.ros.conversions import camera_info_message
from tracker_node.ros.tracker.camera_diagnostics import compared_lenses
from tracker_node.runs.messages import lens_of

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
    back = lens_of("left", sent(camera_info_message(5, "left_optical_frame", lens)))
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
        lens_of("left", CameraInfo(width=640, height=480))


def test_coefficients_of_prisms_and_tilts_that_are_zero_are_none():
    eight = [0.1, -0.2, 0.001, 0.002, 0.03, 0.04, 0.05, 0.06]
    message = camera_info_message(0, "f", CameraModel(640, 480, K, "rational_polynomial", np.array(eight)))
    for n in (12, 14):
        message.d = [*eight, *[0.0] * (n - 8)]
        assert lens_of("left", message).distortion.tolist() == eight
        message.d = [*eight, *[0.0] * (n - 9), 1e-3]
        with pytest.raises(CalibrationError, match=f"rational_polynomial' with {n}"):
            lens_of("left", message)


def test_unknown_distortion_is_refused_with_the_known_ones():
    message = camera_info_message(0, "f", CameraModel(640, 480, K))
    message.distortion_model, message.d = "thin_prism", [1.0]
    with pytest.raises(CalibrationError, match=r"left.*equidistant.*thin_prism"):
        lens_of("left", message)


def test_region_and_binning_are_folded_into_K():
    lens = CameraModel(640, 480, K, "plumb_bob", np.array([0.1, -0.2, 0.001, 0.002]))
    message = camera_info_message(0, "f", lens)
    message.roi.x_offset, message.roi.y_offset, message.roi.width, message.roi.height = 100, 60, 400, 320
    message.binning_x = message.binning_y = 2
    cut = lens_of("left", message)
    assert (cut.width, cut.height) == (200, 160)
    points = np.random.default_rng(0).uniform([-0.3, -0.2, 1.5], [0.3, 0.2, 3.0], (50, 3))
    full_px, cut_px = lens.project(points)[0], cut.project(points)[0]
    # A binned pixel's center lies between the centers of the two it was made of.
    assert np.allclose(cut_px, (full_px - [100, 60] + 0.5) / 2 - 0.5, atol=1e-9)


sizes = st.one_of(st.sampled_from([0, 1, 2, 160, 640, 2**31, 2**32 - 1]), st.integers(0, 2**32 - 1))
numbers = st.one_of(st.sampled_from([0.0, 1.0, 600.0, float("nan"), float("inf"), 1e308]), st.floats())


@st.composite
def camera_infos(draw) -> CameraInfo:
    """A good message of which any field may be anything."""
    model = CameraModel(640, 480, K, "plumb_bob", np.array([0.1, -0.2, 0.001, 0.002]))
    message = camera_info_message(0, "f", model)
    changes = {name: draw(sizes) for name in ("width", "height", "binning_x", "binning_y") if draw(st.booleans())}
    for name, value in changes.items():
        setattr(message, name, value)
    for name in ("x_offset", "y_offset", "width", "height"):
        if draw(st.booleans()):
            setattr(message.roi, name, draw(sizes))
    for i in draw(st.lists(st.integers(0, 8), max_size=3)):
        message.k[i] = draw(numbers)
    if draw(st.booleans()):
        message.distortion_model = draw(st.sampled_from(["", "plumb_bob", "rational_polynomial", "equidistant", "fisheye", "x"]))
        message.d = draw(st.lists(numbers, max_size=9))
    return message


@given(camera_infos())
@settings(max_examples=150, deadline=None)
def test_every_message_is_a_lens_or_refused_in_words(message: CameraInfo):
    try:
        lens = lens_of("left", message)
    except CalibrationError as error:
        assert "left" in str(error) and "\n" not in str(error)
    else:
        assert 1 <= lens.width <= 16384 and 1 <= lens.height <= 16384 and np.isfinite(lens.K).all()
    level, said = compared_lenses("left", message, CameraModel(640, 480, K))
    assert level in (b"\x00", b"\x01") and said


@pytest.mark.parametrize(
    "changes",
    [{"binning_x": 200, "width": 160}, {"width": 0, "binning_x": 3}, {"height": 0}, {"width": 2**32 - 1}],
)
def test_images_without_pixels_or_too_large_are_refused(changes: dict[str, int]):
    message = camera_info_message(0, "f", CameraModel(640, 480, K))
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(CalibrationError, match=r"left.*expected images of 1 to 16384 pixels on each side, got"):
        lens_of("left", message)


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("x_offset", 2**32 - 1, "roi: expected a part of the 640x480 image"),
        ("y_offset", 1, "roi: expected a part"),
        ("fx", 1e-300, "fx: expected 6.4 to 640000, got 1e-300"),
        ("fy", 1e8, "fy: expected"),
        ("cx", 7000.0, "cx: expected -6400 to 6400, got 7000"),
        ("d", 1e200, "distortion coefficient 1: expected"),
        ("distortion_model", "x" * 3000, "distortion in camera_info"),
    ],
)
def test_numbers_that_no_lens_has_are_refused(field, value, named):
    lens = CameraModel(640, 480, K, "plumb_bob", np.array([0.1, -0.2, 0.001, 0.002, 0.03]))
    message = camera_info_message(5, "left_optical_frame", lens)
    if field.endswith("offset"):
        setattr(message.roi, field, value)
    elif field in ("fx", "fy", "cx"):
        message.k[{"fx": 0, "fy": 4, "cx": 2}[field]] = value
    elif field == "d":
        message.d[0] = value
    else:
        message.distortion_model = value
    with pytest.raises(CalibrationError, match="camera 'left'") as refused:
        lens_of("left", sent(message))
    assert named in str(refused.value) and len(str(refused.value)) < 700
