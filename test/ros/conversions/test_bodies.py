"""Markers lie on the model's surface; the URDF has the model's kinematics."""

from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("rclpy")
from ros_samples import arm, some_estimate, some_state
from visualization_msgs.msg import Marker

from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration
from tracker_node.ros.conversions import marker_array_message, transform_of_pose, urdf_of
from tracker_node.tracking.estimate import Status, TrackEstimate


def urdf_link_poses(text: str, T_world_root: np.ndarray, angles: dict[str, float]) -> dict[str, np.ndarray]:
    """Forward kinematics by the URDF specification alone."""
    root = ElementTree.fromstring(text)
    joints = root.findall("joint")
    children = {joint.find("child").get("link") for joint in joints}
    (base,) = {link.get("name") for link in root.findall("link")} - children
    poses = {base: T_world_root}
    while len(poses) <= len(joints):
        for joint in joints:
            parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
            if parent in poses and child not in poses:
                xyz = np.array(joint.find("origin").get("xyz").split(), float)
                roll, pitch, yaw = np.array(joint.find("origin").get("rpy").split(), float)
                R = so3.exp(np.array([0, 0, yaw])) @ so3.exp(np.array([0, pitch, 0])) @ so3.exp(np.array([roll, 0, 0]))
                T = poses[parent] @ se3.from_rotation_translation(R, xyz)
                if joint.get("type") == "revolute":
                    axis = np.array(joint.find("axis").get("xyz").split(), float)
                    T = T @ se3.from_rotation_translation(so3.exp(axis * angles[joint.get("name")]), np.zeros(3))
                poses[child] = T
    return poses


def test_urdf_has_the_models_kinematics():
    model = arm()
    state = some_state(model)
    names = [axis.name for axis in model.chain.axes]
    poses = urdf_link_poses(urdf_of(model), state.T_world_root, dict(zip(names, state.joint_positions, strict=True)))
    expected = Configuration(model, state).Ts_world_link
    for link, T in zip(model.chain.links, expected, strict=True):
        assert np.allclose(poses[link], T, atol=1e-7), link


def test_urdf_joints_are_the_degrees_of_freedom():
    model = arm()
    root = ElementTree.fromstring(urdf_of(model))
    moving = {joint.get("name"): joint for joint in root.findall("joint") if joint.get("type") == "revolute"}
    assert set(moving) == {axis.name for axis in model.chain.axes}
    limit = moving["shoulder_x"].find("limit")
    assert (float(limit.get("lower")), float(limit.get("upper"))) == (-1.0, 2.0)
    assert len(root.findall("link/visual")) == len(model.shapes)


def test_marker_cone_lies_on_the_cone_and_faces_outward():
    model = arm()
    estimate = some_estimate(model)
    markers = marker_array_message(estimate, Configuration(model, estimate.state), "world").markers
    assert [m.type for m in markers] == [Marker.CUBE, Marker.TRIANGLE_LIST, Marker.SPHERE, Marker.TRIANGLE_LIST]
    cone = model.shapes[1].primitive
    triangles = np.array([[p.x, p.y, p.z] for p in markers[1].points]).reshape(-1, 3, 3)
    x, y, z = np.moveaxis(triangles.reshape(-1, 3), 1, 0)
    radius = np.hypot(x / cone.a, y / cone.b) / (1.0 + cone.k * z)
    assert np.all(np.isclose(radius, 1.0) | np.isclose(radius, 0.0))  # on the mantle, or the middle of a cap
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outward = triangles.mean(axis=1) - [0.0, 0.0, 0.5 * (cone.z1 + cone.z2)]
    assert np.all(np.einsum("ij,ij->i", normals, outward) > 0)
    poses = [transform_of_pose(m.pose) for m in markers]
    assert np.allclose(poses, Configuration(model, estimate.state).Ts_world_shape, atol=1e-12)


def test_a_lost_body_is_shown_as_lost():
    model = arm()
    fields = {**some_estimate(model).__dict__, "status": Status.LOST}
    estimate = TrackEstimate(**fields)
    markers = marker_array_message(estimate, Configuration(model, estimate.state), "world").markers
    assert all(m.color.a < 0.5 and m.color.r == 1.0 for m in markers)
