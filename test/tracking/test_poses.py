"""The search for poses in rounds, on scores whose best pose is known."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.tracking.poses import Apart, Poses, PoseSearch, Round

MODEL = crane()
CHAIN = MODEL.chain
N, N_AXES = CHAIN.n_dof, CHAIN.n_axes
ALL, FIRST = np.ones(N, dtype=np.bool_), np.arange(N) == 6
MIDDLE = State(np.eye(4), 0.5 * (CHAIN.lower + CHAIN.upper))


class Near:
    """Nearness of the first axis to an angle; remembers what was asked."""

    def __init__(self, angle: float):
        self.angle, self.asked = angle, []

    def __call__(self, poses: Poses) -> np.ndarray:
        self.asked.append(poses)
        return -np.abs(poses.joints[:, 0] - self.angle)


def search(score, dofs=FIRST, seed=3, **more) -> PoseSearch:
    return PoseSearch(CHAIN, score, dofs, np.random.default_rng(seed), **more)


def at(*angles: float) -> Poses:
    """Poses in which the first axis has these angles."""
    joints = np.repeat(MIDDLE.joint_positions[None], len(angles), axis=0)
    joints[:, 0] = angles
    return Poses.with_joints(MIDDLE, joints)


def test_rounds_draw_about_the_best_and_the_best_of_all_comes_first():
    score = Near(MIDDLE.joint_positions[0] + 0.3)
    poses, scores = search(score).run(Poses.of([MIDDLE]), [Round(0.2, 20, 1), Round(0.05, 5, 3)], 4)
    assert [len(asked) for asked in score.asked] == [1, 20, 15]
    together = np.concatenate([asked.joints[:, 0] for asked in score.asked])
    np.testing.assert_array_equal(np.sort(-np.abs(together - score.angle))[::-1][:4], scores)
    np.testing.assert_array_equal(poses.joints[:, 0], score.angle + np.where(poses.joints[:, 0] > score.angle, -1, 1) * scores)
    best = np.sort(np.abs(together[:21] - score.angle))[:3]
    middles = score.asked[2].joints[:, 0].reshape(3, 5).mean(axis=1)
    np.testing.assert_allclose(np.sort(np.abs(middles - score.angle)), best, atol=0.08)


def test_a_start_that_nothing_beats_is_the_best():
    score = Near(MIDDLE.joint_positions[0])
    poses, scores = search(score).run(Poses.of([MIDDLE]), [Round(0.2, 10, 2)], 1)
    np.testing.assert_array_equal(poses.joints[0], MIDDLE.joint_positions)
    assert scores.tolist() == [0.0]


def test_without_rounds_the_first_are_ordered():
    score = Near(0.0)
    poses, scores = search(score).run(at(0.3, -0.1, 0.2), [], 2)
    assert poses.joints[:, 0].tolist() == [-0.1, 0.2] and scores == pytest.approx([-0.1, -0.2])


def test_what_is_drawn_scatters_by_the_spread_and_nothing_else_moves():
    score = Near(MIDDLE.joint_positions[0])
    search(score).run(Poses.of([MIDDLE]), [Round(0.05, 4000, 1)], 1)
    drawn = score.asked[1]
    assert drawn.joints[:, 0].std() == pytest.approx(0.05, rel=0.05)
    assert drawn.joints[:, 0].mean() == pytest.approx(MIDDLE.joint_positions[0], abs=0.005)
    np.testing.assert_array_equal(drawn.joints[:, 1:], np.tile(MIDDLE.joint_positions[1:], (4000, 1)))
    np.testing.assert_array_equal(drawn.roots, np.tile(np.eye(4), (4000, 1, 1)))


def test_each_degree_of_freedom_has_its_own_spread_and_a_round_its_own_mask():
    score, spread = Near(0.0), np.where(np.arange(N) < 3, 0.08, 0.02)
    search(score, ALL).run(Poses.of([MIDDLE]), [Round(spread, 3000, 1), Round(0.01, 50, 1, FIRST)], 1)
    moved = np.array([score.asked[1].state(i).difference(MIDDLE) for i in range(3000)])
    assert moved[:, :3].std(axis=0) == pytest.approx(0.08, rel=0.1)
    assert moved[:, 3:6].std(axis=0) == pytest.approx(0.02, rel=0.1)
    second = score.asked[2]
    assert np.ptp(second.roots, axis=0).max() == 0.0 and np.ptp(second.joints[:, 1:], axis=0).max() == 0.0
    assert np.ptp(second.joints[:, 0]) > 0.0


def test_joints_stay_within_their_limits_also_those_of_the_first():
    score = Near(10.0)
    search(score, ALL).run(Poses.of([State(np.eye(4), CHAIN.upper + 1.0)]), [Round(2.0, 200, 1)], 1)
    for asked in score.asked:
        assert (asked.joints >= CHAIN.lower).all() and (asked.joints <= CHAIN.upper).all()


def test_a_round_with_its_own_score_goes_on_from_the_best_so_far_alone():
    """What was best by the score before is scored anew; all else is out, however good by the new one."""
    before, after = Near(0.0), Near(0.4)
    poses, scores = search(before).run(at(0.4, 0.1, -0.05, 0.02), [Round(0.0, 0, 2, score=after), Round(0.0, 0, 1)], 9)
    assert [len(asked) for asked in before.asked] == [4]
    assert after.asked[0].joints[:, 0].tolist() == [0.02, -0.05]  # the best two by the first score
    assert poses.joints[:, 0].tolist() == [0.02, -0.05] and scores == pytest.approx([-0.38, -0.45])


def test_later_rounds_keep_the_score_of_a_round_before():
    before, after = Near(-0.4), Near(0.4)
    search(before).run(Poses.of([MIDDLE]), [Round(0.1, 6, 1, score=after), Round(0.1, 6, 2)], 1)
    assert [len(asked) for asked in before.asked] == [1]
    assert [len(asked) for asked in after.asked] == [1, 6, 12]


def test_poses_that_are_near_a_better_one_do_not_count():
    made = search(Near(0.0), apart=Apart(lambda poses: poses.joints[:, :1], 0.2))
    poses, scores = at(0.0, 0.15, 0.25, 0.5, 0.42, 0.6), np.array([5.0, 4.0, 3.0, 1.0, 2.0, 0.0])
    assert made.distinct(poses, scores, 9) == [0, 2, 3]  # 0.42 is near 0.25 and out, and so excludes nothing itself
    assert made.distinct(poses, scores, 1) == [0]
    assert search(Near(0.0)).distinct(poses, scores, 3) == [0, 1, 2]  # any two count


@pytest.mark.parametrize(
    ("order", "distance", "apart"), [(np.inf, 0.3, True), (np.inf, 0.31, False), (2, 0.49, True), (2, 0.51, False)]
)
def test_poses_are_apart_by_the_largest_difference_or_by_another_norm(order, distance, apart):
    """Here by 0.3 in each of two angles and 0.264 in a third: 0.5 in all."""
    poses = Poses.with_joints(MIDDLE, np.repeat(MIDDLE.joint_positions[None], 2, axis=0))
    poses.joints[1, :3] += 0.3000001, -0.3000001, 0.264575
    made = search(Near(0.0), apart=Apart(lambda poses: poses.joints[:, :3], distance, order))
    assert made.distinct(poses, np.array([1.0, 2.0]), 5) == ([1, 0] if apart else [1])


def test_equal_scores_keep_their_order_and_the_generator_decides_the_rest():
    assert search(Near(0.0)).distinct(at(0.1, -0.1, 0.1), np.zeros(3), 3) == [0, 1, 2]
    runs = [search(Near(0.3), seed=seed).run(Poses.of([MIDDLE]), [Round(0.2, 20, 2)], 3)[0].joints for seed in (3, 3, 4)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_poses_move_by_their_own_tangents():
    rng = np.random.default_rng(1)
    states = [MIDDLE.retract(rng.normal(0.0, 0.1, N)) for _ in range(3)]
    tangents = rng.normal(0.0, 0.1, (3, N))
    joints_only = np.where(np.arange(N) < 6, 0.0, tangents)
    for turns in (tangents, joints_only):
        moved = Poses.of(states).retracted(turns)
        for i, (state, turn) in enumerate(zip(states, turns, strict=True)):
            np.testing.assert_allclose(moved.state(i).T_world_root, state.retract(turn).T_world_root, atol=1e-12)
            np.testing.assert_allclose(moved.joints[i], state.retract(turn).joint_positions, atol=1e-12)


def test_a_state_of_poses_is_its_own():
    poses = Poses.of([MIDDLE, State.neutral(MODEL, se3.exp(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])))])
    state = poses.state(1)
    state.joint_positions[:] += 1.0
    state.T_world_root[0, 3] = 7.0
    assert poses.roots[1, 0, 3] == 1.0 and not np.array_equal(poses.joints[1], state.joint_positions)
    both = Poses.joined([poses, poses[[1]]])
    assert len(both) == 3 and both.roots[:, 0, 3].tolist() == [0.0, 1.0, 1.0]
