"""Distances of round cones against brute force, derivatives against differences, and arms that do not go through the trunk."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.bodies.bodies import gantry, random_state
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, Neighbor, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone
from tracker_node.objective.constraints.collision import CollisionObjective, FloorObjective, round_cone_gap
from tracker_node.objective.constraints.prior import Prior, SumObjective
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize

HUMAN = human_model()


def brute_gap(one, other, n=201):
    s = np.linspace(0.0, 1.0, n)[:, None]
    p, q = one[:3] + s * (one[4:7] - one[:3]), other[:3] + s * (other[4:7] - other[:3])
    r, t = one[3] + s[:, 0] * (one[7] - one[3]), other[3] + s[:, 0] * (other[7] - other[3])
    return (np.linalg.norm(p[:, None] - q[None], axis=2) - r[:, None] - t[None]).min()


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(["any", "parallel", "balls", "swallowed"]))
def test_gap_of_two_round_cones(seed, kind):
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=8), rng.normal(size=8)
    one[[3, 7]], other[[3, 7]] = rng.uniform(0.05, 0.5, 2), rng.uniform(0.05, 0.5, 2)
    if kind == "parallel":
        other[4:7] = other[:3] + rng.normal() * (one[4:7] - one[:3])
    elif kind == "balls":
        one[4:7], other[4:7] = one[:3], other[:3]
        one[7], other[7] = one[3], other[3]
    elif kind == "swallowed":  # one end's sphere holds the other end
        one[4:7], one[7] = one[:3] + 0.2 * rng.normal(size=3), 1.5
    gap, s, t = round_cone_gap(one, other)
    expected = brute_gap(one, other)
    assert gap <= expected + 1e-12
    lengths = [np.linalg.norm(cone[4:7] - cone[:3]) + abs(cone[7] - cone[3]) for cone in (one, other)]
    assert gap > expected - 0.5 * sum(lengths) / 200 - 1e-12  # half a step of either grid
    assert 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0
    swapped = round_cone_gap(other, one)
    assert swapped[0] == pytest.approx(gap, abs=1e-9)


def colliding_state(objective, model, seed, share=0.9):
    """A random state in which parts overlap, not too deep for differences to be smooth."""
    rng = np.random.default_rng(seed)
    for _ in range(200):
        state = random_state(model, rng, share)
        gaps = objective.gaps(state)
        if (gaps < -1e-3).any() and np.abs(gaps).min() > 1e-4:
            return state
    raise AssertionError("no such state")


@pytest.mark.parametrize("seed", range(6))
def test_gradient_of_the_cost(seed):
    objective = CollisionObjective(HUMAN, 0.01)
    state = colliding_state(objective, HUMAN, seed)
    equations = objective.linearize(state)
    gaps = objective.gaps(state)
    assert equations.count == (gaps < 0.0).sum() > 0
    assert equations.cost == pytest.approx(((gaps[gaps < 0.0] / 0.01) ** 2).sum(), rel=1e-12)
    assert_jacobian(
        2.0 * equations.g[None] / equations.cost,
        lambda d: np.array([objective.linearize(state.retract(d)).cost]) / equations.cost, step=1e-6, tolerance=1e-5,
    )  # fmt: skip


def test_matrix_is_that_of_the_residuals():
    objective = CollisionObjective(HUMAN, 0.01)
    state = colliding_state(objective, HUMAN, 1)
    hit = objective.gaps(state) < 0.0
    J = np.stack([
        (objective.gaps(state.retract(1e-6 * d))[hit] - objective.gaps(state.retract(-1e-6 * d))[hit]) / 2e-6
        for d in np.eye(HUMAN.n_dof)
    ], axis=1) / 0.01  # fmt: skip
    H = objective.linearize(state).H
    np.testing.assert_allclose(H, J.T @ J, atol=1e-4 * np.abs(H).max())


def test_moving_as_a_whole_changes_nothing():
    objective = CollisionObjective(HUMAN, 0.01)
    state = colliding_state(objective, HUMAN, 2)
    equations = objective.linearize(state)
    assert equations.cost > 0.0
    np.testing.assert_array_equal(equations.g[:6], 0.0)
    moved = State(se3.exp(np.array([1.0, -2.0, 0.5, 0.7, -0.4, 2.0])) @ state.T_world_root, state.joint_positions)
    assert objective.linearize(moved).cost == pytest.approx(equations.cost, rel=1e-9)


def test_slides_are_pushed_too():
    """The hook of the crane is pulled up into its beam: the gradient along the slide is that of the cost."""
    model = gantry()
    objective = CollisionObjective(model, 0.01)
    assert objective.pair_names == ()  # two parts with only joints between them
    body = ArticulatedModel("gantry", model.chain, (*model.shapes, Shape("trolley", "trolley", Ellipsoid((0.02, 0.02, 0.02)))))
    objective = CollisionObjective(body, 0.01)
    assert objective.pair_names == (("cable", "beam"),)
    state = colliding_state(objective, body, 0)
    equations = objective.linearize(state)
    assert equations.g[body.chain.dof_names.index("slide")] != 0.0
    assert_jacobian(
        2.0 * equations.g[None] / equations.cost,
        lambda d: np.array([objective.linearize(state.retract(d)).cost]) / equations.cost, step=1e-6, tolerance=1e-5,
    )  # fmt: skip


def test_neighbours_and_what_overlaps_by_nature_are_left_out():
    names = {frozenset(pair) for pair in CollisionObjective(HUMAN).pair_names}
    for pair in (("left_upper_arm", "left_forearm"), ("left_upper_arm", "left_hand"), ("torso", "left_upper_arm")):
        assert frozenset(pair) not in names
    for pair in (
        ("left_forearm", "torso"),
        ("left_forearm", "right_forearm"),
        ("left_hand", "right_thigh"),
        ("head", "left_hand"),
    ):
        assert frozenset(pair) in names
    assert CollisionObjective(HUMAN).linearize(State.neutral(HUMAN)).cost == 0.0


def test_parts_on_an_empty_root_are_neighbours():
    links = ("empty", "one", "other")
    joints = tuple(Joint(name, "empty", name, np.eye(4), (Axis(name, (1.0, 0.0, 0.0)),)) for name in links[1:])
    shapes = tuple(Shape(name, name, TruncatedCone(0.1, 0.1, 0.0, 0.3, 1.0)) for name in links[1:])
    assert CollisionObjective(ArticulatedModel("v", KinematicChain(links, joints), shapes)).pair_names == ()


def test_an_arm_drawn_through_the_trunk_is_kept_out():
    """A pull that would put both forearms into the trunk; only with the collisions they stay outside.

    Both sides do the very same, so the axes of the hands meet, and no line between them says which way is out.
    """
    wanted = State.neutral(HUMAN)
    angles = wanted.joint_positions.copy()
    for side in ("left", "right"):
        for name, degrees in (("elbow_flexion", 90.0), ("shoulder_internal_rotation", 75.0)):
            angles[HUMAN.chain.axis_index(f"{side}_{name}")] = np.deg2rad(degrees)
    wanted = State(wanted.T_world_root, angles)
    collisions = CollisionObjective(HUMAN, 0.005)
    depth = -collisions.gaps(wanted).min()
    assert depth > 0.03
    pull = Prior(wanted, np.full(HUMAN.n_dof, 100.0))

    options = LevenbergMarquardtOptions(max_iterations=60, tolerance=0.0, step_tolerance=1e-7)
    free = minimize(SumObjective([CollisionObjective(HUMAN, 1e6)], priors=[pull]), State.neutral(HUMAN), HUMAN.chain, options)
    held = minimize(SumObjective([collisions], priors=[pull]), State.neutral(HUMAN), HUMAN.chain, options)
    assert -collisions.gaps(free.state).min() == pytest.approx(depth, abs=1e-3)
    assert -collisions.gaps(held.state).min() < 0.006


def beside(model, x):
    """The same body at rest, elsewhere."""
    root = np.eye(4)
    root[0, 3] = x
    return Neighbor(Configuration(model, State.neutral(model, root)), np.zeros(len(model.shapes), np.int32), [])


@pytest.mark.parametrize("seed", range(4))
def test_parts_do_not_go_into_other_bodies(seed):
    """Twice as deep, as the other is not exactly where it is expected; it does not move."""
    others = (beside(HUMAN, 0.2), beside(HUMAN, -5.0))
    alone, among = CollisionObjective(HUMAN), CollisionObjective(HUMAN, others=lambda: others)
    state = State.neutral(HUMAN).retract(np.random.default_rng(seed).normal(0.0, 0.1, HUMAN.n_dof))
    base, found = alone.linearize(state), among.linearize(state)
    assert found.count > base.count and found.cost > base.cost

    def cost(tangent):
        return np.array([among.linearize(state.retract(tangent)).cost - alone.linearize(state.retract(tangent)).cost])

    step, differences = 1e-6, np.zeros(HUMAN.n_dof)
    for k in range(HUMAN.n_dof):
        tangent = np.zeros(HUMAN.n_dof)
        tangent[k] = step
        differences[k] = (cost(tangent) - cost(-tangent))[0] / (2.0 * step)
    np.testing.assert_allclose(2.0 * (found.g - base.g), differences, atol=2e-3 * np.abs(differences).max())


def test_two_bodies_are_pushed_apart_to_where_they_touch():
    others = (beside(HUMAN, 0.15),)
    among = CollisionObjective(HUMAN, 0.005, lambda: others)
    start = State.neutral(HUMAN)
    weak = Prior(start, np.full(HUMAN.n_dof, 1.0))
    result = minimize(SumObjective([among], priors=[weak]), start, HUMAN.chain, LevenbergMarquardtOptions(60))
    assert among.linearize(result.state).cost < 0.02 * among.linearize(start).cost


def test_others_who_are_far_or_none_cost_nothing():
    state = State.neutral(HUMAN)
    base = CollisionObjective(HUMAN).linearize(state)
    for others in ((), (beside(HUMAN, 3.0),)):
        found = CollisionObjective(HUMAN, others=lambda others=others: others).linearize(state)
        np.testing.assert_array_equal(found.H, base.H)
        assert found.cost == base.cost


def floor_at(height_m: float) -> FloorObjective:
    return FloorObjective(HUMAN, height_m, 0.03)


@pytest.mark.parametrize("seed", range(6))
def test_the_gradient_of_the_floor_is_that_of_its_cost(seed):
    """Of bodies that are in it, and somewhat above it."""
    rng = np.random.default_rng(seed)
    state, floor = random_state(HUMAN, rng), floor_at(0.0)
    state.T_world_root[2, 3] = rng.uniform(0.2, 1.4)
    found = floor.linearize(state)
    assert_jacobian(
        2.0 * found.g[None] / found.cost,
        lambda d: np.array([floor.linearize(state.retract(d)).cost]) / found.cost, step=1e-6, tolerance=1e-5,
    )  # fmt: skip


def test_a_body_in_the_air_is_left_there_and_one_beside_the_floor_put_on_it():
    falling, floor, options = State.neutral(HUMAN), floor_at(0.0), LevenbergMarquardtOptions(50)
    falling.T_world_root[2, 3] = 0.0  # its legs are in the floor
    upright = Prior(falling, np.r_[np.full(3, 1e-3), np.full(HUMAN.n_dof - 3, 1e4)])
    found = minimize(SumObjective([floor], priors=[upright]), falling, HUMAN.chain, options)
    assert floor.linearize(found.state).cost < 0.05
    on_it = found.state.T_world_root[2, 3]
    assert 0.7 < on_it < 1.2
    for above, pulled in ((0.02, 1.0), (1.0, 0.0)):
        state = State(found.state.T_world_root.copy(), found.state.joint_positions)
        state.T_world_root[2, 3] += above
        held = Prior(state, np.full(HUMAN.n_dof, 50.0))  # to 14 cm
        result = minimize(SumObjective([floor], priors=[held]), state, HUMAN.chain, options)
        moved = state.T_world_root[2, 3] - result.state.T_world_root[2, 3]
        assert moved == pytest.approx(pulled * above, abs=0.01)
