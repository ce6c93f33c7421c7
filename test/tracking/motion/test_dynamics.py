"""The process, its discretization, and the correction, against finite steps, sampling and plain linear algebra."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from helpers.bodies.bodies import crane, random_state
from helpers.bodies.two_links import two_links
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.objective.constraints.prior import Prior
from tracker_node.tracking.config import MotionConfig
from tracker_node.tracking.motion.dynamics import Belief, Dynamics, correct, with_positions

N = 8


def dynamics(**changes) -> Dynamics:
    return Dynamics.of(MotionConfig(**changes), two_links().chain)


def spread(rng: np.random.Generator, n: int, scale: float = 1.0) -> np.ndarray:
    root = scale * rng.normal(size=(n, 2 * n))
    return root @ root.T / n


def belief(rng: np.random.Generator, fast: float = 1.0) -> Belief:
    state = random_state(two_links(), rng)
    return Belief(state, fast * rng.normal(size=N), spread(rng, 2 * N, 0.1))


def van_loan(noise: float, memory_s: float, elapsed_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition and noise of one degree of freedom by the exponential of a block matrix (Van Loan, 1978)."""
    F = np.array([[0.0, 1.0], [0.0, -1.0 / memory_s]])
    blocks = np.zeros((4, 4))
    blocks[:2, :2], blocks[1, 3], blocks[2:, 2:] = -F, noise**2, F.T
    found = expm(blocks * elapsed_s)
    transition = found[2:, 2:].T
    return transition, transition @ found[:2, 2:]


@pytest.mark.parametrize("memory_s", [0.05, 0.3, 40.0])
@pytest.mark.parametrize("elapsed_s", [1e-4, 1 / 30, 0.4])
def test_the_discretization_is_exact(memory_s, elapsed_s):
    model = dynamics(joint_noise=7.0, joint_time_constant_s=memory_s)
    rng = np.random.default_rng(0)
    before = belief(rng)
    after = model.propagate(before, elapsed_s)
    transition, noise = van_loan(7.0, memory_s, elapsed_s)
    index = np.ix_([6, N + 6], [6, N + 6])
    expected = transition @ before.covariance[index] @ transition.T + noise
    np.testing.assert_allclose(after.covariance[index], expected, rtol=1e-6)
    mean = transition @ [before.state.joint_positions[0], before.velocity[6]]
    np.testing.assert_allclose([after.state.joint_positions[0], after.velocity[6]], mean, rtol=1e-9)


def test_two_short_steps_are_a_long_one():
    """The rate at which images come makes no difference."""
    model, before = dynamics(), belief(np.random.default_rng(1))
    before.velocity[3:6] = [0.0, 0.0, 4.0]
    once, twice = model.propagate(before, 0.1), model.propagate(model.propagate(before, 0.04), 0.06)
    np.testing.assert_allclose(twice.state.difference(once.state), 0.0, atol=1e-12)
    np.testing.assert_allclose(twice.velocity, once.velocity, rtol=1e-12)
    others = [i for i in range(2 * N) if i % N not in (3, 4, 5)]  # turning noise is carried along in a first order of the turn
    np.testing.assert_allclose(twice.covariance[np.ix_(others, others)], once.covariance[np.ix_(others, others)], rtol=1e-9)
    np.testing.assert_allclose(twice.covariance, once.covariance, rtol=0.05, atol=0.02 * once.covariance.max())


@pytest.mark.parametrize("seed", range(3))
def test_the_transition_is_the_derivative_of_the_mean(seed):
    model, before = dynamics(), belief(np.random.default_rng(seed), fast=3.0)
    after = model.propagate(before, 0.2)

    def moved(x: np.ndarray) -> np.ndarray:
        other = model.propagate(Belief(before.state.retract(x[:N]), before.velocity + x[N:], before.covariance), 0.2)
        return np.concatenate([other.state.difference(after.state), other.velocity - after.velocity])

    assert_jacobian(model.transition(before, 0.2), moved)


def test_the_predicted_covariance_is_that_of_many_bodies():
    """Sampled states and velocities, moved one by one in short steps with noise of their own."""
    rng = np.random.default_rng(5)
    model = dynamics(root_position_noise=0.3, root_angle_noise=0.5, joint_noise=0.7)
    before = belief(rng)
    before.velocity[3:6] = [0.5, -1.0, 2.0]
    after = model.propagate(before, 0.3)
    root, steps, samples = np.linalg.cholesky(before.covariance), 12, 1500
    offsets = []
    for _ in range(samples):
        x = root @ rng.normal(size=2 * N)
        state, velocity = before.state.retract(x[:N]), before.velocity + x[N:]
        for _ in range(steps):
            dt = 0.3 / steps
            middle = velocity * (1.0 - 0.5 * dt / model.memory_s)
            state = state.retract(middle * dt)
            velocity = velocity * np.exp(-dt / model.memory_s) + model.noise * np.sqrt(dt) * rng.normal(size=N)
        offsets.append(np.concatenate([state.difference(after.state), velocity - after.velocity]))
    sampled = np.cov(np.array(offsets).T)
    scale = np.sqrt(np.outer(np.diag(after.covariance), np.diag(after.covariance)))
    assert np.abs((sampled - after.covariance) / scale).max() < 0.15


