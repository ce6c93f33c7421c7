"""Bodies for other tools: JointState, markers, transforms."""

from __future__ import annotations

import array
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import Point, TransformStamped, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shapes.primitives import Box, Ellipsoid, TruncatedCone
from ...render.draw.palette import rgb_of
from ...tracking.estimate import Status, TrackEstimate
from .estimates import pose_of
from .stamps import stamp_message

_CONE_SIDES = 16


def joint_state_message(estimate: TrackEstimate, model: ArticulatedModel, frame_id: str) -> JointState:
    """Angles and angular velocities of the joints; names are those of the model's axes and of its URDF."""
    message = JointState(name=list(model.chain.dof_names[N_ROOT_DOF:]))
    message.header.stamp = stamp_message(estimate.stamp_ns)
    message.header.frame_id = frame_id
    message.position = array.array("d", [float(v) for v in estimate.state.joint_positions])
    message.velocity = array.array("d", [float(v) for v in estimate.velocity[N_ROOT_DOF:]])
    return message


class MarkerBuffer:
    """One MarkerArray for a model; only poses, stamps and colours change between estimates."""

    def __init__(self, model: ArticulatedModel, frame_id: str):
        self._shapes = model.shapes
        self.message = MarkerArray(markers=[_marker(i, shape, model.name) for i, shape in enumerate(model.shapes)])
        for marker in self.message.markers:
            marker.header.frame_id = frame_id

    def fill(self, estimate: TrackEstimate, configuration: Configuration) -> MarkerArray:
        """The markers at an estimate, valid until the next call; a lost body is shown in faint red."""
        stamp = stamp_message(estimate.stamp_ns)
        for marker, shape, transform in zip(self.message.markers, self._shapes, configuration.Ts_world_shape, strict=True):
            marker.header.stamp = stamp
            marker.pose = pose_of(transform)
            marker.color = _color(shape, estimate.status)
        return self.message


def marker_array_message(estimate: TrackEstimate, configuration: Configuration, frame_id: str) -> MarkerArray:
    """The model's shapes at an estimate."""
    return MarkerBuffer(configuration.model, frame_id).fill(estimate, configuration)


def _color(shape: Shape, status: Status) -> ColorRGBA:
    if status == Status.LOST:
        red, green, blue = rgb_of("lost")
        return ColorRGBA(r=red, g=green, b=blue, a=0.3)
    r, g, b = (float(c) / 255.0 for c in shape.color_rgb)
    return ColorRGBA(r=r, g=g, b=b, a=1.0 if status == Status.TRACKING else 0.6)


def _marker(number: int, shape: Shape, namespace: str) -> Marker:
    marker = Marker(ns=namespace, id=number, action=Marker.ADD, scale=Vector3(x=1.0, y=1.0, z=1.0))
    primitive = shape.primitive
    if isinstance(primitive, Ellipsoid):
        marker.type = Marker.SPHERE
        marker.scale = Vector3(**{axis: 2.0 * float(r) for axis, r in zip("xyz", primitive.radii, strict=True)})
    elif isinstance(primitive, Box):
        marker.type = Marker.CUBE
        marker.scale = Vector3(**{axis: float(v) for axis, v in zip("xyz", primitive.size, strict=True)})
    else:
        marker.type = Marker.TRIANGLE_LIST
        corners = _cone_triangles(primitive) if isinstance(primitive, TruncatedCone) else primitive.vertices[primitive.faces]
        marker.points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in corners.reshape(-1, 3)]
    return marker


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


def tf_message(stamp_ns: int, frames: Iterable[tuple[str, str, np.ndarray]]) -> list[TransformStamped]:
    """Transforms ``T_parent_child`` (4, 4) given as (parent, child, transform)."""
    result = []
    for parent, child, transform in frames:
        message = TransformStamped(child_frame_id=child)
        message.header.stamp = stamp_message(stamp_ns)
        message.header.frame_id = parent
        pose = pose_of(transform)
        message.transform.translation = Vector3(x=pose.position.x, y=pose.position.y, z=pose.position.z)
        message.transform.rotation = pose.orientation
        result.append(message)
    return result
