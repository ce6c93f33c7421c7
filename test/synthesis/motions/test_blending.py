"""Motions joined to one: nothing jumps, each part goes on where the last ended, and all of it stays in the room."""

from itertools import pairwise

import numpy as np
import pytest

from tracker_node.geometry import so3
from tracker_node.synthesis.motions.motion import SEGMENT_PARENTS, SEGMENTS, Motion, chained, heading, joined, swing, within

RATE_HZ = 30.0


def turned(motion: Motion, angle: float, shift) -> Motion:
    turn = so3.exp([0.0, 0.0, angle])
    return Motion(motion.name, motion.rate_hz, motion.root_positions @ turn.T + shift, turn @ motion.rotations)


def still(angle: float) -> Motion:
    """Stands, its right elbow bent by ``angle``."""
    local = {segment: np.tile(np.eye(3), (40, 1, 1)) for segment in SEGMENTS}
    local["right_forearm"] = np.tile(so3.exp([0.0, -angle, 0.0]), (40, 1, 1))
    return Motion("still", RATE_HZ, np.tile([0.0, 0.0, 0.9], (40, 1)), chained(local))


def largest_turns(motion: Motion) -> np.ndarray:
    """(n - 1,) most that any segment turns against its parent from one image to the next, radians."""
    local = []
    for segment, parent in SEGMENT_PARENTS.items():
        here = motion.of(segment)
        local.append(np.swapaxes(motion.of(parent), 1, 2) @ here if parent else here)
    steps = np.array([[so3.log(a.T @ b) for a, b in pairwise(one)] for one in local])
    return np.linalg.norm(steps, axis=-1).max(axis=0)


def test_where_the_next_motion_stands_and_looks_makes_no_difference():
    a, b = swing(RATE_HZ, 40), swing(RATE_HZ, 45)
    one, other = joined([a, b], 120, "x"), joined([a, turned(b, 2.0, [3.0, -1.0, 0.0])], 120, "x")
    np.testing.assert_allclose(one.root_positions[:70], other.root_positions[:70], atol=1e-12)
    np.testing.assert_allclose(one.rotations[:70], other.rotations[:70], atol=1e-12)
    assert len(one) == 120 and one.name == "x"


def test_the_body_goes_on_as_it_was():
    a = swing(RATE_HZ, 60)
    motion = joined([a, turned(swing(RATE_HZ, 60), 1.0, [1.0, 0.0, 0.0])], 110, "x")
    np.testing.assert_array_equal(motion.root_positions[:51], a.root_positions[:51])
    speed = np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1)
    assert speed.max() < 1.5 * np.linalg.norm(np.diff(a.root_positions, axis=0), axis=1).max()
    np.testing.assert_allclose(heading(motion.of("pelvis")[105]), heading(a.of("pelvis")[54 + 1]), atol=0.15)


def test_a_blend_turns_joints_smoothly_by_all_of_their_difference():
    motion = joined([still(0.0), still(1.5)], 71, "x")
    turns = largest_turns(motion)
    assert turns.sum() == pytest.approx(1.5, abs=1e-9)
    assert turns[30:41].sum() == pytest.approx(1.5, abs=1e-9)  # within the 9 images of 0.3 s
    assert turns.max() < 1.6 * 1.5 / 9  # the steepest slope of a smooth step is 1.5


def test_within_keeps_steps_and_bounds_the_path():
    motion = joined([swing(RATE_HZ, 60)], 600, "x")
    kept = within(motion, 1.0)
    assert np.ptp(motion.root_positions[:, 0]) > 5.0
    assert np.linalg.norm(kept.root_positions[100:-100, :2], axis=1).max() < 1.2
    np.testing.assert_array_equal(kept.root_positions[:, 2], motion.root_positions[:, 2])
    # What is taken out is slow: no faster than the walk itself.
    change = np.diff(kept.root_positions - motion.root_positions, axis=0)
    assert np.linalg.norm(change, axis=1).max() < np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1).max()


def test_motions_that_do_not_go_together_are_refused():
    with pytest.raises(ValueError, match="one rate"):
        joined([swing(30.0, 60), swing(60.0, 60)], 90, "x")
    with pytest.raises(ValueError, match="at least 18 images"):
        joined([swing(30.0, 10)], 90, "x")
