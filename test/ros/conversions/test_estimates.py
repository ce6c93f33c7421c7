"""Estimates there and back through serialized messages."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy")
from geometry_msgs.msg import Pose, PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from tracker_msgs.msg import StateCovariance, TrackedState

from helpers.ros.estimates import estimate_of
from helpers.ros.samples import arm, some_estimate, some_state
from tracker_node.errors import TrackerError, UnknownNameError
from tracker_node.ros.conversions import message_of, stamp_ns_of, transform_of_pose, values_with_changes
from tracker_node.runs import messages


@pytest.fixture
def model():
    return arm()


def tracked_state_message(estimate, model):
    return message_of(TrackedState, messages.tracked_state(estimate, model, "world"))


def covariance_message(estimate, model):
    return message_of(StateCovariance, messages.state_covariance(estimate, model, "world"))


def sent(message):
    return deserialize_message(serialize_message(message), type(message))


def test_tracked_state_there_and_back(model):
    estimate = some_estimate(model)
    message = sent(tracked_state_message(estimate, model))
    assert isinstance(message, TrackedState) and message.header.frame_id == "world"
    assert message.dof_names == list(model.chain.dof_names)
    assert np.array_equal(np.array(message.values), estimate.state.to_values())  # bit for bit
    back = estimate_of(message, sent(covariance_message(estimate, model)))
    names = ("stamp_ns", "status", "status_reason", "score", "residual", "residual_unit", "cameras", "iterations", "evaluations")
    for name in (*names, "timings", "limbs"):
        assert getattr(back, name) == getattr(estimate, name)
    assert np.array_equal(back.covariance, estimate.covariance) and np.array_equal(back.velocity, estimate.velocity)
    assert np.array_equal(back.velocity_covariance, estimate.velocity_covariance)
    unknown = replace(estimate, velocity_covariance=None)
    assert not len(sent(covariance_message(unknown, model)).velocity_covariance)
    assert estimate_of(message, sent(covariance_message(unknown, model))).velocity_covariance is None
    assert np.allclose(back.state.T_world_root, estimate.state.T_world_root, atol=1e-12)
    assert np.array_equal(back.state.joint_positions, estimate.state.joint_positions)


def test_numpy_scalars_and_integers_arrive_as_what_they_are(model):
    """Unchecked message fields turn them into garbage."""
    fields = {**some_estimate(model).__dict__, "score": np.float32(1.5), "residual": 2, "iterations": np.int64(3)}
    message = sent(tracked_state_message(type(some_estimate(model))(**fields), model))
    assert (message.score, message.residual, message.iterations) == (1.5, 2.0, 3)


def test_pose_with_covariance(model):
    estimate = some_estimate(model)
    message = sent(message_of(PoseWithCovarianceStamped, messages.pose(estimate, "world")))
    assert isinstance(message, PoseWithCovarianceStamped)
    assert stamp_ns_of(message.header.stamp) == estimate.stamp_ns
    assert np.allclose(transform_of_pose(message.pose.pose), estimate.state.T_world_root, atol=1e-12)
    assert np.array_equal(np.array(message.pose.covariance).reshape(6, 6), estimate.covariance[:6, :6])


def test_joint_state(model):
    estimate = some_estimate(model)
    message = sent(message_of(JointState, messages.joint_state(estimate, model, "world")))
    assert isinstance(message, JointState)
    assert message.name == ["shoulder_x", "shoulder_y", "shoulder_z", "elbow_flexion"]
    assert np.array_equal(np.array(message.position), estimate.state.joint_positions)
    assert np.array_equal(np.array(message.velocity), estimate.velocity[6:])


def test_pose_there_and_back(model):
    T = some_state(model).T_world_root
    assert np.allclose(transform_of_pose(sent(message_of(Pose, messages.pose_of(T)))), T, atol=1e-12)


def test_pose_without_rotation_is_refused():
    pose = Pose()
    pose.orientation.w = 0.0
    with pytest.raises(TrackerError, match="quaternion"):
        transform_of_pose(pose)


def test_changes_of_named_values(model):
    values = np.zeros(model.n_dof)
    assert values_with_changes(model, values, ["elbow_flexion"], [0.5])[-1] == 0.5
    assert not values.any()
    with pytest.raises(UnknownNameError, match=r"knee.*elbow_flexion"):
        values_with_changes(model, values, ["knee"], [0.5])
    with pytest.raises(TrackerError, match="1 names and 2 values"):
        values_with_changes(model, values, ["elbow_flexion"], [0.5, 1.0])
    with pytest.raises(TrackerError, match="finite"):
        values_with_changes(model, values, ["elbow_flexion"], [float("nan")])
    with pytest.raises(TrackerError, match="once"):
        values_with_changes(model, values, ["elbow_flexion"] * 2, [0.5, 1.0])


def twist_message(estimate):
    return message_of(TwistWithCovarianceStamped, messages.twist(estimate, "world"))


def test_twist_of_the_root():
    estimate = some_estimate(arm())
    message = sent(twist_message(estimate))
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    assert [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z] == estimate.velocity[:6].tolist()
    assert np.array_equal(np.reshape(message.twist.covariance, (6, 6)), estimate.velocity_covariance[:6, :6])
    unknown = sent(twist_message(replace(estimate, velocity_covariance=None)))
    assert unknown.twist.covariance[0] == -1.0


@pytest.mark.parametrize(
    "numbers",
    [
        (3.0, 4.0, 5.0, 0.0, 0.0, 0.0, 0.0),
        (0, 0, 0, 0, 0, 0, 9e-7),
        (float("nan"), 0, 0, 0, 0, 0, 1),
        (0, 0, 0, float("inf"), 0, 0, 1),
    ],
)
def test_poses_that_are_none_are_refused_with_their_numbers(numbers):
    with pytest.raises(TrackerError, match=r"^pose: expected finite numbers and a quaternion of length one, got \["):
        transform_of_pose(posed(numbers))


@pytest.mark.parametrize("quaternion", [(1.0, 0.0, 0.0, 0.0), (2e-6, 0.0, 0.0, 0.0)])
def test_half_a_turn_about_x_of_any_length(quaternion):
    T = transform_of_pose(posed((1.0, 2.0, 3.0, *quaternion)))
    assert np.allclose(T, [[1, 0, 0, 1], [0, -1, 0, 2], [0, 0, -1, 3], [0, 0, 0, 1]], atol=1e-12)


def posed(numbers):
    pose = Pose()
    p, q = pose.position, pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = (float(number) for number in numbers)
    return pose
