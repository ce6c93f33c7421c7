"""Estimates in messages: all the tracker says, and the root's pose, its velocity, and joints in messages that others know."""

from __future__ import annotations

import numpy as np

from ...loaders.bag.message_types import time_of
from ...model.articulated import ArticulatedModel
from ...model.kinematic_chain import N_ROOT_DOF
from ...tracking.estimate import TrackEstimate
from .parts import Content, header, pose_of, xyz

_NOTHING = np.zeros(0)


def tracked_state(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> Content:
    """tracker_msgs/TrackedState: everything the tracker says about one image set; ``frame_id`` is the world's.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    model : the body.
    frame_id : name of the world frame.

    Returns
    -------
    content : the message as field -> value.
    """
    return {
        "header": header(estimate.stamp_ns, frame_id),
        "status": int(estimate.status),
        "status_reason": estimate.status_reason,
        "model": model.name,
        "root_pose": pose_of(estimate.state.T_world_root),
        "dof_names": model.chain.dof_names,
        "values": estimate.state.to_values(),
        "velocities": estimate.velocity,
        "score": estimate.score,
        "residual": estimate.residual,
        "residual_unit": estimate.residual_unit,
        "cameras": [report.camera for report in estimate.cameras],
        "camera_stamps": [time_of(report.stamp_ns) for report in estimate.cameras],
        "camera_residuals": [report.residual for report in estimate.cameras],
        "camera_samples": [report.samples for report in estimate.cameras],
        "limbs": [limb.name for limb in estimate.limbs],
        "limb_status": [int(limb.status) for limb in estimate.limbs],
        "limb_lost_probability": [limb.probability for limb in estimate.limbs],
        "limb_reasons": [limb.reason for limb in estimate.limbs],
        "iterations": estimate.iterations,
        "evaluations": estimate.evaluations,
        "observe_ms": estimate.timings.observe_ms,
        "optimize_ms": estimate.timings.optimize_ms,
        "total_ms": estimate.timings.total_ms,
    }


def state_covariance(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> Content:
    """tracker_msgs/StateCovariance: the covariances of a `tracked_state`.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    model : the body.
    frame_id : name of the world frame.

    Returns
    -------
    content : the message as field -> value.
    """
    velocity = estimate.velocity_covariance
    return {
        "header": header(estimate.stamp_ns, frame_id),
        "dof_names": model.chain.dof_names,
        "covariance": estimate.covariance.ravel(),
        "velocity_covariance": _NOTHING if velocity is None else velocity.ravel(),
    }


def pose(estimate: TrackEstimate, frame_id: str) -> Content:
    """geometry_msgs/PoseWithCovarianceStamped of the root.

    The 6x6 covariance is of the translation, then of a rotation about the axes of ``frame_id`` (REP-103).

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    frame_id : name of the world frame.

    Returns
    -------
    content : the message as field -> value.
    """
    covariance = estimate.covariance[:N_ROOT_DOF, :N_ROOT_DOF].ravel()
    return {
        "header": header(estimate.stamp_ns, frame_id),
        "pose": {"pose": pose_of(estimate.state.T_world_root), "covariance": covariance},
    }


def twist(estimate: TrackEstimate, frame_id: str) -> Content:
    """geometry_msgs/TwistWithCovarianceStamped: velocity of the root's origin, then angular velocity.

    Both are about the axes of ``frame_id``, per second, with their 6x6 covariance. Where nothing is known of that, its first
    element is -1, as sensor_msgs/Imu marks it.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    frame_id : name of the world frame.

    Returns
    -------
    content : the message as field -> value.
    """
    covariance = np.zeros((N_ROOT_DOF, N_ROOT_DOF))
    covariance[0, 0] = -1.0
    if estimate.velocity_covariance is not None:
        covariance = estimate.velocity_covariance[:N_ROOT_DOF, :N_ROOT_DOF]
    linear, angular = xyz(estimate.velocity[:3]), xyz(estimate.velocity[3:6])
    return {
        "header": header(estimate.stamp_ns, frame_id),
        "twist": {"twist": {"linear": linear, "angular": angular}, "covariance": covariance.ravel()},
    }


def joint_state(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> Content:
    """sensor_msgs/JointState: angles and angular velocities; names are those of the model's axes and of its URDF.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    model : the body.
    frame_id : name of the world frame.

    Returns
    -------
    content : the message as field -> value.
    """
    return {
        "header": header(estimate.stamp_ns, frame_id),
        "name": model.chain.dof_names[N_ROOT_DOF:],
        "position": estimate.state.joint_positions,
        "velocity": estimate.velocity[N_ROOT_DOF:],
    }
