"""The solver on lines that lie exactly where a known body has them before known cameras."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.tracked_body.solver import (
    BodyMotion,
    Estimate,
    Problem,
    SharedPrior,
    clustered_covariance,
    moved_camera,
    shared_covariance,
    solve,
)
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.model.shape_parameters import ShapeSpace
from tracker_node.objective.constraints.prior import Prior
from tracker_node.objective.shape_jacobian import FOCAL, N_CAMERA, TIME, ContourLines, line_residuals

MODEL, RIG = crane(), circle_rig(3)
SPACE = ShapeSpace(MODEL)
N_SHAPE, N_CAMERAS, N_DOF = len(SPACE), len(RIG), MODEL.n_dof
HELD = SharedPrior(np.zeros(N_SHAPE), np.zeros((N_CAMERAS, N_CAMERA)))
ROBUST_PX = 1e4


def state(seed):
    some = random_state(MODEL, np.random.default_rng(seed), 0.4)
    joints = np.clip(some.joint_positions, 0.8 * MODEL.chain.lower, 0.8 * MODEL.chain.upper)
    return State(se3.exp(np.array([0.1, -0.2, 1.0, 0.2, 0.1, 0.5])), joints)


def lines_of(problem, truth, k, seed=7, noise_px=0.0):
    """Lines (some on every shape, of every camera) whose residuals at the truth are noise."""
    rng, n = np.random.default_rng([seed, k]), 40 * len(MODEL.shapes)
    normals = rng.normal(size=(n, 2))
    lines = ContourLines(
        rng.integers(0, N_CAMERAS, n), rng.integers(0, len(MODEL.shapes), n),
        np.column_stack([rng.uniform(-1.0, 1.0, (n, 2)), rng.uniform(0.0, 1.0, n)]), rng.uniform(100.0, 400.0, (n, 2)),
        normals / np.linalg.norm(normals, axis=1, keepdims=True), np.zeros(n), np.full(n, 0.25),
    ).sorted()  # fmt: skip
    means, valid = line_residuals(lines, problem.space.body(truth.s), problem.rig_of(truth), problem.states_of(truth, k))
    assert valid.all()
    return replace(lines, means=means + noise_px * rng.normal(size=n))


def problem_of(n_sets, shared=HELD, priors=None, velocity=None, **other):
    motion = BodyMotion(np.zeros(N_DOF) if velocity is None else velocity, np.zeros(N_CAMERAS))
    return Problem(SPACE, RIG, [motion] * n_sets, priors or [[]] * n_sets, shared, **other)


def estimate(*states, s=None, cameras=None):
    nothing = np.zeros((N_CAMERAS, N_CAMERA))
    return Estimate(states, np.zeros(N_SHAPE) if s is None else s, nothing if cameras is None else cameras)


def off(truth, size=0.01):
    rng = np.random.default_rng(3)
    return replace(truth, states=tuple(one.retract(size * rng.normal(size=N_DOF)) for one in truth.states))


def test_a_camera_is_moved_in_its_own_frame_and_zoomed():
    camera, departure = RIG.cameras[0], np.zeros(N_CAMERA)
    departure[:3] = [0.1, 0.0, 0.0]
    moved = moved_camera(camera, departure)  # points come to lie to its right: it has gone to the left
    assert np.allclose(moved.center, camera.center - 0.1 * camera.T_world_cam[:3, 0])
    assert moved.model is camera.model
    departure[FOCAL], departure[TIME] = 0.2, 9.0
    K, zoomed = camera.model.K, moved_camera(camera, departure).model
    assert np.allclose(zoomed.K, [[K[0, 0] * np.exp(0.2), 0, K[0, 2]], [0, K[1, 1] * np.exp(0.2), K[1, 2]], [0, 0, 1]])
    assert np.array_equal(zoomed.distortion, camera.model.distortion)


def test_each_camera_sees_the_body_when_it_exposes():
    velocity = np.linspace(0.1, 1.0, N_DOF)
    motion = BodyMotion(velocity, np.array([0.0, 0.02, 0.02]))
    cameras = np.zeros((N_CAMERAS, N_CAMERA))
    cameras[2, TIME] = 0.03
    here = state(1)
    seen = replace(problem_of(1), motions=[motion]).states_of(estimate(here, cameras=cameras), 0)
    for one, late_s in zip(seen, (0.0, 0.02, 0.05), strict=True):
        assert np.allclose(one.difference(here), late_s * velocity)


def test_weights_are_those_of_geman_and_mcclure():
    problem = problem_of(1, correlation=2.0)
    costs, weights = problem.weights(np.array([0.0, 3.0, -3.0, 1e6]), np.full(4, 0.5), 3.0)
    assert weights == pytest.approx([1.0, 0.25, 0.25, 0.0], abs=1e-6)  # 1 / (2 * 0.5) of information
    assert costs == pytest.approx([0.0, 4.5, 4.5, 9.0])
    _, weights = problem.weights(np.array([6.0]), np.array([9.0]), 3.0)  # knows little: 4 variances of room
    assert weights == pytest.approx([1.0 / 18.0 / 4.0])


def test_poses_are_found_while_all_else_is_held():
    truth, problem = estimate(state(1), state(2)), problem_of(2)
    lines = [lines_of(problem, truth, k) for k in range(2)]
    found = solve(problem, lines, off(truth), ROBUST_PX, 10)
    assert found.cost < 1e-6
    assert 1 <= found.iterations <= 10
    for one, true in zip(found.found.states, truth.states, strict=True):
        assert np.abs(one.difference(true)).max() < 1e-5
    assert not found.found.s.any()
    assert not found.found.cameras.any()


def test_shape_and_cameras_that_are_free_are_found():
    sigmas, cameras = np.zeros(N_SHAPE), np.zeros((N_CAMERAS, N_CAMERA))
    free = np.flatnonzero(SPACE.sigmas)[1:3]
    sigmas[free] = 10.0
    cameras[1:, : FOCAL + 1] = 10.0
    s, departures = np.zeros(N_SHAPE), np.zeros((N_CAMERAS, N_CAMERA))
    s[free] = [0.05, -0.04]
    departures[1] = [0.01, -0.02, 0.015, 0.01, 0.005, -0.008, 0.03, 0.0]
    truth, problem = estimate(state(1), state(2), s=s, cameras=departures), problem_of(2, SharedPrior(sigmas, cameras))
    lines = [lines_of(problem, truth, k) for k in range(2)]
    start = off(replace(truth, s=np.zeros(N_SHAPE), cameras=np.zeros((N_CAMERAS, N_CAMERA))), 0.002)
    found = solve(problem, lines, start, ROBUST_PX, 40).found
    assert np.abs(found.s - s).max() < 1e-3
    assert np.abs(found.cameras - departures).max() < 2e-3
    assert not found.cameras[0].any()


def test_the_time_of_a_camera_is_found():
    velocity = np.full(N_DOF, 0.4)
    cameras, departures = np.zeros((N_CAMERAS, N_CAMERA)), np.zeros((N_CAMERAS, N_CAMERA))
    cameras[2, TIME], departures[2, TIME] = 1.0, 0.03
    problem = problem_of(1, SharedPrior(np.zeros(N_SHAPE), cameras), velocity=velocity)
    truth = estimate(state(1), cameras=departures)
    found = solve(problem, [lines_of(problem, truth, 0)], estimate(state(1)), ROBUST_PX, 20).found
    assert found.cameras == pytest.approx(departures, abs=1e-4)


def test_a_joint_stops_at_its_limit():
    """Lines of a body that is turned beyond it: the joint goes as far as it may, the rest follows as well as it can."""
    axis, chain = 2, MODEL.chain
    beyond = state(1).joint_positions.copy()
    beyond[axis] = chain.upper[axis] + 0.05
    truth, problem = estimate(State(state(1).T_world_root, beyond)), problem_of(1)
    start = beyond.copy()
    start[axis] = chain.upper[axis] - 0.1
    lines = [lines_of(problem, truth, 0)]
    found = solve(problem, lines, estimate(State(state(1).T_world_root, start)), ROBUST_PX, 20)
    assert found.found.states[0].joint_positions[axis] == chain.upper[axis]
    again = solve(problem, lines, found.found, ROBUST_PX, 20)  # from the stop
    assert again.cost == pytest.approx(found.cost, rel=1e-3)
    inside = state(1).joint_positions.copy()
    inside[axis] = chain.upper[axis] - 0.1
    true = estimate(State(state(1).T_world_root, inside))
    back = solve(problem, [lines_of(problem, true, 0)], found.found, ROBUST_PX, 20)  # and off it again
    assert back.found.states[0].joint_positions[axis] == pytest.approx(inside[axis], abs=1e-4)


def test_priors_of_poses_pull():
    truth = estimate(state(1))
    tight = [[Prior(state(1).retract(np.full(N_DOF, 0.02)), np.full(N_DOF, 1e9))]]
    problem = problem_of(1, priors=tight)
    found = solve(problem, [lines_of(problem, truth, 0)], truth, ROBUST_PX, 10).found
    assert found.states[0].difference(truth.states[0]) == pytest.approx(np.full(N_DOF, 0.02), abs=1e-3)


def test_steps_end_where_nothing_can_be_gained():
    truth, problem = estimate(state(1)), problem_of(1)
    lines = [lines_of(problem, truth, 0, noise_px=0.5)]
    best = solve(problem, lines, truth, ROBUST_PX, 30)
    assert best.iterations < 30
    again = solve(problem, lines, best.found, ROBUST_PX, 30)
    assert again.iterations <= 2
    assert again.cost <= best.cost
    assert solve(problem, lines, off(truth), ROBUST_PX, 0).iterations == 0


def shared_prior():
    sigmas, cameras = np.zeros(N_SHAPE), np.zeros((N_CAMERAS, N_CAMERA))
    sigmas[np.flatnonzero(SPACE.sigmas)[0]] = 0.2
    cameras[1, :3], cameras[2, FOCAL] = 0.3, 0.1
    return SharedPrior(sigmas, cameras)


def test_covariances_are_of_what_is_free():
    prior = shared_prior()
    problem, truth = problem_of(1, prior), estimate(state(1))
    shape, cameras = shared_covariance(problem, [lines_of(problem, truth, 0)], truth, ROBUST_PX)
    for covariance, sigmas in ((shape, prior.shape), (cameras, prior.cameras.ravel())):
        assert np.array_equal(np.diag(covariance) > 0.0, sigmas > 0.0)
        assert np.all(np.diag(covariance) <= sigmas**2)
        assert np.array_equal(covariance != 0.0, np.outer(sigmas > 0.0, sigmas > 0.0))
    assert not any(c.any() for c in shared_covariance(problem_of(1), [lines_of(problem, truth, 0)], truth, ROBUST_PX))


def test_lines_without_a_say_leave_the_prior():
    prior, truth = shared_prior(), estimate(state(1))
    problem = problem_of(1, prior)
    vague = replace(lines_of(problem, truth, 0), variances=np.full(40 * len(MODEL.shapes), 1e12))
    shape, cameras = shared_covariance(problem, [vague], truth, ROBUST_PX)
    assert np.diag(shape) == pytest.approx(prior.shape**2, rel=1e-3)
    assert np.diag(cameras) == pytest.approx(prior.cameras.ravel() ** 2, rel=1e-3)
    clustered = clustered_covariance(problem, [vague], truth, ROBUST_PX)
    assert np.diag(clustered) == pytest.approx(prior.cameras.ravel() ** 2, rel=1e-3)


def test_sets_that_contradict_each_other_as_their_noise_says():
    """Clustered covariances of many sets with independent lines are about those of the lines; those of equal sets far less."""
    n, truth = 24, estimate(*[state(k) for k in range(24)])
    cameras = np.zeros((N_CAMERAS, N_CAMERA))
    cameras[1, :3] = 10.0
    problem = problem_of(n, SharedPrior(np.zeros(N_SHAPE), cameras))
    lines = [lines_of(problem, truth, k, noise_px=0.5) for k in range(n)]
    _, by_lines = shared_covariance(problem, lines, truth, ROBUST_PX)
    by_sets = clustered_covariance(problem, lines, truth, ROBUST_PX)
    assert by_sets.shape == by_lines.shape
    free = cameras.ravel() > 0.0
    ratio = np.sqrt(np.diag(by_sets)[free] / np.diag(by_lines)[free])
    assert np.all((ratio > 0.5) & (ratio < 2.0))
    assert not by_sets[~free].any()
    same = replace(truth, states=(truth.states[0],) * n)
    assert np.diag(clustered_covariance(problem, [lines[0]] * n, same, ROBUST_PX)).max() < 1e-3 * np.diag(by_sets).max()
    assert not clustered_covariance(problem_of(n), lines, truth, ROBUST_PX).any()
