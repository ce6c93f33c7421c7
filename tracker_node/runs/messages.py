"""Estimates as messages without ROS, and back: an offline run writes the bag that a live one would.

The fields agree with what the nodes publish; a test compares both.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ..camera.model import CameraModel
from ..camera.plausible_lens import plausible
from ..camera.rig import Camera
from ..errors import CalibrationError, TrackerError
from ..geometry import quaternion
from ..loaders.bag.images import NS_PER_S, stamp_ns_of
from ..loaders.bag.message_types import TRACKED_STATE, typestore
from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF
from ..tracking.estimate import CameraReport, LimbReport, LimbStatus, Status, Timings, TrackEstimate


def time_message(stamp_ns: int) -> Any:
    """builtin_interfaces/Time."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return typestore().types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)


def header_message(stamp_ns: int, frame_id: str) -> Any:
    """std_msgs/Header."""
    return typestore().types["std_msgs/msg/Header"](stamp=time_message(stamp_ns), frame_id=frame_id)


def pose_of(T_world_body: np.ndarray) -> Any:
    """geometry_msgs/Pose of a transform (4, 4)."""
    types = typestore().types
    x, y, z = (float(v) for v in T_world_body[:3, 3])
    qx, qy, qz, qw = (float(v) for v in quaternion.xyzw_from_matrix(T_world_body[:3, :3]))
    return types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=x, y=y, z=z),
        orientation=types["geometry_msgs/msg/Quaternion"](x=qx, y=qy, z=qz, w=qw),
    )


def pose_message(estimate: TrackEstimate, frame_id: str) -> Any:
    """geometry_msgs/PoseWithCovarianceStamped of the root."""
    types = typestore().types
    covariance = np.ascontiguousarray(estimate.covariance[:6, :6], dtype=np.float64).ravel()
    return types["geometry_msgs/msg/PoseWithCovarianceStamped"](
        header=header_message(estimate.stamp_ns, frame_id),
        pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose_of(estimate.state.T_world_root), covariance=covariance),
    )


