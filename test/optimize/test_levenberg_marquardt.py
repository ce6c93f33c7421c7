"""Levenberg-Marquardt against a reference solver, and its promises about joint limits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from helpers.bodies.bodies import random_state
from tracker_node.geometry import so3
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, clip_to_limits, minimize, stepped

N_AXES = 5
EXACT = LevenbergMarquardtOptions(max_iterations=200, tolerance=0.0, step_tolerance=1e-10)


def chain_with_limits(limits) -> KinematicChain:
    links = tuple(f"link{i}" for i in range(len(limits) + 1))
    joints = tuple(
        Joint(f"joint{i}", links[i], links[i + 1], np.eye(4), (Axis(f"axis{i}", (1.0, 0.0, 0.0), low, high, low),))
        for i, (low, high) in enumerate(limits)
    )
    return KinematicChain(links, joints)


class Quadratic:
    """|A x - b|^2 with x = root translation and joint angles; the root's rotation is pulled to none."""

    def __init__(self, A: np.ndarray, b: np.ndarray):
        self.A, self.b, self.last = A, b, None

    def linearize(self, state: State) -> NormalEquations:
        self.last = state
        rotation = so3.log(state.T_world_root[:3, :3])
        x = np.concatenate([state.T_world_root[:3, 3], rotation, state.joint_positions])
        residual = self.A @ x - self.b
        J = self.A.copy()
        J[:, 3:6] = J[:, 3:6] @ so3.left_jacobian_inverse(rotation)
        return NormalEquations(J.T @ J, J.T @ residual, float(residual @ residual), len(residual))


