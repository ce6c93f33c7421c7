"""Joints that motion is judged by, bones between them, and links in whose frames offsets are constant."""

import numpy as np

from tracker_node.evaluation.truth.files import BONES, EVALUATED_JOINTS, LIMBS, common_bones, common_joints, offset_links
from tracker_node.model.humans.human import human_model

HUMAN = human_model()


def test_a_person_is_judged_by_fourteen_joints_in_their_order():
    names = ["left_wrist", "other", "head", "right_hip"]
    assert common_joints(names, ["right_hip", "other", "left_wrist", "head", "neck"]) == ("head", "left_wrist", "right_hip")
    assert len(EVALUATED_JOINTS) == 14
    assert common_joints(EVALUATED_JOINTS, EVALUATED_JOINTS) == EVALUATED_JOINTS


def test_another_body_is_judged_by_all_names_that_both_have():
    assert common_joints({"a", "b"}, ("c", "b", "a")) == ("b", "a")
    assert common_joints({"a"}, ("b",)) == ()


def test_bones_have_both_ends():
    assert common_bones(["left_hip", "left_knee", "right_hip"]) == (("left_hip", "left_knee"), ("left_hip", "right_hip"))
    assert len(BONES) == 11
    assert {end for bone in BONES for end in bone} == set(EVALUATED_JOINTS)
    assert LIMBS["right leg"] == "right_ankle"


def test_offsets_are_in_the_link_before_the_last():
    """A wrist lies on the forearm, which carries a hand; what lies on the hand itself goes with the forearm."""
    chain = HUMAN.chain
    names = HUMAN.landmark_names
    for name, link in zip(names, offset_links(HUMAN, names), strict=True):
        own = HUMAN.landmark_links[HUMAN.landmark_index(name)]
        last = own not in chain.parents
        assert link == (chain.parents[own] if last and chain.parents[own] >= 0 else own)
    assert np.any(offset_links(HUMAN, names) != [HUMAN.landmark_links[HUMAN.landmark_index(name)] for name in names])