def joint_state_message(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> Any:
    """sensor_msgs/JointState: angles and angular velocities."""
    return typestore().types["sensor_msgs/msg/JointState"](
        header=header_message(estimate.stamp_ns, frame_id),
        name=list(model.chain.dof_names[N_ROOT_DOF:]),
        position=np.array(estimate.state.joint_positions, dtype=np.float64),
        velocity=np.array(estimate.velocity[N_ROOT_DOF:], dtype=np.float64),
        effort=np.zeros(0),
    )


def tracked_state_message(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> Any:
    """tracker_msgs/TrackedState: everything the tracker says about one image set."""
    return typestore().types[TRACKED_STATE](
        header=header_message(estimate.stamp_ns, frame_id),
        status=int(estimate.status),
        status_reason=str(estimate.status_reason),
        model=model.name,
        root_pose=pose_of(estimate.state.T_world_root),
        dof_names=list(model.chain.dof_names),
        values=np.ascontiguousarray(estimate.state.to_values(), dtype=np.float64),
        velocities=np.ascontiguousarray(estimate.velocity, dtype=np.float64),
        covariance=np.ascontiguousarray(estimate.covariance, dtype=np.float64).ravel(),
        velocity_covariance=np.ascontiguousarray(() if (spread := estimate.velocity_covariance) is None else spread).ravel(),
        score=float(estimate.score),
        residual_px=float(estimate.residual_px),
        cameras=[report.camera for report in estimate.cameras],
        camera_stamps=[time_message(report.stamp_ns) for report in estimate.cameras],
        camera_residuals_px=np.array([report.residual_px for report in estimate.cameras], dtype=np.float64),
        camera_samples=np.array([report.samples for report in estimate.cameras], dtype=np.uint32),
        limbs=[limb.name for limb in estimate.limbs],
        limb_status=np.array([int(limb.status) for limb in estimate.limbs], dtype=np.uint8),
        limb_lost_probability=np.array([limb.probability for limb in estimate.limbs], dtype=np.float64),
        limb_reasons=[limb.reason for limb in estimate.limbs],
        iterations=int(estimate.iterations),
        evaluations=int(estimate.evaluations),
        observe_ms=float(estimate.timings.observe_ms),
        optimize_ms=float(estimate.timings.optimize_ms),
        total_ms=float(estimate.timings.total_ms),
    )


def estimate_of(message: Any) -> TrackEstimate:
    """The estimate in a TrackedState read from a bag.

    The root's rotation comes from the rotation vector in ``values``, so ``state.to_values()`` agrees to rounding; for exact
    comparisons use the message's own ``values``.
    """
    n = len(message.values)
    reports = zip(message.cameras, message.camera_stamps, message.camera_residuals_px, message.camera_samples, strict=True)
    limbs: Any = ()
    if hasattr(message, "limbs"):  # bags of version 0.1 have none
        limbs = zip(message.limbs, message.limb_status, message.limb_reasons, message.limb_lost_probability, strict=True)
    spread = getattr(message, "velocity_covariance", ())
    return TrackEstimate(
        stamp_ns=stamp_ns_of(message.header.stamp),
        status=Status(int(message.status)),
        status_reason=message.status_reason,
        state=State.from_values(message.values),
        velocity=np.array(message.velocities),
        covariance=np.array(message.covariance).reshape(n, n),
        score=float(message.score),
        residual_px=float(message.residual_px),
        cameras=tuple(CameraReport(name, stamp_ns_of(stamp), float(px), int(n)) for name, stamp, px, n in reports),
        iterations=int(message.iterations),
        evaluations=int(message.evaluations),
        timings=Timings(float(message.observe_ms), float(message.optimize_ms), float(message.total_ms)),
        limbs=tuple(LimbReport(name, LimbStatus(int(status)), reason, float(p)) for name, status, reason, p in limbs),
        velocity_covariance=np.array(spread).reshape(n, n) if len(spread) else None,
    )


def camera_info_message(stamp_ns: int, camera: Camera) -> Any:
    """sensor_msgs/CameraInfo of a camera's lens; R and P are those of an unrectified single camera."""
    types = typestore().types
    model = camera.model
    name = "plumb_bob" if model.distortion_model == "none" else model.distortion_model
    coefficients = [float(v) for v in model.distortion] or [0.0] * 5
    if name == "plumb_bob" and len(coefficients) == 4:
        coefficients.append(0.0)  # k3; ROS writes five
    K = np.ascontiguousarray(model.K, dtype=np.float64)
    return types["sensor_msgs/msg/CameraInfo"](
        header=header_message(stamp_ns, camera.frame_id),
        height=int(model.height),
        width=int(model.width),
        distortion_model=name,
        d=np.array(coefficients),
        k=K.ravel(),
        r=np.eye(3).ravel(),
        p=np.hstack([K, np.zeros((3, 1))]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def lens_of(camera: str, message: Any) -> CameraModel:
    """Lens in a sensor_msgs/CameraInfo read from a bag; coefficients that are all zero are no distortion.

    Raises
    ------
    CalibrationError : uncalibrated, or a lens that is not known.
    """
    K = np.array(message.k, dtype=np.float64).reshape(3, 3)
    if K[0, 0] == 0.0:
        raise CalibrationError(camera, "uncalibrated: camera_info has K[0] = 0")
    name = {"fisheye": "equidistant", "": "none"}.get(message.distortion_model, message.distortion_model)
    coefficients = np.array(message.d, dtype=np.float64)
    if not coefficients.any() and name in ("none", "plumb_bob", "rational_polynomial"):
        name, coefficients = "none", np.zeros(0)
    try:
        return plausible(CameraModel(int(message.width), int(message.height), K, name, coefficients))
    except (ValueError, TrackerError) as error:
        raise CalibrationError(camera, f"camera_info: {error}") from None


def image_message(stamp_ns: int, frame_id: str, pixels: np.ndarray, encoding: str) -> Any:
    """sensor_msgs/Image of uint8 pixels (height, width[, 3])."""
    height, width = pixels.shape[:2]
    return typestore().types["sensor_msgs/msg/Image"](
        header=header_message(stamp_ns, frame_id),
        height=int(height),
        width=int(width),
        encoding=encoding,
        is_bigendian=0,
        step=int(width * (pixels.shape[2] if pixels.ndim == 3 else 1)),
        data=np.ascontiguousarray(pixels).reshape(-1),
    )


def compressed_message(stamp_ns: int, frame_id: str, bgr: np.ndarray, quality: int = 90) -> Any:
    """sensor_msgs/CompressedImage: JPEG of a BGR image."""
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return typestore().types["sensor_msgs/msg/CompressedImage"](
        header=header_message(stamp_ns, frame_id), format="bgr8; jpeg compressed bgr8", data=encoded.reshape(-1)
    )
