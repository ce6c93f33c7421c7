"""A trunk that is looked for: the state of the largest gain, within the limits, with nothing but the trunk moved."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import N_ROOT_DOF, Axis, Joint, KinematicChain
from tracker_node.tracking.limbs import limbs_of
from tracker_node.tracking.region.trunk_search import best_trunk

MODEL = crane()
CHAIN = MODEL.chain
TRUNK = limbs_of(MODEL)[0]


class Gain:
    """Nearness of the root to a place; remembers what was asked."""

    def __init__(self, place):
        self.place, self.asked = np.asarray(place), []

    def __call__(self, states):
        self.asked.append(list(states))
        return np.array([-np.linalg.norm(state.T_world_root[:3, 3] - self.place) for state in states])

    @property
    def states(self):
        return [state for round_ in self.asked for state in round_]


def search(gain, tries=96, starts=None, seed=3, trunk=TRUNK):
    starts = starts or [State.neutral(MODEL)]
    return best_trunk(trunk, starts, CHAIN, gain, tries, np.random.default_rng(seed))


def test_the_best_of_all_that_were_tried_is_taken():
    gain = Gain([0.1, -0.08, 0.05])
    best = search(gain)
    distances = [np.linalg.norm(state.T_world_root[:3, 3] - gain.place) for state in gain.states]
    assert np.linalg.norm(best.T_world_root[:3, 3] - gain.place) == min(distances)
    assert min(distances) < 0.4 * distances[0]  # much nearer than the start


def test_a_start_that_nothing_beats_stays():
    start = State.neutral(MODEL)
    assert np.array_equal(search(Gain([0.0, 0.0, 0.0])).T_world_root, start.T_world_root)


@pytest.mark.parametrize(
    ("n_starts", "tries", "rounds"), [(1, 96, (1, 32, 32, 32)), (6, 96, (6, 32, 32, 32)), (1, 1, (1, 1, 2, 4))]
)
def test_about_so_many_are_tried(n_starts, tries, rounds):
    """A third of them in each round, shared by the best four; one each at least."""
    gain = Gain([1.0, 0.0, 0.0])
    search(gain, tries, [State.neutral(MODEL)] * n_starts)
    assert tuple(len(states) for states in gain.asked) == rounds


def test_rounds_come_closer():
    """With a gain that always prefers the start, each round's scatter is about half of that before."""
    gain = Gain([0.0, 0.0, 0.0])
    search(gain, 1200)
    first = np.std([state.T_world_root[:3, 3] for state in gain.asked[1]], axis=0)
    assert np.all(abs(first - 0.08) < 0.02)
    last = np.std([state.T_world_root[:3, 3] for state in gain.asked[3]], axis=0)
    assert np.all(last < 0.5 * first)


def test_places_scatter_by_metres_and_turns_by_radians():
    gain = Gain([0.0, 0.0, 0.0])
    search(gain, 1200)
    start = State.neutral(MODEL)
    moved = np.array([state.difference(start) for state in gain.asked[1]])
    spread = moved.std(axis=0)
    assert spread[:3] == pytest.approx(0.08, rel=0.2)
    assert spread[3:6] == pytest.approx(0.2, rel=0.2)


def test_axes_of_the_trunk_scatter_no_farther_than_between_their_limits():
    """An axis with a hundredth of a radian between its limits, and one with two."""
    narrow = Axis("narrow", (0.0, 0.0, 1.0), 0.0, 0.01)
    wide = Axis("wide", (0.0, 1.0, 0.0), -1.0, 1.0)
    joint = Joint("waist", "base", "top", np.eye(4), (narrow, wide))
    model = ArticulatedModel("torso", KinematicChain(("base", "top"), (joint,)), MODEL.shapes[:1])
    trunk = replace(TRUNK, dofs=np.ones(model.n_dof, dtype=bool))
    gain, start = Gain([0.0, 0.0, 0.0]), State.neutral(model)
    best_trunk(trunk, [start], model.chain, gain, 1200, np.random.default_rng(3))
    joints = np.array([state.joint_positions for state in gain.asked[1]])
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
    search(gain, starts=[outside])
    for state in gain.states:
        assert np.all((CHAIN.lower <= state.joint_positions) & (state.joint_positions <= CHAIN.upper))
