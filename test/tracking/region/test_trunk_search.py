"""A trunk that is looked for: the state of the largest gain, within the limits, with nothing but the trunk moved."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import N_ROOT_DOF, Axis, Joint, KinematicChain
from tracker_node.tracking.config import LimbSearchConfig, StatusConfig
from tracker_node.tracking.limbs.judge import LimbJudge
from tracker_node.tracking.limbs.tree import limbs_of
from tracker_node.tracking.region.limb_search import LimbSearch

MODEL = crane()
CHAIN = MODEL.chain
TRUNK = limbs_of(MODEL)[0]


class Gain:
    """Nearness of the root to a place; remembers what was asked: where the body is, the two starts, three rounds, the best."""

    def __init__(self, place, cells=0.0):
        self.place, self.cells, self.asked = np.asarray(place), cells, []

    def gains(self, poses, shapes):
        assert shapes.all()
        self.asked.append([poses.state(i) for i in range(len(poses))])
        near = -np.linalg.norm(poses.roots[:, :3, 3] - self.place, axis=1)
        return np.stack([near, np.full(len(poses), self.cells)], axis=1)

    @property
    def states(self):
        """All that were searched."""
        return [state for round_ in self.asked[1:-1] for state in round_]


def search(gain, tries=96, start=None, seed=3, model=MODEL, predicted=None):
    start = start or State.neutral(model)
    config = LimbSearchConfig(poses=3 * tries, seed=seed)  # a body costs as much as three limbs
    return LimbSearch(model, LimbJudge(model, StatusConfig()), config).find_trunk(start, predicted or start, gain)


def test_the_best_of_all_that_were_tried_is_taken():
    gain = Gain([0.1, -0.08, 0.05])
    best = search(gain)
    distances = [np.linalg.norm(state.T_world_root[:3, 3] - gain.place) for state in gain.states]
    assert np.linalg.norm(best.T_world_root[:3, 3] - gain.place) == min(distances)
    assert min(distances) < 0.4 * distances[0]  # much nearer than the start


def test_a_start_that_nothing_beats_stays():
    assert search(Gain([0.0, 0.0, 0.0])) is None


def test_colors_must_speak_clearly_for_another_place():
    """By a tenth for each cell in which the body shows: here 0.12 at most is gained."""
    assert search(Gain([0.1, 0.0, 0.06], cells=0.5)) is not None
    assert search(Gain([0.1, 0.0, 0.06], cells=1.2)) is None


def test_what_was_expected_is_a_start_too():
    there = State.neutral(MODEL, se3.exp(np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])))
    best = search(Gain([2.0, 0.0, 0.0]), predicted=there)
    assert np.array_equal(best.T_world_root, there.T_world_root)


@pytest.mark.parametrize(("tries", "rounds"), [(96, (2, 32, 32, 32)), (1, (2, 2, 4, 4))])
def test_about_so_many_are_tried(tries, rounds):
    """A third of them in each round, shared by the two starts and then by the best four; one each at least."""
    gain = Gain([1.0, 0.0, 0.0])
    search(gain, tries)
    assert tuple(len(states) for states in gain.asked) == (1, *rounds, 1)


def test_rounds_come_closer():
    """With a gain that always prefers the start, each round's scatter is about half of that before."""
    gain = Gain([0.0, 0.0, 0.0])
    search(gain, 1200)
    first = np.std([state.T_world_root[:3, 3] for state in gain.asked[2]], axis=0)
    assert np.all(abs(first - 0.08) < 0.02)
    last = np.std([state.T_world_root[:3, 3] for state in gain.asked[4]], axis=0)
    assert np.all(last < 0.5 * first)


def test_places_scatter_by_metres_and_turns_by_radians():
    gain = Gain([0.0, 0.0, 0.0])
    search(gain, 1200)
    start = State.neutral(MODEL)
    moved = np.array([state.difference(start) for state in gain.asked[2]])
    spread = moved.std(axis=0)
    assert spread[:3] == pytest.approx(0.08, rel=0.2)
    assert spread[3:6] == pytest.approx(0.2, rel=0.2)


def test_axes_of_the_trunk_scatter_no_farther_than_between_their_limits():
    """An axis with a hundredth of a radian between its limits, and one with two."""
    narrow = Axis("narrow", (0.0, 0.0, 1.0), 0.0, 0.01)
    wide = Axis("wide", (0.0, 1.0, 0.0), -1.0, 1.0)
    joint = Joint("waist", "base", "top", np.eye(4), (narrow, wide))
    model = ArticulatedModel("torso", KinematicChain(("base", "top"), (joint,)), MODEL.shapes[:1])
    assert limbs_of(model)[0].dofs.all()
    gain = Gain([0.0, 0.0, 0.0])
    search(gain, 1200, model=model)
    joints = np.array([state.joint_positions for state in gain.asked[2]])
    inside = joints[(joints[:, 0] > 0.0) & (joints[:, 0] < 0.01), 0]
    assert 0.3 < len(inside) / len(joints) < 0.4  # of a normal distribution from its one end, within its sigma
    assert joints[:, 1].std() == pytest.approx(0.2, rel=0.2)


def test_only_the_trunk_moves():
    gain = Gain([0.1, 0.0, 0.0])
    search(gain)
    others = ~TRUNK.dofs[N_ROOT_DOF:]
    assert others.any()
    rest = State.neutral(MODEL).joint_positions
    for state in gain.states:
        assert np.array_equal(state.joint_positions[others], rest[others])


def test_limits_hold():
    outside = State(np.eye(4), CHAIN.upper + 1.0)
    gain = Gain([0.1, 0.0, 0.0])
    search(gain, start=outside)
    for state in gain.states:
        assert np.all((CHAIN.lower <= state.joint_positions) & (state.joint_positions <= CHAIN.upper))