@pytest.mark.parametrize("rank", [0, 3, N])
def test_the_correction_is_kalmans(rank):
    """Without rotation all is linear: gain and covariance as in any textbook, for singular information, too."""
    rng = np.random.default_rng(rank)
    before = belief(rng)
    turning = [3, 4, 5, N + 3, N + 4, N + 5]
    P = before.covariance.copy()
    P[turning], P[:, turning] = 0.0, 0.0
    P[turning, turning] = 1.0
    rows = rng.normal(size=(rank, N)) * 20.0
    rows[:, 3:6] = 0.0
    C = np.hstack([rows, np.zeros((rank, N))])
    K = P @ C.T @ np.linalg.inv(C @ P @ C.T + np.eye(rank))
    mean = K @ (rng.normal(size=rank) * 0.05)
    after = correct(Belief(before.state, before.velocity, P), before.state.retract(mean[:N]), rows.T @ rows)
    np.testing.assert_allclose(after.velocity, before.velocity + mean[N:], atol=1e-9)
    np.testing.assert_allclose(after.covariance, P - K @ C @ P, atol=1e-9)


def test_the_correction_is_the_posterior_on_the_manifold():
    """A turn of half a radian between prediction and estimate: the covariance is the inverse of the posterior's Hessian there."""
    rng = np.random.default_rng(2)
    before = belief(rng)
    offset = np.concatenate([rng.normal(0, 0.1, 3), [0.3, -0.4, 0.2], rng.normal(0, 0.1, 2)])
    state, rows = before.state.retract(offset), 30.0 * rng.normal(size=(5, N))
    information = rows.T @ rows
    after = correct(before, state, information)
    H, g = information.copy(), np.zeros(N)
    Prior(before.state, np.linalg.inv(before.state_covariance)).add_to(H, g, state)
    np.testing.assert_allclose(after.state_covariance, np.linalg.inv(H), rtol=1e-6, atol=1e-12)


def test_two_exact_states_give_the_velocity():
    """With hardly any acceleration it is their difference."""
    model = dynamics(joint_noise=1e-3, joint_time_constant_s=1e3)
    start = random_state(two_links(), np.random.default_rng(0))
    tight = 1e12 * np.eye(N)
    first = model.start(start, tight)
    step = np.concatenate([np.zeros(6), [0.02, -0.03]])
    after = correct(model.propagate(first, 0.1), start.retract(step), tight)
    np.testing.assert_allclose(after.velocity[6:], step[6:] / 0.1, rtol=0.1)


def test_sliding_joints_have_the_noise_of_translations():
    chain = crane().chain
    joints = list(chain.joints)
    joints[1] = replace(joints[1], axes=tuple(replace(a, prismatic=True) for a in joints[1].axes))
    found = Dynamics.of(MotionConfig(root_position_noise=3.0, joint_noise=5.0), replace(chain, joints=tuple(joints)))
    assert sorted(set(found.noise[6:])) == [3.0, 5.0]


def test_no_time_is_no_change():
    chain = two_links().chain
    state = State(np.eye(4), np.zeros(chain.n_axes))
    after = Dynamics.of(MotionConfig(), chain).propagate(Belief(state, np.full(N, 0.1), np.eye(2 * N)), 0.0)
    np.testing.assert_array_equal(after.state.difference(state), np.zeros(N))
    np.testing.assert_allclose(after.covariance, np.eye(2 * N), atol=1e-15)


def test_a_fixed_base_stays_and_is_found_ever_better():
    """Measured 30 times a second for ten seconds, each time to 10 mm or mrad; joints move as ever."""
    free, fixed = dynamics(), dynamics(base="fixed")
    np.testing.assert_array_equal(free.noise[6:], fixed.noise[6:])
    state, measured = State.neutral(two_links()), np.eye(N) / 0.01**2
    believed = fixed.start(state, measured)
    for _ in range(300):
        ahead = fixed.propagate(believed, 1.0 / 30.0)
        believed = correct(ahead, state, measured)
    sigmas = np.sqrt(np.diag(believed.state_covariance))
    assert sigmas[:6].max() < 0.002 and sigmas[6:].min() > 0.005
    later = fixed.propagate(believed, 1.0)
    assert np.sqrt(np.diag(later.state_covariance))[:6].max() < 0.003


def test_joints_that_are_read_are_a_linear_measurement():
    model, rng = dynamics(), np.random.default_rng(4)
    before = belief(rng)
    read, sigmas = np.array([np.nan, before.state.joint_positions[1] + 0.2]), np.array([1.0, 0.05])
    after = with_positions(before, read, sigmas)
    H = np.zeros((1, 2 * N))
    H[0, 7] = 1.0
    information = np.linalg.inv(before.covariance) + H.T @ H / 0.05**2
    np.testing.assert_allclose(after.covariance, np.linalg.inv(information), rtol=1e-8, atol=1e-12)
    moved = np.concatenate([after.state.difference(before.state), after.velocity - before.velocity])
    np.testing.assert_allclose(moved, np.linalg.solve(information, H[0] * 0.2 / 0.05**2), rtol=1e-6, atol=1e-9)
    exact = with_positions(model.propagate(before, 0.1), read, np.full(2, 1e-9))
    assert np.linalg.eigvalsh(exact.covariance).min() > -1e-12 and exact.state.joint_positions[1] == pytest.approx(read[1])


def test_a_joint_moves_no_more_than_its_limit_allows():
    slow = replace(two_links().chain.axes[0], velocity_limit=1.0)
    (joint,) = two_links().chain.joints
    chain = KinematicChain(("upper", "lower"), (replace(joint, axes=(slow, joint.axes[1])),))
    found = Dynamics.of(MotionConfig(), chain)
    at_rest = found.start(State.neutral(two_links()), np.eye(N))
    assert np.sqrt(at_rest.velocity_covariance[6, 6]) == pytest.approx(0.5)  # half the limit
    assert found.noise[7] == MotionConfig().joint_noise
