"""Estimates in messages: all the tracker says of a body; its pose, velocity, joints and shapes in messages that others know."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...loaders.bag.message_types import time_of
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shapes.primitives import Box, Ellipsoid, TruncatedCone
from ...observation.image_set import ImageSet
from ...render.palette import rgb_of
from ...tracking.estimate import Status, TrackEstimate
from .parts import Content, header, pose_of, xyz

_NOTHING = np.zeros(0)


def tracked_state(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str, image_set: ImageSet | None = None) -> Content:
    """tracker_msgs/TrackedState: everything the tracker says about one image set; ``frame_id`` is the world's.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    model : the body.
    frame_id : name of the world frame.
    image_set : the images, with the points that were used; None: none were.

    Returns
    -------
    content : the message as field -> value.
    """
    with_points = [] if image_set is None else [image for image in image_set.images if image.people is not None]
    points_ns = [image.stamp_ns if image.people_stamp_ns is None else image.people_stamp_ns for image in with_points]
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
        "keypoint_cameras": [image.camera for image in with_points],
        "keypoint_stamps": [time_of(stamp_ns) for stamp_ns in points_ns],
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


def bodies(estimates: Mapping[str, TrackEstimate], models: Mapping[str, ArticulatedModel], frame_id: str) -> Content:
    """tracker_msgs/Bodies: several bodies in one image set.

    Parameters
    ----------
    estimates, models : by the name of the body.
    frame_id : name of the world frame.

    Returns
    -------
    content : the message as field -> value.
    """
    found = list(estimates.values())
    return {
        "header": header(found[0].stamp_ns, frame_id),
        "names": list(estimates),
        "models": [models[name].name for name in estimates],
        "status": [int(estimate.status) for estimate in found],
        "status_reasons": [estimate.status_reason for estimate in found],
        "root_poses": [pose_of(estimate.state.T_world_root) for estimate in found],
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


_CUBE, _SPHERE, _TRIANGLES = 1, 2, 11  # visualization_msgs/Marker: CUBE, SPHERE, TRIANGLE_LIST
_CONE_SIDES = 16


def markers(model: ArticulatedModel) -> Content:
    """What never changes: of each shape its name space, number, kind, scale and triangles."""
    return {"markers": [_marker(i, shape, model.name) for i, shape in enumerate(model.shapes)]}


def changed_markers(estimate: TrackEstimate, configuration: Configuration, frame_id: str) -> Content:
    """What changes from estimate to estimate: stamp, pose and color of each shape; a lost body is shown in faint red.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    configuration : the model in the state of the estimate.
    frame_id : name of the world frame.

    Returns
    -------
    content : of a MarkerArray, without what `markers` holds.
    """
    said = header(estimate.stamp_ns, frame_id)
    shapes = zip(configuration.model.shapes, configuration.Ts_world_shape, strict=True)
    return {"markers": [{"header": said, "pose": pose_of(T), "color": color(shape, estimate.status)} for shape, T in shapes]}


def color(shape: Shape, status: Status) -> Content:
    """std_msgs/ColorRGBA of a shape.

    Parameters
    ----------
    shape : of the body.
    status : of the body.

    Returns
    -------
    content : of a ColorRGBA; faint where the body is not tracked.
    """
    if status == Status.LOST:
        red, green, blue = rgb_of("lost")
        return {"r": red, "g": green, "b": blue, "a": 0.3}
    r, g, b = (float(c) / 255.0 for c in shape.color_rgb)
    return {"r": r, "g": g, "b": b, "a": 1.0 if status == Status.TRACKING else 0.6}


def _marker(number: int, shape: Shape, namespace: str) -> Content:
    primitive, scale, points = shape.primitive, np.ones(3), np.zeros((0, 3))
    if isinstance(primitive, Ellipsoid):
        kind, scale = _SPHERE, 2.0 * np.array(primitive.radii, dtype=np.float64)
    elif isinstance(primitive, Box):
        kind, scale = _CUBE, np.array(primitive.size, dtype=np.float64)
    else:
        kind = _TRIANGLES
        corners = _cone_triangles(primitive) if isinstance(primitive, TruncatedCone) else primitive.vertices[primitive.faces]
        points = corners.reshape(-1, 3)
    return {"ns": namespace, "id": number, "type": kind, "scale": xyz(scale), "points": [xyz(point) for point in points]}


def _cone_triangles(cone: TruncatedCone) -> np.ndarray:
    """(n, 3, 3) corners of the closed surface, seen counter-clockwise from outside."""
    angles = 2.0 * np.pi * np.arange(_CONE_SIDES) / _CONE_SIDES
    unit = np.stack([cone.a * np.cos(angles), cone.b * np.sin(angles)], axis=1)
    rings = [np.column_stack([unit * (1.0 + cone.k * z), np.full(_CONE_SIDES, z)]) for z in (cone.z1, cone.z2)]
    low, high = rings
    next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    bottom, top = np.broadcast_to([0.0, 0.0, cone.z1], low.shape), np.broadcast_to([0.0, 0.0, cone.z2], low.shape)
    parts = [(low, next_low, next_high), (low, next_high, high), (bottom, next_low, low), (top, high, next_high)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])
