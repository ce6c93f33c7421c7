"""What layouts of viewers show: names of topics, joints and colors."""

import numpy as np
import pytest

from tracker_node.loaders.layouts import ViewedGraph, color_of, joints_to_plot
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain


@pytest.mark.parametrize(
    ("namespace", "own", "other"),
    [
        ("", "/tracker/state", "/cam"),
        ("lab", "/lab/tracker/state", "/lab/cam"),
        ("/lab/a/", "/lab/a/tracker/state", "/lab/a/cam"),
    ],
)
def test_topics(namespace, own, other):
    graph = ViewedGraph(("cam",), (), namespace=namespace)
    assert graph.topic("state") == own and graph.resolved("cam") == other
    assert graph.world_frame == "world"
    assert ViewedGraph((), (), tracker="second").topic("state") == "/second/state"


def model(*names: str) -> ArticulatedModel:
    axes = tuple(Axis(name, (1.0, 0.0, 0.0)) for name in names)
    return ArticulatedModel("m", KinematicChain(("a", "b"), (Joint("j", "a", "b", np.eye(4), axes),)), ())


def test_large_joints_come_first():
    names = ("wrist", "left_elbow_flexion", "left_hip_flexion", "ankle", "right_knee_flexion", "left_knee_flexion")
    assert joints_to_plot(model(*names)) == (
        ("right_knee_flexion", 4), ("left_knee_flexion", 5), ("left_hip_flexion", 2), ("left_elbow_flexion", 1),
        ("wrist", 0), ("ankle", 3),
    )  # fmt: skip
    assert joints_to_plot(model("shoulder_elevation_front", "elbow_flexion"))[0] == ("elbow_flexion", 1)
    assert joints_to_plot(model("x", "shoulder_elevation_front"))[0] == ("shoulder_elevation_front", 1)


def test_eight_joints_at_most():
    assert joints_to_plot(model(*(f"joint_{i}" for i in range(9)))) == tuple((f"joint_{i}", i) for i in range(8))


def test_colors_come_again_after_ten():
    assert len({color_of(i) for i in range(10)}) == 10
    assert color_of(0) == color_of(10) == "#1f77b4" and color_of(9) == color_of(19) == "#17becf"
