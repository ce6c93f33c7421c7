"""Truth that is far from all that was tracked: what it would be near as."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.evaluation.truth.association import doubts_of_truth
from tracker_node.geometry import so3
from tracker_node.loaders.motion.trajectory_file import Trajectories

PERIOD_NS, N = 33_333_333, 60
NAMES = ("left_hip", "right_hip", "left_knee", "right_knee", "neck")
BODY = np.array([[0.1, 0.0, 0.9], [-0.1, 0.0, 0.9], [0.1, 0.1, 0.5], [-0.1, 0.1, 0.5], [0.0, 0.0, 1.5]])


def joints(off_m: float = 0.0) -> Trajectories:
    """Somebody who walks there and back, and turns."""
    t = np.arange(N) / 30.0
    turns = np.array([so3.exp(np.array([0.0, 0.0, 0.8 * x])) for x in t])
    places = np.stack([1.5 * np.sin(1.3 * t), 1.5 * t, np.zeros(N)], axis=1)
    positions = np.einsum("nij,mj->nmi", turns, BODY * [2.0, 1.0, 1.0]) + places[:, None] + off_m * np.array([1.0, 0.0, 0.0])
    return Trajectories(NAMES, (np.arange(N) * PERIOD_NS).astype(np.int64), positions, np.ones((N, len(NAMES)), dtype=bool))


def with_positions(truth: Trajectories, positions: np.ndarray) -> Trajectories:
    return replace(truth, positions_m=positions)


AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
TRUE = joints()
WRONG = {
    "1000 times as far from each other as the run's: is its unit right?": with_positions(TRUE, 1000.0 * TRUE.positions_m),
    "0.01 times as far": with_positions(TRUE, 0.01 * TRUE.positions_m),
    "left and right of its names exchanged: are its sides right?": with_positions(TRUE, TRUE.positions_m[:, [1, 0, 3, 2, 4]]),
    "at 0.5 times its rate: is its rate right?": replace(TRUE, stamps_ns=TRUE.stamps_ns // 2),
    "at 2 times its rate": replace(TRUE, stamps_ns=TRUE.stamps_ns * 2),
    "turned as a whole by 120 degrees about (-0.6, -0.6, -0.6) and moved by 0.00 m: has it the run's world, and its axes": (
        with_positions(TRUE, TRUE.positions_m @ AXES)
    ),
    "and moved by 2.00 m": joints(2.0),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_wrong_with_the_truth_is_said(said):
    noise = np.random.default_rng(1).normal(0.0, 0.01, TRUE.positions_m.shape)
    (doubt,) = doubts_of_truth(with_positions(TRUE, TRUE.positions_m + noise), WRONG[said], 0)
    assert said in doubt


def test_truth_that_is_near_or_far_in_no_simple_way_is_not_doubted():
    assert doubts_of_truth(joints(0.1), TRUE, 0) == []
    assert doubts_of_truth(joints(0.1), TRUE, 0, length_scale=0.2)  # of a small animal that is far
    rng = np.random.default_rng(2)
    lost = TRUE.positions_m + np.cumsum(rng.normal(0.0, 0.15, (N, 1, 3)), axis=0)
    assert doubts_of_truth(with_positions(TRUE, lost), TRUE, 0) == []
    nothing = replace(TRUE, valid=np.zeros_like(TRUE.valid))
    assert doubts_of_truth(TRUE, nothing, 0) == []
