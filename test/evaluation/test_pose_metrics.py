"""Measures of poses against other ways to compute them, and what they must not depend on."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial import procrustes
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from tracker_node.evaluation import pose_metrics as measures
from tracker_node.evaluation.metrics import Interval, intervals, reacquisition_times, spread_of

SEEDS = st.integers(0, 2**32 - 1)


def poses(rng, n: int = 20, spread: float = 0.1):
    """Joints (n, 13, 3) and the same with noise, all of them valid."""
    truth = rng.normal(scale=0.5, size=(n, 13, 3))
    return truth + rng.normal(scale=spread, size=truth.shape), truth, np.ones((n, 13), dtype=bool)


def transforms(rotations: Rotation, translations: np.ndarray) -> np.ndarray:
    T = np.tile(np.eye(4), (len(translations), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = rotations.as_matrix(), translations
    return T


def test_procrustes_is_that_of_scipy():
    estimate, truth, valid = poses(np.random.default_rng(0))
    aligned = measures.procrustes_aligned(estimate, truth, valid)
    for mine, a, b in zip(aligned, estimate, truth, strict=True):
        _, _, disparity = procrustes(b, a)  # of shapes of unit size; may mirror, which is not needed here
        size = np.linalg.norm(b - b.mean(axis=0))
        assert ((mine - b) ** 2).sum() == pytest.approx(disparity * size**2, rel=1e-9)


def test_procrustes_does_not_mirror():
    truth = np.random.default_rng(2).normal(size=(1, 13, 3))
    mirrored, valid = truth * [1.0, 1.0, -1.0], np.ones((1, 13), dtype=bool)
    aligned = measures.procrustes_aligned(mirrored, truth, valid)

    def cost(x):  # over all rotations, translations and sizes: the best one is not far below what was found
        moved = np.exp(x[6]) * Rotation.from_rotvec(x[:3]).apply(mirrored[0]) + x[3:6]
        return ((moved - truth[0]) ** 2).sum()

    starts = [np.concatenate([Rotation.random(random_state=i).as_rotvec(), np.zeros(4)]) for i in range(30)]
    best = min(minimize(cost, start).fun for start in starts)
    assert ((aligned - truth) ** 2).sum() == pytest.approx(best, rel=1e-6)
    assert best > 0.1


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, scale=st.floats(0.3, 3.0))
def test_pa_mpjpe_does_not_see_place_heading_and_size(seed, scale):
    rng = np.random.default_rng(seed)
    estimate, truth, valid = poses(rng, 5)
    valid &= rng.uniform(size=valid.shape) < 0.8
    moved = scale * Rotation.random(random_state=rng).apply(estimate.reshape(-1, 3)).reshape(estimate.shape) + rng.normal(size=3)
    assert measures.pa_mpjpe(moved, truth, valid) == pytest.approx(measures.pa_mpjpe(estimate, truth, valid), rel=1e-6)


def test_joints_that_do_not_count_have_no_part():
    estimate, truth, valid = poses(np.random.default_rng(3))
    valid[:, 4] = False
    with_lies = truth.copy()
    with_lies[:, 4] = 1e6
    left = [i for i in range(13) if i != 4]
    alone = measures.pa_mpjpe(estimate[:, left], truth[:, left], valid[:, left])
    assert measures.pa_mpjpe(estimate, with_lies, valid) == pytest.approx(alone)


def test_two_joints_are_not_judged():
    estimate, truth, valid = poses(np.random.default_rng(4), 3)
    valid[0, 2:] = False
    assert measures.procrustes_aligned(estimate, truth, valid)[0] == pytest.approx(estimate[0])
    assert measures.pa_mpjpe(estimate, truth, valid) == pytest.approx(measures.pa_mpjpe(estimate[1:], truth[1:], valid[1:]))
    assert np.isnan(measures.pa_mpjpe(estimate[:1], truth[:1], valid[:1]))


def test_pck_counts():
    errors, valid = np.array([[0.01, 0.05, 0.1], [0.2, 9.0, 0.05]]), np.array([[True, True, True], [True, False, True]])
    assert measures.pck(errors, valid, np.array([0.0, 0.05, 0.1, 1.0])) == pytest.approx([0.0, 0.6, 0.8, 1.0])
    assert measures.pck_auc(np.zeros((2, 3)), valid) == 1.0
    assert np.isnan(measures.pck_auc(errors, ~valid & False))


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_pck_rises_and_its_area_is_that_of_the_errors(seed):
    errors = np.random.default_rng(seed).exponential(0.06, size=(40, 7))
    valid = errors < 0.5
    curve = measures.pck(errors, valid, np.linspace(0, 1, 50))
    assert (np.diff(curve) >= 0).all() and curve[-1] == 1.0
    area = 1.0 - np.minimum(errors[valid], 0.15).mean() / 0.15  # the integral of the empirical distribution
    assert measures.pck_auc(errors, valid) == pytest.approx(area, abs=0.02)


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, angle=st.floats(0.0, np.pi), size=st.floats(1e-3, 1e3))
def test_directions(seed, angle, size):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=3)
    axis = np.cross(a, rng.normal(size=3))
    b = size * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).apply(a)
    assert measures.direction_errors(a, b) == pytest.approx(angle, abs=1e-7)
    assert np.isnan(measures.direction_errors(a, np.zeros(3)))


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, angle=st.floats(0.0, np.pi))
def test_rotation_angles_are_those_of_scipy(seed, angle):
    rng = np.random.default_rng(seed)
    one = Rotation.random(random_state=rng)
    axis = rng.normal(size=3)
    other = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * one
    expected = (other * one.inv()).magnitude()
    assert measures.rotation_errors(one.as_matrix(), other.as_matrix()) == pytest.approx(expected, abs=1e-7)


def test_add_and_add_s_by_brute_force():
    rng = np.random.default_rng(5)
    estimate = transforms(Rotation.random(6, random_state=rng), rng.normal(size=(6, 3)))
    truth = transforms(Rotation.random(6, random_state=rng), rng.normal(size=(6, 3)))
    points = rng.normal(size=(50, 3))
    for T, B, add, add_s in zip(
        estimate, truth, measures.add_errors(estimate, truth, points), measures.add_s_errors(estimate, truth, points), strict=True
    ):
        a = Rotation.from_matrix(T[:3, :3]).apply(points) + T[:3, 3]
        b = Rotation.from_matrix(B[:3, :3]).apply(points) + B[:3, 3]
        table = cdist(b, a)
        assert add == pytest.approx(np.diag(table).mean())
        assert add_s == pytest.approx(table.min(axis=1).mean())
        assert add_s <= add + 1e-12


def test_add_s_does_not_see_a_turn_onto_itself():
    cube = np.array(list(itertools.product((-0.1, 0.1), repeat=3)))
    quarter = transforms(Rotation.from_euler("z", [90.0], degrees=True), np.zeros((1, 3)))
    assert measures.add_s_errors(quarter, np.eye(4)[None], cube) == pytest.approx(0.0, abs=1e-12)
    assert measures.add_errors(quarter, np.eye(4)[None], cube) == pytest.approx(0.2)


def test_near_is_both_near():
    share = measures.fraction_near(np.array([0.04, 0.06, 0.04, 0.05]), np.deg2rad([4.0, 4.0, 6.0, 4.999]))
    assert share == 0.5
    assert np.isnan(measures.fraction_near(np.zeros(0), np.zeros(0)))


def test_the_mean_rotation_is_that_of_scipy():
    rng = np.random.default_rng(6)
    turned = Rotation.from_rotvec(rng.normal(scale=0.3, size=(40, 3))) * Rotation.random(random_state=rng)
    assert measures.mean_rotation(turned.as_matrix()) == pytest.approx(turned.mean().as_matrix(), abs=1e-9)


def test_a_spread_by_hand():
    spread = spread_of(np.array([3.0, -4.0, np.nan, 0.0, 100.0]), np.array([True, True, True, True, False]))
    assert spread.n == 3
    assert spread.row == pytest.approx((7 / 3, np.sqrt(25 / 3), 3.9, 4.0))
    assert np.isnan(spread_of(np.zeros(3), np.zeros(3, dtype=bool)).row).all()


def test_intervals_and_what_is_not_known():
    flags = np.array([1, 1, 0, 1, 0, 1, 1], dtype=bool)
    assert intervals(flags) == (Interval(0, 1, True), Interval(3, 3, True), Interval(5, 6, False))
    known = np.array([1, 1, 0, 1, 1, 1, 0], dtype=bool)
    assert intervals(flags, known) == (Interval(0, 3, True), Interval(5, 5, False))
    assert intervals(np.zeros(4, dtype=bool)) == () == intervals(flags, flags & False)


def test_reacquisition_is_counted_from_the_first_lost_set_to_the_first_sound_one():
    flags, times = np.array([0, 1, 1, 0, 0, 1, 0, 1], dtype=bool), 0.1 * np.arange(8)
    assert reacquisition_times(flags, times) == pytest.approx([0.2, 0.1])
    assert reacquisition_times(flags, times, np.array([1, 1, 1, 0, 1, 1, 1, 1], dtype=bool)) == pytest.approx([0.3, 0.1])


@settings(max_examples=60, deadline=None)
@given(flags=st.lists(st.booleans(), max_size=30))
def test_intervals_cover_what_is_set(flags):
    flags = np.array(flags, dtype=bool)
    covered = np.zeros(len(flags), dtype=bool)
    for interval in intervals(flags):
        covered[interval.first : interval.last + 1] = True
    assert (covered == flags).all()
