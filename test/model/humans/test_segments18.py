"""The body of 18 segments in figures: places of joints, limits and signs of axes, landmarks, and the size of every segment.

Published figures hold for this body; what changes it has to change them.
"""

import numpy as np
import pytest

from tracker_node.model.humans.segments18 import body_chain, body_landmarks, nurbs_human

CHAIN = body_chain()
# Joint: parent, child, place in the parent in millimeters; the right side is its mirror image.
JOINTS = {
    "torso": ("pelvis", "torso", (0.0, 0.0, 0.0)),
    "chest": ("torso", "chest", (0.0, 0.0, 111.0)),
    "neck": ("chest", "head", (0.0, 0.0, 157.0)),
    "left_clavicle": ("chest", "left_shoulder", (0.0, 30.0, 115.0)),
    "left_shoulder": ("left_shoulder", "left_upper_arm", (0.0, 141.5, -10.0)),
    "left_elbow": ("left_upper_arm", "left_forearm", (0.0, 0.0, -299.5)),
    "left_wrist": ("left_forearm", "left_hand", (0.0, 0.0, -264.5)),
    "left_hip": ("pelvis", "left_thigh", (0.0, 86.8, -277.0)),
    "left_knee": ("left_thigh", "left_shank", (0.0, 0.0, -449.0)),
    "left_ankle": ("left_shank", "left_foot", (0.0, 0.0, -429.0)),
}
# Landmark: link, place in millimeters.
LANDMARKS = {
    "neck": ("chest", (0.0, 0.0, 157.0)),
    "head": ("head", (20.0, 0.0, 308.0)),
    "nose": ("head", (122.0, 0.0, 152.0)),
    "left_hip": ("pelvis", (0.0, 86.7, -277.0)),
    "left_shoulder": ("left_shoulder", (0.0, 141.5, -10.0)),
    "left_elbow": ("left_upper_arm", (0.0, 0.0, -299.5)),
    "left_wrist": ("left_forearm", (0.0, 0.0, -264.5)),
    "left_knee": ("left_thigh", (0.0, 0.0, -449.0)),
    "left_ankle": ("left_shank", (0.0, 0.0, -429.0)),
    "left_big_toe": ("left_foot", (200.0, -22.0, -52.0)),
    "left_small_toe": ("left_foot", (155.0, 40.0, -55.0)),
    "left_heel": ("left_foot", (-45.0, 0.0, -50.0)),
}
# Segment: liters, lowest, highest and mean coordinates of its surface in millimeters.
SIZES = {
    "pelvis": (23.212, (-125.9, -174.3, -369.0), (120.5, 174.3, 50.0), (-3.4, 0.0, -167.1)),
    "torso": (10.677, (-137.1, -149.1, -50.0), (137.1, 149.1, 161.0), (0.0, 0.0, 55.5)),
    "chest": (9.98, (-137.1, -148.6, -50.0), (137.1, 148.6, 177.0), (0.0, 0.0, 73.3)),
    "head": (5.639, (-86.1, -80.4, -40.0), (122.1, 80.4, 308.0), (10.8, 0.0, 113.0)),
    "left_shoulder": (2.665, (-81.4, -56.5, -30.0), (81.4, 70.9, 187.1), (0.0, 5.8, 73.5)),
    "left_upper_arm": (2.527, (-53.6, -53.6, -337.1), (53.6, 53.6, 45.6), (0.0, 0.0, -148.7)),
    "left_forearm": (1.528, (-45.0, -45.0, -289.5), (45.0, 45.0, 37.6), (0.0, 0.0, -130.6)),
    "left_hand": (0.441, (-49.3, -24.1, -169.5), (49.3, 24.1, 20.0), (0.0, 0.0, -76.4)),
    "left_thigh": (13.071, (-102.4, -109.4, -495.7), (102.4, 95.4, 60.0), (0.0, -2.8, -223.2)),
    "left_shank": (4.786, (-72.4, -63.1, -454.0), (62.3, 63.1, 46.7), (-4.7, 0.0, -212.3)),
    "left_foot": (1.037, (-10.2, -52.2, -55.0), (71.2, 52.2, 221.5), (45.4, 0.0, 86.1)),
}
LIMITS_DEG = {
    "shoulder_elevation_front": (-90.0, 200.0), "elbow_flexion": (-10.0, 155.0), "wrist_flexion": (-75.0, 85.0),
    "hip_flexion": (-40.0, 140.0), "hip_abduction": (-45.0, 80.0), "knee_flexion": (-10.0, 160.0),
    "ankle_dorsiflexion": (-75.0, 35.0), "clavicle_elevation": (-20.0, 45.0),
}  # fmt: skip


def other(name):
    return name.replace("left_", "right_")


def mirrored(place):
    return np.array(place) * [1.0, -1.0, 1.0]


def test_joints_are_where_they_are_on_both_sides():
    found = {joint.name: joint for joint in CHAIN.joints}
    assert set(found) == set(JOINTS) | set(map(other, JOINTS))
    for name, (parent, child, place) in JOINTS.items():
        assert (found[name].parent, found[name].child) == (parent, child)
        np.testing.assert_allclose(1e3 * found[name].T_parent_joint[:3, 3], place, atol=0.06)
        np.testing.assert_allclose(1e3 * found[other(name)].T_parent_joint[:3, 3], mirrored(place), atol=0.06)
        assert (found[other(name)].parent, found[other(name)].child) == (other(parent), other(child))


@pytest.mark.parametrize("name", LIMITS_DEG)
def test_axes_have_their_limits_and_are_mirrored(name):
    left, right = (next(axis for axis in CHAIN.axes if axis.name == f"{side}_{name}") for side in ("left", "right"))
    assert np.degrees([left.lower, left.upper]) == pytest.approx(LIMITS_DEG[name])
    assert (right.lower, right.upper, right.neutral, right.stiffness) == (left.lower, left.upper, left.neutral, left.stiffness)
    x, y, z = left.direction
    assert tuple(right.direction) == pytest.approx((-x, y, -z))  # a turn is a pseudovector


def test_arms_hang_seven_degrees_off_the_trunk():
    neutral = {axis.name: np.degrees(axis.neutral) for axis in CHAIN.axes if axis.neutral}
    assert neutral == pytest.approx(
        {f"{side}_shoulder_elevation_{way}": 7.0 for side in ("left", "right") for way in ("front", "back")}
    )


def test_landmarks_are_on_their_links():
    found = {mark.name: (mark.link, 1e3 * np.array(mark.position)) for mark in body_landmarks()}
    assert set(found) == set(LANDMARKS) | set(map(other, LANDMARKS))
    for name, (link, place) in LANDMARKS.items():
        for own, at in ((name, np.array(place)), (other(name), mirrored(place))):
            assert found[own][0] == (link if own == name else other(link))
            np.testing.assert_allclose(found[own][1], at, atol=0.06)


@pytest.mark.parametrize("name", SIZES)
def test_segments_have_their_size(name):
    liters, low, high, mean = SIZES[name]
    surfaces = {shape.name: shape.primitive for shape in nurbs_human().shapes}
    for own, sign in ((name, 1.0), (other(name), -1.0)):
        vertices = surfaces[own].vertices * ([1.0, sign, 1.0] if own != name else 1.0)
        corners = surfaces[own].vertices[surfaces[own].faces]
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
        assert 1e3 * volume == pytest.approx(liters, rel=1e-3)
        for found, expected in ((vertices.min(axis=0), low), (vertices.max(axis=0), high), (vertices.mean(axis=0), mean)):
            np.testing.assert_allclose(1e3 * found, expected, atol=0.06)
