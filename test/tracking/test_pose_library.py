"""Postures to begin with: limbs of a tree, sides, what can be reached, and the postures in degrees."""

import numpy as np
import pytest

from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.tracking.limbs.tree import joint_groups
from tracker_node.tracking.poses import library_poses, other_side, reachable

HUMAN = human_model()
CHAIN = HUMAN.chain


def test_limbs_are_the_stretches_without_a_branch():
    names = [axis.name for axis in CHAIN.axes]
    groups = [[names[i] for i in group] for group in joint_groups(CHAIN)]
    assert sorted(name for group in groups for name in group) == sorted(names)
    for side in ("left", "right"):
        leg = next(group for group in groups if f"{side}_hip_flexion" in group)
        assert f"{side}_knee_flexion" in leg
        arm = next(group for group in groups if f"{side}_elbow_flexion" in group)
        assert f"{side}_shoulder_elevation_front" in arm
        assert all(name.startswith(side) for name in leg + arm)
    assert len(groups) == 6


def test_the_other_side_is_by_name():
    assert other_side(["left_a", "b", "right_a", "left_c", "leftish"]).tolist() == [2, 1, 0, 3, 4]
    assert other_side([]).tolist() == []


def test_stiff_axes_stay_within_half_a_radian_of_neutral():
    low, high = reachable(CHAIN)
    for i, axis in enumerate(CHAIN.axes):
        wide = 0.5 if axis.stiffness > 1.0 else np.pi
        assert low[i] == max(CHAIN.lower[i], axis.neutral - wide)
        assert high[i] == min(CHAIN.upper[i], axis.neutral + wide)
    assert any(axis.stiffness > 1.0 for axis in CHAIN.axes)
    assert any(axis.stiffness <= 1.0 for axis in CHAIN.axes)


NEUTRAL = np.array([axis.neutral for axis in CHAIN.axes])


def contains(rows, **degrees):
    """A posture that is neutral but for these, both sides where no side is named."""
    row = NEUTRAL.copy()
    for name, angle in degrees.items():
        for i, axis in enumerate(CHAIN.axes):
            if axis.name in (name, f"left_{name}", f"right_{name}"):
                row[i] += np.radians(angle)
    row = np.clip(row, CHAIN.lower, CHAIN.upper)
    return np.isclose(rows, row, atol=1e-9).all(axis=1).sum()


@pytest.mark.parametrize(
    "degrees",
    [
        {"shoulder_elevation_front": 60, "shoulder_elevation_back": 30},
        {"shoulder_elevation_front": 90, "shoulder_elevation_back": 45},
        {"shoulder_elevation_front": 80, "shoulder_elevation_back": -40},
        {"elbow_flexion": 90},
        {"hip_flexion": 80, "knee_flexion": 80},
        {"hip_flexion": 75, "knee_flexion": 90, "abdomen_flexion": 25},
        {"left_hip_flexion": 40, "left_knee_flexion": 45, "right_hip_flexion": -10, "right_knee_flexion": 15},
        {"right_hip_flexion": 40, "right_knee_flexion": 45, "left_hip_flexion": -10, "left_knee_flexion": 15},
        {"left_shoulder_elevation_front": 165}, {"right_shoulder_elevation_front": 165},
    ],
)  # fmt: skip
def test_known_postures_are_tried_once_on_either_side(degrees):
    assert contains(library_poses(HUMAN, 0, 0), **degrees) == 1


def test_the_neutral_one_comes_first_and_all_are_within_the_limits():
    rows = library_poses(HUMAN, 20, 3)
    np.testing.assert_array_equal(rows[0], np.clip(NEUTRAL, CHAIN.lower, CHAIN.upper))
    assert np.all((rows >= CHAIN.lower) & (rows <= CHAIN.upper))
    assert len(np.unique(rows, axis=0)) == len(rows) == len(library_poses(HUMAN, 0, 0)) + 20
    np.testing.assert_array_equal(rows, library_poses(HUMAN, 20, 3))
    assert not np.array_equal(rows[-20:], library_poses(HUMAN, 20, 4)[-20:])


def test_samples_fill_what_can_be_reached_within_1_2_radians():
    sampled = library_poses(HUMAN, 400, 0)[-400:]
    low, high = reachable(CHAIN)
    low, high = np.maximum(low, NEUTRAL - 1.2), np.minimum(high, NEUTRAL + 1.2)
    assert np.all((sampled >= low - 1e-12) & (sampled <= high + 1e-12))
    span = high - low
    assert np.all(sampled.min(axis=0) < low + 0.05 * span)
    assert np.all(sampled.max(axis=0) > high - 0.05 * span)
    np.testing.assert_allclose(sampled.mean(axis=0), 0.5 * (low + high), atol=0.05 * span.max())


def test_a_body_without_joints_has_one_posture():
    rigid = ArticulatedModel("rigid", KinematicChain(("base",), ()), HUMAN.shapes[:0])
    assert library_poses(rigid, 5, 0).shape == (1, 0)
