"""Markers lie on the model's surface; the URDF has the model's kinematics."""

from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("rclpy")
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from helpers.ros.samples import arm, some_estimate, some_state
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.urdf_writer import urdf_of
from tracker_node.model.configuration import Configuration
from tracker_node.render.palette import rgb_of
from tracker_node.ros.conversions import fill, message_of, transform_of_pose
from tracker_node.runs import messages
from tracker_node.tracking.estimate import Status, TrackEstimate


def marker_array(model, estimate, frame_id):
    """As a node fills it."""
    message = message_of(MarkerArray, messages.markers(model))
    return fill(message, messages.changed_markers(estimate, Configuration(model, estimate.state), frame_id))


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
    markers = marker_array(model, estimate, "world").markers
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
    markers = marker_array(model, estimate, "world").markers
    assert all(m.color.a < 0.5 and m.color.r > 2.0 * m.color.g and m.color.b < 0.1 for m in markers)


def markers_of(status: Status, frame_id: str = "world"):
    model = arm()
    estimate = TrackEstimate(**{**some_estimate(model).__dict__, "status": status})
    return model, estimate, marker_array(model, estimate, frame_id).markers


def test_markers_are_as_large_as_their_shapes():
    """RViz scales a cube and a sphere of one meter across; triangles are in meters."""
    _, _, markers = markers_of(Status.TRACKING)
    sizes = [(m.scale.x, m.scale.y, m.scale.z) for m in markers]
    assert sizes == [(0.3, 0.2, 0.5), (1.0, 1.0, 1.0), pytest.approx((0.08, 0.06, 0.24)), (1.0, 1.0, 1.0)]
    assert [bool(m.points) for m in markers] == [False, True, False, True]
    corners = np.array([[p.x, p.y, p.z] for p in markers[3].points]).reshape(-1, 3, 3)
    mesh = arm().shapes[3].primitive
    np.testing.assert_array_equal(corners, mesh.vertices[mesh.faces])


def test_markers_say_whose_they_are_and_when():
    _, estimate, markers = markers_of(Status.TRACKING, "lab")
    assert [m.id for m in markers] == [0, 1, 2, 3] and {m.ns for m in markers} == {"arm"} and {m.action for m in markers} == {0}
    for marker in markers:
        assert marker.header.frame_id == "lab"
        assert marker.header.stamp.sec * 10**9 + marker.header.stamp.nanosec == estimate.stamp_ns


@pytest.mark.parametrize(("status", "alpha"), [(Status.TRACKING, 1.0), (Status.DEGRADED, 0.6), (Status.INITIALIZING, 0.6)])
def test_a_body_that_is_tracked_has_its_own_colors(status, alpha):
    _, _, markers = markers_of(status)
    cone = markers[1].color
    assert (cone.r, cone.g, cone.b, cone.a) == pytest.approx((200 / 255, 100 / 255, 50 / 255, alpha), abs=1e-6)


def test_a_lost_body_is_faint_in_the_color_of_its_state():
    for marker in markers_of(Status.LOST)[2]:
        color = (marker.color.r, marker.color.g, marker.color.b, marker.color.a)
        assert color == pytest.approx((*rgb_of("lost"), 0.3), abs=1e-6)


def test_the_marker_of_a_cone_is_closed_and_has_its_volume():
    """By the divergence theorem; a prism of 16 sides has 16/2 sin(2 pi/16)/pi of what is inside the ellipse."""
    cone = arm().shapes[1].primitive
    triangles = np.array([[p.x, p.y, p.z] for p in markers_of(Status.TRACKING)[2][1].points]).reshape(-1, 3, 3)
    a, b, c = np.moveaxis(triangles, 1, 0)
    assert np.abs(np.cross(b - a, c - a).sum(axis=0)).max() < 1e-15  # closed
    z = np.linspace(cone.z1, cone.z2, 2001)
    inside = np.trapezoid(cone.a * cone.b * (1.0 + cone.k * z) ** 2, z) * 8.0 * np.sin(np.pi / 8.0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(inside, rel=1e-6)


def test_joint_states_hold_the_joints_and_not_the_root():
    model = arm()
    estimate = some_estimate(model)
    message = message_of(JointState, messages.joint_state(estimate, model, "lab"))
    assert list(message.name) == [axis.name for axis in model.chain.axes]
    np.testing.assert_array_equal(message.position, estimate.state.joint_positions)
    np.testing.assert_array_equal(message.velocity, estimate.velocity[6:])
    assert message.header.frame_id == "lab"
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == estimate.stamp_ns


def test_transforms_are_from_parent_to_child():
    T = se3.from_rotation_translation(so3.exp(np.array([0.3, -0.2, 0.9])), np.array([1.0, 2.0, 3.0]))
    one = message_of(TransformStamped, messages.transforms(5_000_000_007, [("world", "arm", T)])[0])
    assert (one.header.frame_id, one.child_frame_id) == ("world", "arm")
    assert (one.header.stamp.sec, one.header.stamp.nanosec) == (5, 7)
    q, p = one.transform.rotation, one.transform.translation
    assert (p.x, p.y, p.z) == (1.0, 2.0, 3.0)
    np.testing.assert_allclose(so3.matrix_from_xyzw(np.array([q.x, q.y, q.z, q.w])), T[:3, :3], atol=1e-12)


def test_the_marker_of_a_mesh_is_its_triangles():
    model = arm()
    estimate = some_estimate(model)
    marker = marker_array(model, estimate, "world").markers[3]
    corners = [(point.x, point.y, point.z) for point in marker.points]
    o, x, y, z = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)
    assert marker.type == Marker.TRIANGLE_LIST and corners == [o, y, x, o, x, z, o, z, y, x, y, z]
    assert (marker.scale.x, marker.scale.y, marker.scale.z) == (1.0, 1.0, 1.0)
