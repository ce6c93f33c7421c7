"""The procedural motion."""

import numpy as np

from tracker_node.synthesis.motions import swing


def test_the_procedural_motion_needs_no_file_and_is_smooth():
    motion = swing(30.0, 90)
    steps = np.linalg.norm(np.diff(motion.rotations, axis=0), axis=(2, 3))
    assert steps.max() < np.radians(15.0) * np.sqrt(2.0)
    assert np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1).max() < 0.05
    raised = motion.of("right_upper_arm")[45] @ [0.0, 0.0, -1.0]
    assert raised[0] > 0.8  # the arm is up in front at half time


def test_centered_puts_the_middle_above_the_origin():
    positions = swing(30.0, 40).centered().root_positions
    np.testing.assert_allclose(positions[:, :2].min(axis=0), -positions[:, :2].max(axis=0), atol=1e-12)
