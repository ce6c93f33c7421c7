"""The procedural motion, and rotations chained along a body."""

import numpy as np
import pytest

from tracker_node.geometry import so3
from tracker_node.synthesis.motions.motion import SEGMENT_PARENTS, SEGMENTS, chained, heading, swing


def test_the_procedural_motion_needs_no_file_and_is_smooth():
    motion = swing(30.0, 90)
    steps = np.linalg.norm(np.diff(motion.rotations, axis=0), axis=(2, 3))
    assert steps.max() < np.radians(15.0) * np.sqrt(2.0)
    assert np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1).max() < 0.05
    raised = motion.of("right_upper_arm")[45] @ [0.0, 0.0, -1.0]
    assert raised[0] > 0.8  # the arm is up in front at half time


def test_centered_puts_the_middle_above_the_origin():
    motion = swing(30.0, 40)
    positions = motion.centered().root_positions
    np.testing.assert_allclose(positions[:, :2].min(axis=0), -positions[:, :2].max(axis=0), atol=1e-12)
    np.testing.assert_array_equal(positions[:, 2], motion.root_positions[:, 2])


RATE_HZ = 80.0  # a step of the motion, 1.25 s, is a hundred images
QUARTER = 25
MOTION = swing(RATE_HZ, 401)  # five seconds


def angle_deg(segment, index, axis, parent=None):
    """Of a segment's turn about an axis, in its parent's axes."""
    rotation = MOTION.of(segment)[index]
    if parent is not None:
        rotation = MOTION.of(parent)[index].T @ rotation
    return np.degrees(so3.log(rotation) @ np.asarray(axis, dtype=float))


FORWARD = (0.0, -1.0, 0.0)
UP = (0.0, 0.0, 1.0)


def test_the_root_walks_forward_and_bobs_twice_a_step():
    np.testing.assert_allclose(MOTION.root_positions[0], [0.0, 0.0, 0.87])
    np.testing.assert_allclose(MOTION.root_positions[QUARTER], [0.35 * 0.3125, 0.02, 0.85], atol=1e-12)
    np.testing.assert_allclose(MOTION.root_positions[100], [0.35 * 1.25, 0.0, 0.87], atol=1e-12)
    assert MOTION.rate_hz == RATE_HZ


@pytest.mark.parametrize(
    ("segment", "parent", "axis", "index", "radians"),
    [
        ("pelvis", None, UP, QUARTER, 0.08),
        ("torso", "pelvis", UP, QUARTER, -0.16),
        ("head", "torso", UP, 2 * QUARTER, 0.25),
        ("right_thigh", "pelvis", FORWARD, QUARTER, 0.35),
        ("right_thigh", "pelvis", FORWARD, 0, 0.15),
        ("left_thigh", "pelvis", FORWARD, QUARTER, -0.35),
        ("left_thigh", "pelvis", FORWARD, 0, 0.0),
        ("left_thigh", "pelvis", FORWARD, 2 * QUARTER, 0.15),
        ("right_shank", "right_thigh", FORWARD, 0, -0.72),
        ("right_shank", "right_thigh", FORWARD, QUARTER, -0.12),
        ("left_shank", "left_thigh", FORWARD, 2 * QUARTER, -0.72),
        ("right_foot", "right_shank", FORWARD, QUARTER, 0.1),
        ("right_forearm", "right_upper_arm", FORWARD, QUARTER, 0.5),
        ("left_forearm", "left_upper_arm", FORWARD, QUARTER, 0.2),
        ("left_forearm", "left_upper_arm", FORWARD, 0, 0.35),
    ],
)
def test_segments_turn_by_these_angles(segment, parent, axis, index, radians):
    """At quarters of a step: a thigh that goes forward is lifted and its knee bends as it comes through the middle."""
    assert SEGMENT_PARENTS[segment] == parent or parent is None
    assert np.radians(angle_deg(segment, index, axis, parent)) == pytest.approx(radians, abs=1e-9)


def test_arms_stand_off_and_the_right_one_is_raised_once():
    def arm(side, index):
        return MOTION.of("torso")[index].T @ MOTION.of(f"{side}_upper_arm")[index]

    np.testing.assert_allclose(arm("right", 0), so3.exp([-0.12, 0.0, 0.0]), atol=1e-9)
    np.testing.assert_allclose(arm("left", 0), so3.exp([0.12, 0.0, 0.0]), atol=1e-9)
    swung = so3.exp([0.0, -0.35, 0.0]) @ so3.exp([0.12, 0.0, 0.0])  # forward while the left leg is back
    np.testing.assert_allclose(arm("left", QUARTER), swung, atol=1e-9)
    raised = so3.exp([0.0, -1.7, 0.0]) @ so3.exp([-0.12, 0.0, 0.0])
    np.testing.assert_allclose(arm("right", 200), raised, atol=1e-9)  # at half of five seconds
    np.testing.assert_allclose(arm("right", 400), so3.exp([-0.12, 0.0, 0.0]), atol=1e-9)
    half = 0.5  # raised at a quarter, in a whole step: nothing of the swing
    np.testing.assert_allclose(arm("right", 100), so3.exp([0.0, -1.7 * half, 0.0]) @ so3.exp([-0.12, 0.0, 0.0]), atol=1e-9)


@pytest.mark.parametrize("n_images", [1, 2])
def test_short_motions_raise_the_arm_within_two_seconds(n_images):
    motion = swing(1.0, n_images)
    arm = motion.of("torso")[-1].T @ motion.of("right_upper_arm")[-1]
    angle = {1: 0.0, 2: 1.7}[n_images]
    np.testing.assert_allclose(arm, so3.exp([0.0, -angle, 0.0]) @ so3.exp([-0.12, 0.0, 0.0]), atol=1e-9)


def test_rotations_are_chained_from_the_root_on():
    local = {segment: so3.exp([0.0, 0.0, 0.1])[None] for segment in SEGMENTS}
    world = chained(local)
    assert world.shape == (1, len(SEGMENTS), 3, 3)
    depth = {None: 0}
    for segment in SEGMENTS:
        depth[segment] = depth[SEGMENT_PARENTS[segment] or None] + 1
        np.testing.assert_allclose(world[0, SEGMENTS.index(segment)], so3.exp([0.0, 0.0, 0.1 * depth[segment]]), atol=1e-12)
    turns = {segment: np.eye(3)[None] for segment in SEGMENTS}
    turns["pelvis"], turns["torso"] = so3.exp([1.0, 0.0, 0.0])[None], so3.exp([0.0, 1.0, 0.0])[None]
    expected = so3.exp([1.0, 0.0, 0.0]) @ so3.exp([0.0, 1.0, 0.0])
    np.testing.assert_allclose(chained(turns)[0, SEGMENTS.index("torso")], expected, atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_heading_is_the_turn_about_the_vertical(yaw):
    tilt = so3.exp([0.3, -0.2, 0.0])
    np.testing.assert_allclose(heading(so3.exp([0.0, 0.0, yaw]) @ tilt), so3.exp([0.0, 0.0, yaw]), atol=1e-12)


def test_times_are_seconds_from_the_first_image():
    np.testing.assert_allclose(swing(50.0, 3).times_s, [0.0, 0.02, 0.04])
