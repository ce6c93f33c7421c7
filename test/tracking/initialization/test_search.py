"""The search for a posture, with scores that are known: nearness to a pose."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.geometry import so3
from tracker_node.model.humans.human import human_model
from tracker_node.tracking.initialization.search import HypothesisSearch
from tracker_node.tracking.poses import Poses


class Near:
    """Scores poses by how near their joints and places are to a goal."""

    def __init__(self, model, joints, place=(0.0, 0.0, 0.0)):
        self.model, self.joints, self.place = model, np.asarray(joints), np.asarray(place)

    def scores(self, roots, joints):
        return -np.sum((joints - self.joints) ** 2, axis=1) - np.sum((roots[:, :3, 3] - self.place) ** 2, axis=1)


MODEL = crane()
AXES = MODEL.chain.axes
NEUTRAL = np.array([axis.neutral for axis in AXES])
GOAL = NEUTRAL + np.array([0.5, -0.4, 0.6, 0.8])


def search(prior=0.0, place=(0.0, 0.0, 0.0), goal=GOAL):
    return HypothesisSearch(Near(MODEL, goal, place), prior, 2.0)


def poses(n, joints=NEUTRAL, turns=None, places=None):
    roots = np.repeat(np.eye(4)[None], n, axis=0)
    for i in range(n):
        roots[i, :3, :3] = np.eye(3) if turns is None else so3.exp([0.0, 0.0, turns[i]])
        roots[i, :3, 3] = 0.0 if places is None else places[i]
    return Poses(roots, np.repeat(np.asarray(joints)[None], n, axis=0))


def test_the_prior_costs_squares_of_angles_from_neutral():
    """One axis is stiff: its angles cost more."""
    stiff = np.array([axis.stiffness > 1.0 for axis in AXES])
    assert stiff.any()
    assert not stiff.all()
    for i, is_stiff in enumerate(stiff):
        joints = NEUTRAL.copy()
        joints[i] += 0.7
        cost = search(0.0).scores(poses(1, joints)) - search(3.0).scores(poses(1, joints))
        assert cost[0] == pytest.approx(3.0 * (0.7 / (0.35 if is_stiff else 1.0)) ** 2)
    assert search(3.0).scores(poses(1)) == pytest.approx(search(0.0).scores(poses(1)))


def test_the_best_that_differ():
    """Near in place and in heading is the same; far in either is another."""
    places = [(0, 0, 0), (0.1, 0, 0), (0, 0, 0), (1, 0, 0), (0, 0.1, 0)]
    turns = [0.0, 0.1, 2.0, 0.1, 1.95]
    some, scores = poses(5, turns=turns, places=places), np.array([5.0, 4.0, 3.0, 2.0, 6.0])
    assert search().best(some, scores, 5, 0.3, 0.5).tolist() == [4, 0, 3]
    assert search().best(some, scores, 2, 0.3, 0.5).tolist() == [4, 0]
    assert search().best(some, scores, 5, 0.05, 0.5).tolist() == [4, 0, 1, 2, 3]
    assert search().best(some, scores, 5, 0.3, 0.04).tolist() == [4, 0, 1, 2, 3]
    assert search().best(some, scores, 5, 0.3, 0.2).tolist() == [4, 0, 3]


def test_equally_good_ones_are_taken_in_order():
    assert search().best(poses(3, places=np.eye(3)), np.ones(3), 2, 0.1, 0.1).tolist() == [0, 1]


def test_variants_move_one_limb_each_and_the_last_turns_around():
    finder, n = search(), 2
    some = poses(n, turns=[0.0, 0.4], places=[(0, 0, 0), (1, 2, 3)])
    variants = finder.varied(some, 200, np.random.default_rng(1))
    each = len(variants) // n
    for k in range(n):
        own = variants[k * each : (k + 1) * each]
        moved = own.joints[:-1] != NEUTRAL
        assert np.all(moved.sum(axis=0) == 1)  # each angle in the variant of its limb
        assert np.all(moved.any(axis=1))
        for i in range(each - 1):  # nearer than before, as close as so many samples come
            assert np.linalg.norm((own.joints[i] - GOAL)[moved[i]]) < 0.35
        assert np.array_equal(own.roots[:-1], np.repeat(some.roots[k][None], each - 1, axis=0))
        assert np.allclose(own.roots[-1, :3, 3], some.roots[k, :3, 3])
        assert np.allclose(own.roots[-1, :3, :3], so3.exp([0.0, 0.0, np.pi]) @ some.roots[k, :3, :3])
        assert np.array_equal(own.joints[-1], NEUTRAL)


def test_variants_stay_within_reach():
    chain = MODEL.chain
    joints = search(goal=NEUTRAL + 10.0).varied(poses(3), 50, np.random.default_rng(1)).joints
    assert np.all((chain.lower <= joints) & (joints <= chain.upper))


def test_who_faces_the_other_way_has_left_and_right_exchanged():
    model = human_model()
    names = [axis.name for axis in model.chain.axes]
    joints = np.linspace(-0.1, 0.1, len(names))
    finder = HypothesisSearch(Near(model, joints), 0.0, 1.8)
    variants = finder.varied(poses(1, joints), 2, np.random.default_rng(1))
    turned = dict(zip(names, variants.joints[-1], strict=True))
    before = dict(zip(names, joints, strict=True))
    assert turned["left_knee_flexion"] == before["right_knee_flexion"]
    assert turned["right_elbow_flexion"] == before["left_elbow_flexion"]


def test_the_best_variant_takes_its_hypothesis_place_if_it_is_better():
    finder = search()
    some = poses(2, GOAL - 0.2)
    offsets = np.array([0.5, 0.1, 0.3, 0.9, 0.8, 0.7])  # of the first's three variants, then of the second's
    variants = poses(6)
    variants.joints[:] = GOAL + offsets[:, None]
    found, scores = finder.best_of(some, finder.scores(some), variants)
    assert np.allclose(found.joints[0], GOAL + 0.1)
    assert np.allclose(found.joints[1], GOAL - 0.2)
    assert scores == pytest.approx(finder.scores(found))


def test_promising_variants_are_the_best_of_each_hypothesis():
    places = [[3.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 0.0, 0.0], [8.0, 0.0, 0.0]]
    kept = search().promising(poses(6, places=np.array(places)), 2, 2)
    assert kept.roots[:, 0, 3].tolist() == [1.0, 2.0, 8.0, 9.0]


def test_only_what_is_better_replaces():
    finder, some, others = search(), poses(3, GOAL + 0.2), poses(3, GOAL + 0.1, places=[(0, 0, 0), (9, 0, 0), (0, 0, 0)])
    found, scores = finder.better(some, finder.scores(some), others)
    assert np.allclose(found.joints[:, 0] - GOAL[0], [0.1, 0.2, 0.1])
    assert not found.roots[1, :3, 3].any()
    assert scores == pytest.approx(finder.scores(found))


def test_shaking_comes_nearer_and_never_goes_back():
    finder = search(place=(0.1, -0.1, 0.05))
    some = poses(2, turns=[0.0, 1.0])
    scores, rng = finder.scores(some), np.random.default_rng(2)
    for _ in range(6):
        some, now = finder.shaken(some, scores, 60, rng)
        assert np.all(now >= scores)
        scores = now
    assert scores == pytest.approx(finder.scores(some))
    assert np.all(scores > -0.02)
    assert np.allclose(some.roots[:, :3, :3] @ np.swapaxes(some.roots[:, :3, :3], 1, 2), np.eye(3))


def test_shaking_stays_within_limits():
    finder = search(goal=NEUTRAL + 10.0)
    some, rng = poses(2), np.random.default_rng(2)
    for _ in range(4):
        some, _ = finder.shaken(some, finder.scores(some), 60, rng)
    assert np.all((MODEL.chain.lower <= some.joints) & (some.joints <= MODEL.chain.upper))


def test_poses_are_states_and_back():
    some = poses(3, turns=[0.0, 1.0, 2.0])
    states = [some.state(i) for i in range(len(some))]
    again = Poses.joined([Poses.of(states[:1]), Poses.of(states[1:])])
    assert np.array_equal(again.roots, some.roots)
    assert np.array_equal(again.joints, some.joints)
    states[0].T_world_root[0, 3] = 7.0
    assert some.roots[0, 0, 3] == 0.0
