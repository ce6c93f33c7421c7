"""Messages made without ROS: there and back, and the same as the nodes make them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from helpers.ros.samples import arm, small_rig, some_estimate, tracked_arm
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.errors import CalibrationError
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.observation.image_set import ImageSet
from tracker_node.runs import messages
from tracker_node.runs.writer import RunWriter
from tracker_node.tracking.estimate import Status

LENSES = {
    "none": np.zeros(0),
    "plumb_bob": np.array([-0.3, 0.1, 0.002, -0.001]),
    "rational_polynomial": np.linspace(-0.2, 0.2, 8),
    "equidistant": np.array([0.05, -0.01, 0.002, 0.001]),
}


def there_and_back(message: Any) -> Any:
    """Through bytes, as a bag would."""
    data = typestore().serialize_cdr(message, message.__msgtype__)
    return typestore().deserialize_cdr(data, message.__msgtype__)


def camera(lens: str) -> Camera:
    K = np.array([[500.0, 0.5, 320.25], [0.0, 510.0, 239.5], [0.0, 0.0, 1.0]])
    return Camera("cam01", CameraModel(640, 480, K, lens, LENSES[lens]), np.eye(4))


def test_an_estimate_survives() -> None:
    before = some_estimate(arm())
    after = messages.estimate_of(there_and_back(messages.tracked_state_message(before, arm(), "world")))
    for name in (
        "stamp_ns",
        "status",
        "status_reason",
        "score",
        "residual_px",
        "cameras",
        "iterations",
        "evaluations",
        "timings",
        "limbs",
    ):
        assert getattr(after, name) == getattr(before, name), name
    assert (after.covariance == before.covariance).all()
    assert (after.velocity == before.velocity).all()
    assert (after.velocity_covariance == before.velocity_covariance).all()
    assert (after.state.joint_positions == before.state.joint_positions).all()
    np.testing.assert_allclose(after.state.T_world_root, before.state.T_world_root, atol=1e-14)


def test_a_velocity_of_which_nothing_is_known_survives() -> None:
    before = replace(some_estimate(arm()), velocity_covariance=None)
    after = messages.estimate_of(there_and_back(messages.tracked_state_message(before, arm(), "world")))
    assert after.velocity_covariance is None


@pytest.mark.parametrize("lens", sorted(LENSES))
def test_a_lens_survives(lens: str) -> None:
    before = camera(lens).model
    after = messages.lens_of("cam01", there_and_back(messages.camera_info_message(7, camera(lens))))
    assert (after.width, after.height, after.distortion_model) == (640, 480, lens)
    assert (after.K == before.K).all()
    np.testing.assert_array_equal(after.distortion[: before.distortion.size], before.distortion)
    assert not after.distortion[before.distortion.size :].any()


def test_an_uncalibrated_camera_is_named() -> None:
    message = messages.camera_info_message(7, camera("none"))
    message.k = np.zeros(9)
    with pytest.raises(CalibrationError, match=r"cam01.*uncalibrated"):
        messages.lens_of("cam01", message)
    message = messages.camera_info_message(7, camera("none"))
    message.distortion_model, message.d = "kannala", np.ones(3)
    with pytest.raises(CalibrationError, match=r"cam01.*camera_info"):
        messages.lens_of("cam01", message)


def test_times_before_1970_have_no_negative_nanoseconds() -> None:
    time = messages.time_message(-1)
    assert (time.sec, time.nanosec) == (-1, 999_999_999)


def same(ours: Any, theirs: Any) -> None:
    """A message of rosbags and one of rclpy, field by field."""
    for name in theirs.get_fields_and_field_types():
        our_value, their_value = getattr(ours, name), getattr(theirs, name)
        if hasattr(their_value, "get_fields_and_field_types"):
            same(our_value, their_value)
        elif isinstance(their_value, list) and their_value and hasattr(their_value[0], "get_fields_and_field_types"):
            assert len(our_value) == len(their_value)
            for our_item, their_item in zip(our_value, their_value, strict=True):
                same(our_item, their_item)
        else:
            assert np.array_equal(np.array(our_value), np.array(their_value)), name


def test_nodes_and_offline_runs_make_the_same_messages() -> None:
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from tracker_node.ros import conversions

    model, estimate = arm(), some_estimate(arm())
    same(messages.tracked_state_message(estimate, model, "world"), conversions.tracked_state_message(estimate, model, "world"))
    same(messages.pose_message(estimate, "world"), conversions.pose_message(estimate, "world"))
    same(messages.joint_state_message(estimate, model, "world"), conversions.joint_state_message(estimate, model, "world"))
    for lens in LENSES:
        cam = camera(lens)
        same(messages.camera_info_message(5, cam), conversions.camera_info_message(5, cam.frame_id, cam.model))
        ours, theirs = messages.camera_info_message(5, cam), conversions.camera_info_message(5, cam.frame_id, cam.model)
        live, offline = conversions.camera_model_of("cam01", theirs), messages.lens_of("cam01", ours)
        assert (live.K == offline.K).all()
        assert np.array_equal(live.distortion, offline.distortion)
    pixels = np.random.default_rng(1).integers(0, 256, (6, 5), dtype=np.uint8)
    same(messages.image_message(5, "c", pixels, "mono8"), conversions.image_message(5, "c", pixels, "mono8"))
    color = np.random.default_rng(1).integers(0, 256, (6, 5, 3), dtype=np.uint8)
    same(messages.image_message(5, "c", color, "bgr8"), conversions.image_message(5, "c", color, "bgr8"))


def test_what_cannot_say_that_it_is_wrong_is_not_written_while_the_body_is_not_known(tmp_path):
    """As the node does."""
    rig, model = small_rig(tmp_path), tracked_arm()
    statuses = [Status.INITIALISING, Status.TRACKING, Status.LOST, Status.DEGRADED]
    with RunWriter(tmp_path / "run", rig, model) as writer:
        for i, status in enumerate(statuses):
            writer.append(replace(some_estimate(model, i), status=status), ImageSet(i, ()))
    with BagReader(tmp_path / "run/bag") as reader:
        stamps = {end: [stamp for stamp, _ in reader.decoded(f"/tracker/{end}")] for end in ("state", "pose", "joint_states")}
    assert stamps == {"state": [0, 1, 2, 3], "pose": [1, 3], "joint_states": [1, 3]}