def problem(seed: int):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(20, 6 + N_AXES)) + 2.0 * np.eye(20, 6 + N_AXES)
    A[:, 3:6] = 0.0
    A[3:6] = 0.0
    A[3:6, 3:6] = np.eye(3)
    b = 1.5 * rng.normal(size=20)
    b[3:6] = 0.0
    low = rng.uniform(-1.0, 0.2, N_AXES)
    return Quadratic(A, b), chain_with_limits([(a, a + w) for a, w in zip(low, rng.uniform(0.1, 1.5, N_AXES), strict=True)])


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_a_quadratic_in_a_box_is_solved_like_by_scipy(seed):
    objective, chain = problem(seed)
    start = State(np.eye(4), 0.5 * (chain.lower + chain.upper))
    result = minimize(objective, start, chain, EXACT)
    free = np.full(6, np.inf)
    reference = lsq_linear(
        objective.A, objective.b, (np.append(-free, chain.lower), np.append(free, chain.upper)), method="bvls", tol=1e-14
    )
    found = np.concatenate([result.state.T_world_root[:3, 3], np.zeros(3), result.state.joint_positions])
    assert result.equations.cost == pytest.approx(2.0 * reference.cost, rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(found, reference.x, atol=2e-4)


@pytest.mark.parametrize("seed", range(30))
def test_one_step_reaches_the_minimum_in_the_box(seed):
    """Of a quadratic whose variables are correlated, with several at their limits."""
    objective, chain = problem(seed)
    options = LevenbergMarquardtOptions(max_iterations=1, damping=0.0)
    result = minimize(objective, State(np.eye(4), np.random.default_rng(seed).uniform(chain.lower, chain.upper)), chain, options)
    free = np.full(6, np.inf)
    bounds = np.append(-free, chain.lower), np.append(free, chain.upper)
    reference = lsq_linear(objective.A, objective.b, bounds, method="bvls", tol=1e-14)
    found = np.concatenate([result.state.T_world_root[:3, 3], np.zeros(3), result.state.joint_positions])
    np.testing.assert_allclose(found, reference.x, atol=1e-6)


def test_nothing_moves_on_numbers_that_are_none():
    class Broken:
        def linearize(self, state: State) -> NormalEquations:
            return NormalEquations(np.full((7, 7), np.nan), np.zeros(7), np.nan, 0)

    start = State(np.eye(4), np.array([0.5]))
    result = minimize(Broken(), start, chain_with_limits([(0.0, 1.0)]), LevenbergMarquardtOptions())
    np.testing.assert_array_equal(result.state.joint_positions, start.joint_positions)
    assert not result.converged


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_limits_are_never_left(seed):
    """Not at any point at which the objective is asked, wherever the start is."""
    objective, chain = problem(seed)
    asked = []
    linearize = objective.linearize
    objective.linearize = lambda state: (asked.append(state.joint_positions), linearize(state))[1]
    start = State(np.eye(4), np.random.default_rng(seed).normal(0.0, 4.0, N_AXES))
    minimize(objective, start, chain, LevenbergMarquardtOptions(max_iterations=8))
    angles = np.array(asked)
    assert (angles >= chain.lower).all() and (angles <= chain.upper).all()


def test_the_cost_never_rises_and_is_that_of_the_returned_state():
    for seed in range(20):
        objective, chain = problem(seed)
        start = clip_to_limits(State(np.eye(4), np.zeros(N_AXES)), chain)
        before = objective.linearize(start).cost
        result = minimize(objective, start, chain, LevenbergMarquardtOptions(max_iterations=1 + seed % 4))
        assert result.equations.cost <= before
        assert result.equations.cost == objective.linearize(result.state).cost
        assert result.iterations <= 1 + seed % 4
        assert result.evaluations > result.iterations


class Deceptive:
    """A gradient that promises what the cost does not keep: every step is refused."""

    def __init__(self):
        self.asked = []

    def linearize(self, state: State) -> NormalEquations:
        self.asked.append(state)
        return NormalEquations(np.eye(6), np.ones(6), float(np.abs(state.T_world_root[:3, 3]).sum()), 6)


def test_after_refused_steps_the_objective_is_left_at_the_result():
    objective = Deceptive()
    chain = KinematicChain(("base",), ())
    start = State(np.eye(4), np.zeros(0))
    result = minimize(objective, start, chain, LevenbergMarquardtOptions(max_iterations=4))
    assert result.state is objective.asked[-1]
    np.testing.assert_array_equal(result.state.T_world_root, np.eye(4))
    assert (result.iterations, result.evaluations, result.converged) == (4, 6, False)
    assert len(objective.asked) == result.evaluations


def test_nothing_to_go_by_leaves_the_state_where_it_is():
    """No evidence at all: zero matrices must not break the solver."""

    model = human_model()
    n = model.n_dof

    class Empty:
        def linearize(self, state: State) -> NormalEquations:
            return NormalEquations(np.zeros((n, n)), np.zeros(n), 0.0, 0)

    start = random_state(model, np.random.default_rng(0))
    result = minimize(Empty(), start, model.chain, LevenbergMarquardtOptions())
    np.testing.assert_array_equal(result.state.joint_positions, start.joint_positions)
    assert result.converged


def test_clipping_keeps_the_root():
    model = human_model()
    T = np.eye(4)
    T[:3, 3] = 1.0, 2.0, 3.0
    clipped = clip_to_limits(State(T, np.full(model.chain.n_axes, 99.0)), model.chain)
    np.testing.assert_array_equal(clipped.T_world_root, T)
    np.testing.assert_array_equal(clipped.joint_positions, model.chain.upper)


class Scripted:
    """Costs as listed, one an evaluation, the last for all that follow; H and g stay as given."""

    def __init__(self, costs, H=None, g=None):
        self.costs, self.asked = list(costs), []
        self.H, self.g = np.eye(6) if H is None else H, np.ones(6) if g is None else g

    def linearize(self, state: State) -> NormalEquations:
        self.asked.append(state.T_world_root[0, 3])
        return NormalEquations(self.H, self.g, self.costs[min(len(self.asked), len(self.costs)) - 1], 6)


FIXED = KinematicChain(("base",), ())
AT_REST = State(np.eye(4), np.zeros(0))
ENDLESS = LevenbergMarquardtOptions(max_iterations=4, damping=1.0, tolerance=0.0, step_tolerance=0.0)


def test_refused_steps_become_shorter_as_the_damping_rises():
    """With the unit matrix and a gradient of ones, a step is -1 / (1 + damping) along every axis."""
    objective = Scripted([1.0, 2.0])
    result = minimize(objective, AT_REST, FIXED, ENDLESS)
    np.testing.assert_allclose(objective.asked[1:5], [-1.0 / (1.0 + 8.0**k) for k in range(4)], rtol=1e-6)
    assert (result.iterations, result.evaluations, result.converged) == (4, 6, False)
    assert result.equations.cost == 2.0  # that of the last evaluation, which is of the result


def test_steps_that_help_become_longer_as_the_damping_falls():
    only_x = np.eye(6)[0]
    objective = Scripted([5.0, 4.0, 3.0, 2.0, 1.0], g=only_x)
    result = minimize(objective, AT_REST, FIXED, ENDLESS)
    np.testing.assert_allclose(np.diff(objective.asked), [-1.0 / (1.0 + 0.2**k) for k in range(4)], rtol=1e-6)
    assert (result.iterations, result.evaluations, result.equations.cost) == (4, 5, 1.0)
    assert result.state.T_world_root[0, 3] == objective.asked[-1]


def test_a_cost_that_stays_the_same_is_no_step_forward():
    objective = Scripted([1.0, 1.0])
    assert minimize(objective, AT_REST, FIXED, ENDLESS).state.T_world_root[0, 3] == 0.0


def test_a_matrix_that_has_no_minimum_is_damped_until_it_has():
    H = np.eye(6)
    H[0, 1] = H[1, 0] = 2.0  # positive definite from a damping of 1 on
    objective = Scripted([2.0, 1.0], H=H, g=np.eye(6)[0])
    result = minimize(objective, AT_REST, FIXED, LevenbergMarquardtOptions(2, 0.3, 0.0, 0.0))
    expected = np.linalg.solve(H + 2.4 * np.eye(6), -np.eye(6)[0])
    assert objective.asked[1] == pytest.approx(expected[0], rel=1e-6)
    assert (result.iterations, result.evaluations) == (2, 2)
    state = stepped(NormalEquations(H, np.ones(6), 1.0, 6), AT_REST, FIXED, 0.3)
    assert state is AT_REST
    assert minimize(Scripted([2.0], H=H), AT_REST, FIXED, replace(ENDLESS, max_iterations=1, damping=0.3)).evaluations == 2


def test_it_ends_by_gain_by_step_or_by_damping():
    def ends(costs, **changes):
        result = minimize(Scripted(costs), AT_REST, FIXED, replace(ENDLESS, max_iterations=50, **changes))
        return result.iterations, result.converged

    assert ends([100.0, 90.0, 80.9, 80.0, 70.0], tolerance=0.05) == (3, True)  # 10 %, 10.1 %, 1.1 %
    assert ends([9.0, 8.0, 7.0, 6.0], step_tolerance=0.8) == (1, True)  # a step of 1/2
    assert ends([9.0, 8.0, 7.0, 6.0, 6.0], step_tolerance=0.4)[0] > 3
    assert ends([1.0, 2.0], step_tolerance=0.12) == (2, True)  # refused: 1/2, then 1/9
    assert ends([1.0, 2.0], damping=1e5) == (3, True)  # 1e5, 8e5, 6.4e6


def test_one_step_by_damping_of_each_degree_of_freedom():
    damping = np.arange(6.0)
    state = stepped(NormalEquations(2.0 * np.eye(6), np.array([3.0, 3, 3, 0, 0, 0]), 1.0, 6), AT_REST, FIXED, damping)
    np.testing.assert_allclose(state.T_world_root[:3, 3], -3.0 / (2.0 * (1.0 + damping[:3])), rtol=1e-6)


def test_a_cost_that_is_no_number_has_not_converged_though_the_rule_is_met():
    result = minimize(Scripted([np.inf]), AT_REST, FIXED, replace(ENDLESS, step_tolerance=10.0))
    assert (result.iterations, result.evaluations, result.converged) == (1, 3, False)
    assert minimize(Scripted([1.0]), AT_REST, FIXED, replace(ENDLESS, step_tolerance=10.0)).converged
