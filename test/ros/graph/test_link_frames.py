"""/tf and /tf_static where tf2_msgs is installed: it is not on PyPI, so a stand-in takes the place of its message."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.ros.samples import small_rig, some_estimate, tracked_arm

pytest.importorskip("rclpy")

from tracker_node.observation.image_set import ImageSet
from tracker_node.ros.conversions import transform_of_pose
from tracker_node.ros.tracker import outputs as tracker_outputs
from tracker_node.tracking.estimate import Status


@dataclass
class TFMessage:
    transforms: list = field(default_factory=list)


class Graph:
    """A node that keeps what its publishers publish."""

    def __init__(self):
        self.published: dict[str, list] = {}
        self.qos: dict[str, object] = {}

    def create_publisher(self, message_type, topic, qos_profile, **options):
        messages = self.published.setdefault(topic, [])
        self.qos[topic] = qos_profile
        return SimpleNamespace(publish=messages.append, get_subscription_count=lambda: 0)


@pytest.fixture
def graph(monkeypatch, tmp_path):
    monkeypatch.setattr(tracker_outputs, "TFMessage", TFMessage)
    graph = Graph()
    graph.rig, graph.model = small_rig(tmp_path), tracked_arm()
    mismatches = SimpleNamespace(of_publisher=lambda *names: None)
    graph.outputs = tracker_outputs.TrackerOutputs(graph, graph.rig, graph.model, mismatches)
    return graph


def matrix_of(transform) -> np.ndarray:
    pose = SimpleNamespace(position=transform.translation, orientation=transform.rotation)
    return transform_of_pose(pose)


def test_cameras_stand_in_the_world(graph):
    (message,) = graph.published["/tf_static"]
    assert graph.qos["/tf_static"].durability == tracker_outputs.LATCHED.durability
    frames = {frame.child_frame_id: frame for frame in message.transforms}
    assert set(frames) == {camera.frame_id for camera in graph.rig}
    for camera in graph.rig:
        assert frames[camera.frame_id].header.frame_id == graph.rig.world_frame
        np.testing.assert_allclose(matrix_of(frames[camera.frame_id].transform), camera.T_world_cam, atol=1e-12)


@pytest.mark.parametrize("status", [Status.TRACKING, Status.DEGRADED, Status.LOST])
def test_the_root_is_in_the_world_unless_it_is_lost(graph, status):
    estimate = replace(some_estimate(graph.model), status=status)
    graph.outputs.publish(estimate, ImageSet(estimate.stamp_ns, ()), graph.rig)
    messages = graph.published["/tf"]
    if status == Status.LOST:
        assert not messages
        return
    (frame,) = messages[0].transforms
    assert (frame.header.frame_id, frame.child_frame_id) == (graph.rig.world_frame, graph.model.chain.links[0])
    assert frame.header.stamp.sec * 10**9 + frame.header.stamp.nanosec == estimate.stamp_ns
    np.testing.assert_allclose(matrix_of(frame.transform), estimate.state.T_world_root, atol=1e-12)


@pytest.mark.ros
def test_the_message_is_that_of_tf2():
    tf2_msgs = pytest.importorskip("tf2_msgs.msg", reason="tf2_msgs is not installed")
    assert tracker_outputs.TFMessage is tf2_msgs.TFMessage
    assert tf2_msgs.TFMessage.get_fields_and_field_types() == {"transforms": "sequence<geometry_msgs/TransformStamped>"}
