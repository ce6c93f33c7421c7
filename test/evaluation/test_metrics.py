"""Figures against hand-made cases and plain loops."""

import numpy as np
import pytest

from tracker_node.evaluation import metrics
from tracker_node.evaluation.evaluate import ErrorSeries, _bone_lengths
from tracker_node.geometry import so3
from tracker_node.loaders.motion.trajectory_file import Trajectories


def random_case(seed=0, n=13, m=4):
    rng = np.random.default_rng(seed)
    estimate, truth = rng.normal(size=(2, n, m, 3))
    valid = rng.random((n, m)) < 0.7
    rotations = np.array([[so3.exp(rng.normal(size=3)) for _ in range(m)] for _ in range(n)])
    return estimate, truth, valid, rotations


def test_errors_of_a_hand_made_case():
    truth = np.zeros((2, 2, 3))
    estimate = np.array([[[3.0, 4.0, 0.0], [0.0, 0.0, 1.0]], [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]])
    valid = np.array([[True, True], [True, False]])
    errors = metrics.joint_errors(estimate, truth)
    assert errors.tolist() == [[5.0, 1.0], [0.0, 2.0]]
    assert metrics.mean_error(errors, valid) == pytest.approx(2.0)  # (5 + 1 + 0) / 3
    series = ErrorSeries(errors, valid)
    assert series.per_joint_mm().tolist() == [2500.0, 1000.0]
    assert series.per_set_mm().tolist() == [3000.0, 0.0]


def test_mean_over_nothing_is_not_a_number():
    errors, valid = np.ones((3, 2)), np.array([[True, False]] * 3)
    by_joint = ErrorSeries(errors, valid).per_joint_mm()
    assert by_joint[0] == 1000.0 and np.isnan(by_joint[1])
    assert np.isnan(ErrorSeries(errors[:0], valid[:0]).per_joint_mm()).all()
    assert np.isnan(metrics.mean_error(errors, np.zeros_like(valid)))


@pytest.mark.parametrize("in_segment", [True, False])
def test_offset_free_errors_against_loops(in_segment):
    estimate, truth, valid, rotations = random_case()
    errors, offsets = metrics.offset_free_errors(estimate - truth, valid, rotations if in_segment else None)
    for j in range(truth.shape[1]):
        rows = [i for i in range(len(truth)) if valid[i, j]]
        R = [rotations[i, j] if in_segment else np.eye(3) for i in rows]
        local = [r.T @ (estimate[i, j] - truth[i, j]) for r, i in zip(R, rows, strict=True)]
        mean = sum(local) / len(rows)
        assert offsets[j] == pytest.approx(mean)
        for i, r in zip(rows, R, strict=True):
            moved = truth[i, j] + r @ mean
            assert errors[i, j] == pytest.approx(np.linalg.norm(estimate[i, j] - moved))


def test_a_constant_offset_in_the_segment_leaves_nothing_there_but_something_in_the_world():
    _, truth, valid, rotations = random_case(1)
    offsets = np.random.default_rng(2).normal(size=(truth.shape[1], 3))
    estimate = truth + np.einsum("nmij,mj->nmi", rotations, offsets)
    in_segment, found = metrics.offset_free_errors(estimate - truth, valid, rotations)
    assert in_segment[valid].max() < 1e-12
    assert found == pytest.approx(offsets)
    in_world, _ = metrics.offset_free_errors(estimate - truth, valid)
    assert metrics.mean_error(in_world, valid) > 0.1


def test_offsets_ignore_what_is_not_valid():
    estimate, truth, valid, rotations = random_case(3)
    errors, offsets = metrics.offset_free_errors(estimate - truth, valid, rotations)
    estimate[~valid] = 1e9
    again, same = metrics.offset_free_errors(estimate - truth, valid, rotations)
    assert np.array_equal(offsets, same) and np.array_equal(errors[valid], again[valid])


def test_bone_lengths_of_a_hand_made_case():
    positions = np.zeros((3, 3, 3))
    positions[:, 1, 0] = [1.0, 2.0, 3.0]
    positions[:, 2, 0] = [1.0, 2.0, 3.0]
    positions[:, 2, 2] = 0.5
    valid = np.array([[True, True, True], [True, True, False], [True, True, True]])
    names = ("left_shoulder", "left_elbow", "left_wrist")
    points = Trajectories(names, np.arange(3), positions, valid)
    found = _bone_lengths(points, points)
    assert found.bones == (names[:2], names[1:])
    assert found.estimate_mean_mm == pytest.approx([2000.0, 500.0])
    assert found.truth_std_mm == pytest.approx([1e3 * np.std([1, 2, 3]), 0.0])
    none = _bone_lengths(points.select(names[:1]), points)
    assert none.bones == () and none.truth_mean_mm.shape == (0,)


def test_each_reason_loses_a_set():
    errors = np.array([[0.1, 0.2], [0.1, 0.2001], [0.0, 0.0], [0.0, 0.0], [9.0, 0.0]])
    valid = np.ones_like(errors, dtype=bool)
    valid[4, 0] = False  # cannot be judged
    has_estimate = np.array([True, True, False, True, True])
    said_lost = np.array([False, False, False, True, False])
    lost = metrics.lost_sets(has_estimate, said_lost, errors, valid)
    assert lost.tolist() == [False, True, True, True, False]


def test_lost_limbs():
    near, far = 0.15, 0.1501
    errors = np.full((12, 5), near)
    errors[2:6, 0] = far  # four running: not lost
    errors[2:7, 1] = far  # five running
    errors[11, 2] = far  # at the end
    errors[[1, 3, 5, 7, 9], 3] = far  # five, not running
    errors[2:8, 4] = far  # six, one of which cannot be judged: five of those that can
    valid = np.ones_like(errors, dtype=bool)
    valid[4, 4] = False
    assert metrics.lost_limbs(errors, valid).tolist() == [False, True, True, False, True]


def test_the_end_is_the_last_set_that_can_be_judged():
    errors = np.array([[0.0], [0.3], [0.0]])
    valid = np.array([[True], [True], [False]])
    assert metrics.lost_limbs(errors, valid).tolist() == [True]
    assert metrics.lost_limbs(errors, np.zeros_like(valid)).tolist() == [False]


def test_intersection_over_union():
    a, b = np.zeros((2, 10, 10), dtype=np.uint8)
    a[:5], b[3:8] = 255, 1
    assert metrics.intersection_over_union(a, b) == pytest.approx(20 / 80)
    assert metrics.intersection_over_union(a, a) == 1.0
    assert np.isnan(metrics.intersection_over_union(np.zeros((3, 3)), np.zeros((3, 3))))
    with pytest.raises(ValueError, match="one shape"):
        metrics.intersection_over_union(a, a[:5])
