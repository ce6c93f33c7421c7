"""Estimates and states, and tracker_msgs/TrackedState, PoseWithCovarianceStamped."""

from __future__ import annotations

import array
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Pose, PoseWithCovarianceStamped, TwistWithCovarianceStamped, Vector3
from tracker_msgs.msg import TrackedState

from ...errors import TrackerError, UnknownNameError
from ...geometry import quaternion, se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...tracking.estimate import CameraReport, LimbReport, LimbStatus, Status, Timings, TrackEstimate
from .stamps import stamp_message, stamp_ns_of


def _doubles(values: np.ndarray) -> array.array:
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def pose_of(T_world_body: np.ndarray) -> Pose:
    """geometry_msgs/Pose of a transform (4, 4)."""
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = (float(v) for v in T_world_body[:3, 3])
    q = quaternion.xyzw_from_matrix(T_world_body[:3, :3])
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = (float(v) for v in q)
    return pose


def transform_of_pose(pose: Pose) -> np.ndarray:
    """(4, 4) of a geometry_msgs/Pose.

    Raises
    ------
    TrackerError : a quaternion of length zero, or numbers that are not finite.
    """
    p, q = pose.position, pose.orientation
    numbers = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not np.all(np.isfinite(numbers)) or np.linalg.norm(numbers[3:]) < 1e-6:
        raise TrackerError(f"pose: expected finite numbers and a quaternion of length one, got {numbers.tolist()}")
    return se3.from_rotation_translation(quaternion.matrix_from_xyzw(numbers[3:]), numbers[:3])


def pose_message(estimate: TrackEstimate, frame_id: str) -> PoseWithCovarianceStamped:
    """Root pose with its 6x6 covariance: translation, then rotation about the axes of ``frame_id`` (REP-103)."""
    message = PoseWithCovarianceStamped()
    message.header.stamp = stamp_message(estimate.stamp_ns)
    message.header.frame_id = frame_id
    message.pose.pose = pose_of(estimate.state.T_world_root)
    message.pose.covariance = np.ascontiguousarray(estimate.covariance[:6, :6], dtype=np.float64).ravel()
    return message


def twist_message(estimate: TrackEstimate, frame_id: str) -> TwistWithCovarianceStamped:
    """Velocity of the root's origin, then angular velocity, about the axes of ``frame_id``, per second, with the 6x6 covariance.

    Where nothing is known of the covariance its first element is -1, as sensor_msgs/Imu marks that.
    """
    message = TwistWithCovarianceStamped()
    message.header.stamp = stamp_message(estimate.stamp_ns)
    message.header.frame_id = frame_id
    message.twist.twist.linear, message.twist.twist.angular = (
        Vector3(x=float(x), y=float(y), z=float(z)) for x, y, z in (estimate.velocity[:3], estimate.velocity[3:6])
    )
    covariance = np.zeros((6, 6))
    covariance[0, 0] = -1.0
    if estimate.velocity_covariance is not None:
        covariance = np.ascontiguousarray(estimate.velocity_covariance[:6, :6], dtype=np.float64)
    message.twist.covariance = covariance.ravel()
    return message


def state_of_pose(pose: Pose, joint_positions: np.ndarray) -> State:
    """A state with this root pose."""
    return State(transform_of_pose(pose), np.array(joint_positions, dtype=np.float64))


def tracked_state_message(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> TrackedState:
    """Everything the tracker says about one image set."""
    message = TrackedState(
        status=int(estimate.status),
        status_reason=str(estimate.status_reason),
        model=model.name,
        dof_names=list(model.chain.dof_names),
        score=float(estimate.score),
        residual_px=float(estimate.residual_px),
        iterations=int(estimate.iterations),
        evaluations=int(estimate.evaluations),
        observe_ms=float(estimate.timings.observe_ms),
        optimize_ms=float(estimate.timings.optimize_ms),
        total_ms=float(estimate.timings.total_ms),
    )
    message.header.stamp = stamp_message(estimate.stamp_ns)
    message.header.frame_id = frame_id
    message.root_pose = pose_of(estimate.state.T_world_root)
    message.values = _doubles(estimate.state.to_values())
    message.velocities = _doubles(estimate.velocity)
    message.covariance = _doubles(estimate.covariance)
    if estimate.velocity_covariance is not None:
        message.velocity_covariance = _doubles(estimate.velocity_covariance)
    message.cameras = [report.camera for report in estimate.cameras]
    message.camera_stamps = [stamp_message(report.stamp_ns) for report in estimate.cameras]
    message.camera_residuals_px = array.array("d", [float(report.residual_px) for report in estimate.cameras])
    message.camera_samples = array.array("I", [int(report.samples) for report in estimate.cameras])
    message.limbs = [limb.name for limb in estimate.limbs]
    message.limb_status = array.array("B", [int(limb.status) for limb in estimate.limbs])
    message.limb_lost_probability = array.array("d", [float(limb.probability) for limb in estimate.limbs])
    message.limb_reasons = [limb.reason for limb in estimate.limbs]
    return message


def estimate_of(message: TrackedState) -> TrackEstimate:
    """The estimate that a message came from (states agree to rounding of the root's rotation vector)."""
    n = len(message.values)
    return TrackEstimate(
        stamp_ns=stamp_ns_of(message.header.stamp),
        status=Status(message.status),
        status_reason=message.status_reason,
        state=State.from_values(np.array(message.values)),
        velocity=np.array(message.velocities),
        covariance=np.array(message.covariance).reshape(n, n),
        score=message.score,
        residual_px=message.residual_px,
        cameras=tuple(
            CameraReport(name, stamp_ns_of(stamp), residual, samples)
            for name, stamp, residual, samples in zip(
                message.cameras, message.camera_stamps, message.camera_residuals_px, message.camera_samples, strict=True
            )
        ),
        iterations=message.iterations,
        evaluations=message.evaluations,
        timings=Timings(message.observe_ms, message.optimize_ms, message.total_ms),
        limbs=tuple(
            LimbReport(name, LimbStatus(status), reason, probability)
            for name, status, reason, probability in zip(
                message.limbs, message.limb_status, message.limb_reasons, message.limb_lost_probability, strict=True
            )
        ),
        velocity_covariance=np.array(message.velocity_covariance).reshape(n, n) if message.velocity_covariance else None,
    )


def values_with_changes(
    model: ArticulatedModel, values: np.ndarray, names: Sequence[str], changes: Sequence[float]
) -> np.ndarray:
    """State values (n_dof,) with the named ones replaced.

    Raises
    ------
    TrackerError : unknown or repeated names, not one value for each, or a value that is not finite.
    """
    if len(names) != len(changes):
        raise TrackerError(f"expected one value for each name, got {len(names)} names and {len(changes)} values")
    if len(set(names)) != len(names):
        raise TrackerError(f"expected each name once, got {list(names)}")
    if not np.all(np.isfinite(np.array(changes, dtype=np.float64))):
        raise TrackerError(f"expected finite values, got {list(changes)}")
    dof_names = model.chain.dof_names
    result = np.array(values, dtype=np.float64)
    for name, value in zip(names, changes, strict=True):
        if name not in dof_names:
            raise UnknownNameError("degree of freedom", name, dof_names)
        result[dof_names.index(name)] = float(value)
    return result
