"""Bodies without parts, and with others in their places."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane, gantry
from tracker_node.errors import ModelError, UnknownNameError
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human
from tracker_node.model.humans.keypoints import BLAZEPOSE, expected_offsets, leg_ratio, relative_size
from tracker_node.model.humans.measures import HumanMeasures
from tracker_node.model.kinematic_chain import Axis, Following, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.model.variants import with_part, without_links
from tracker_node.tracking.keypoints.modality import points_of
from tracker_node.tracking.limbs.tree import limbs_of

HUMAN = gait_human()


def blade() -> ArticulatedModel:
    """A running blade on a hinge."""
    hinge = Joint("left_blade", "left_socket", "left_blade", se3.exp(np.array([0, 0, -0.1, 0, 0, 0.0])), (
        Axis("left_blade_flexion", (0.0, 1.0, 0.0), -0.2, 1.5),
    ))  # fmt: skip
    shape = Shape("left_blade", "left_blade", Box((0.06, 0.05, 0.3)), se3.exp(np.array([0, 0, -0.15, 0, 0, 0.0])))
    marks = (Landmark("left_ankle", "left_blade", (0.0, 0.0, -0.3)),)
    return ArticulatedModel("blade", KinematicChain(("left_socket", "left_blade"), (hinge,)), (shape,), marks)


def test_what_hangs_on_a_link_goes_with_it():
    lost = without_links(HUMAN, ["left_shank"])
    assert set(HUMAN.chain.links) - set(lost.chain.links) == {"left_shank", "left_foot", "left_toes"}
    assert {s.name for s in HUMAN.shapes} - {s.name for s in lost.shapes} == {
        "left_shank", "left_heel", "left_midfoot", "left_toes",
    }  # fmt: skip
    assert "left_knee" in lost.landmark_names and "left_ankle" not in lost.landmark_names  # the stump's end stays
    assert HUMAN.n_dof - lost.n_dof == 2 + 2 + 1
    assert [limb.name for limb in limbs_of(lost)] == ["pelvis", "left_thigh", "head", "right_toes", "left_hand", "right_hand"]
    here, there = (Configuration(body, State.neutral(body)) for body in (HUMAN, lost))
    for name, place in zip(lost.landmark_names, there.landmarks_world, strict=True):
        assert place == pytest.approx(here.landmarks_world[HUMAN.landmark_index(name)], abs=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_points_of_who_has_lost_a_leg_are_those_that_are_left(side):
    """The size, and with it where points are expected, is that of the leg that is there."""
    large = gait_human(HumanMeasures.of_stature(1.2 * 1.75))
    lost = without_links(large, [f"{side}_shank"])
    assert relative_size(lost) == pytest.approx(1.2) and leg_ratio(lost) == pytest.approx(0.0, abs=1e-9)
    names, points = points_of(lost, BLAZEPOSE)
    assert set(BLAZEPOSE) - set(names) == {f"{side}_{name}" for name in ("ankle", "heel", "foot_index")}
    table = [BLAZEPOSE[name] for name in names]
    assert points.means == pytest.approx(expected_offsets(large, table))


def test_a_part_takes_the_place_of_a_link():
    body = with_part(HUMAN, "left_shank", blade())
    assert "left_foot" not in body.chain.links and "left_knee_flexion" not in body.chain.dof_names
    state = State.neutral(body)
    places = dict(zip(body.landmark_names, Configuration(body, state).landmarks_world, strict=True))
    assert places["left_ankle"] == pytest.approx(places["left_knee"] - [0, 0, 0.4], abs=1e-9)
    state.joint_positions[body.chain.axis_index("left_blade_flexion")] = np.pi / 2
    bent = dict(zip(body.landmark_names, Configuration(body, state).landmarks_world, strict=True))
    assert bent["left_ankle"] == pytest.approx(places["left_knee"] + [-0.3, 0, -0.1], abs=1e-9)


def test_mistakes():
    with pytest.raises(ModelError, match="without its root 'pelvis'"):
        without_links(HUMAN, ["pelvis"])
    with pytest.raises(UnknownNameError, match="left_wing"):
        without_links(HUMAN, ["left_wing"])
    with pytest.raises(ModelError, match=r"'blade' in the place of 'right_shank': the body has a landmark 'left_ankle'"):
        with_part(HUMAN, "right_shank", blade())
    with pytest.raises(ModelError, match="a link 'base'"):
        with_part(crane(), "hook", gantry())
    fingers = tuple(
        Joint(name, "palm", name, np.eye(4), (Axis(name, (1.0, 0.0, 0.0), mimic=Following(leader) if leader else None),))
        for name, leader in (("one", ""), ("other", "one"))
    )
    gripper = ArticulatedModel("gripper", KinematicChain(("palm", "one", "other"), fingers), ())
    with pytest.raises(ModelError, match="'other' of 'gripper' follows 'one', which is among the removed"):
        without_links(gripper, ["one"])
    assert without_links(gripper, ["other"]).n_dof == 7
