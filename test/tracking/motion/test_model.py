"""Prediction: constant velocity is found and continued; what is not measured dies away."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import random_state
from helpers.bodies.two_links import two_links
from tracker_node.geometry import so3
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import ENDLESS_RAD, KinematicChain
from tracker_node.tracking.config import MotionConfig
from tracker_node.tracking.motion.model import ExposureDelays, MotionModel

N = 8
VELOCITY = np.array([0.4, -1.1, 0.2, 0.3, 0.5, -0.8, 1.2, -0.7])


def moving(t_s: float) -> State:
    """Constant velocity: the rotation turns about an axis that stays where it is."""
    T = np.eye(4)
    T[:3, :3] = so3.exp(VELOCITY[3:6] * t_s)
    T[:3, 3] = VELOCITY[:3] * t_s
    return State(T, VELOCITY[6:] * t_s)


def fed(times_s, config: MotionConfig) -> MotionModel:
    model = MotionModel(two_links().chain, config)
    for t in times_s:
        model.update(round(t * 1e9), moving(t))
    return model


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_constant_velocity_is_recovered_also_from_irregular_stamps(seed):
    steps = np.full(25, 1 / 30) if seed is None else np.random.default_rng(seed).uniform(0.005, 0.2, 25)
    times = np.cumsum(steps)
    model = fed(times, MotionConfig(velocity_gain=0.6, velocity_decay=1.0))
    np.testing.assert_allclose(model.velocity, VELOCITY, atol=1e-5)
    for ahead in (0.01, 0.033, 0.3):
        predicted = model.predict(round((times[-1] + ahead) * 1e9))
        np.testing.assert_allclose(predicted.state.difference(moving(times[-1] + ahead)), 0.0, atol=1e-5)


def test_a_new_velocity_is_approached_by_the_gain():
    model = fed([0.0, 0.1], MotionConfig(velocity_gain=0.75))
    np.testing.assert_allclose(model.velocity, 0.75 * VELOCITY, atol=1e-6)
    model.update(200_000_000, moving(0.2))
    np.testing.assert_allclose(model.velocity, (1 - 0.25**2) * VELOCITY, atol=1e-6)


def test_joint_velocities_decay_in_the_prediction_and_the_root_goes_on():
    model = fed(np.arange(30) * 0.02, MotionConfig(velocity_gain=1.0, velocity_decay=0.5))
    step = model.predict(680_000_000).state.difference(moving(0.58))
    np.testing.assert_allclose(step[:6], 0.1 * VELOCITY[:6], atol=1e-6)
    np.testing.assert_allclose(step[6:], 0.05 * VELOCITY[6:], atol=1e-6)


def test_nothing_is_predicted_before_the_first_update():
    model = MotionModel(two_links().chain, MotionConfig())
    assert model.predict(0) is None
    model.update(5, moving(0.0))
    np.testing.assert_array_equal(model.predict(10**9).state.difference(moving(0.0)), np.zeros(N))


def test_the_same_instant_twice_is_no_velocity():
    model = fed([0.0, 0.1], MotionConfig())
    before = model.velocity.copy()
    model.update(100_000_000, moving(0.5))
    model.update(50_000_000, moving(0.7))
    np.testing.assert_array_equal(model.velocity, before)
    assert np.isfinite(model.predict(200_000_000).state.to_values()).all()


def test_a_lost_body_coasts_to_a_stop():
    model = fed(np.arange(10) * 0.1, MotionConfig(velocity_decay=0.8))
    t_ns, path = 900_000_000, 0.0
    for _ in range(60):
        t_ns += 100_000_000
        state = model.predict(t_ns).state
        model.coast(t_ns, state)
    path = np.linalg.norm(state.T_world_root[:3, 3] - VELOCITY[:3] * 0.9)
    assert np.linalg.norm(model.velocity) < 1e-4
    assert path < 0.1 * np.linalg.norm(VELOCITY[:3]) / (1 - 0.8) + 1e-6


def test_restart_forgets_the_velocity():
    model = fed([0.0, 0.1, 0.2], MotionConfig())
    elsewhere = random_state(two_links(), np.random.default_rng(0))
    model.restart(10**9, elsewhere)
    np.testing.assert_array_equal(model.predict(2 * 10**9).state.difference(elsewhere), np.zeros(N))


def test_the_human_fits():
    human = human_model()
    model, state = MotionModel(human.chain, MotionConfig()), random_state(human, np.random.default_rng(1))
    model.update(0, state)
    np.testing.assert_array_equal(model.predict(7).state.joint_positions, state.joint_positions)


SURE = 1e6 * np.eye(N)  # a millimeter, a milliradian


def informed(times_s, information=SURE, config: MotionConfig | None = None) -> MotionModel:
    model = MotionModel(two_links().chain, config or MotionConfig())
    for t in times_s:
        model.update(round(t * 1e9), moving(t), information)
    return model


@pytest.mark.parametrize("step_s", [1 / 30, 1 / 15, 1 / 7.5])
def test_with_information_the_velocity_is_found_at_any_rate(step_s):
    lasting = MotionConfig(root_position_time_constant_s=50, root_angle_time_constant_s=50, joint_time_constant_s=50)
    model = informed(np.arange(40) * step_s, config=lasting)
    sigma = np.sqrt(np.diag(model.velocity_covariance))
    assert (np.abs(model.velocity - VELOCITY) < 0.5 * sigma).all()
    prediction = model.predict(round(40 * step_s * 1e9))
    ahead = prediction.state.difference(moving(40 * step_s))
    assert (np.abs(ahead) < 0.5 * np.sqrt(np.diag(prediction.covariance))).all()
    np.testing.assert_allclose(prediction.prior().information @ prediction.covariance, np.eye(N), atol=1e-6)


def test_what_is_not_seen_becomes_unsure_and_stays_where_it_was_going():
    model = informed(np.arange(20) * 0.033)
    blind = SURE.copy()
    blind[6] = blind[:, 6] = 0.0
    sigmas, last_ns = [], round(19 * 0.033 * 1e9)
    for _ in range(10):
        last_ns += 33_000_000
        prediction = model.predict(last_ns)
        model.update(last_ns, prediction.state, blind)
        sigmas.append(np.sqrt(np.diag(model.predict(last_ns).covariance))[6:])
    turn, bend = np.array(sigmas)[:, 1], np.array(sigmas)[:, 0]
    assert (np.diff(bend) > 0.0).all() and bend[-1] > 0.3
    assert turn.max() < 2e-3


def test_a_fast_limb_is_hardly_held_back():
    """A kick of 150 rad/s^2: what the images say well is believed, prediction or not."""
    model = informed([0.0, 0.033])
    state = moving(0.033)
    kicked = state.retract(np.append(np.zeros(7), 0.5 * 150.0 * 0.033**2))
    prediction = model.predict(66_000_000)
    information = prediction.prior().information + 4e4 * np.eye(N)
    pulled = np.linalg.solve(information, 4e4 * kicked.difference(prediction.state))
    assert abs(pulled[7] - kicked.difference(prediction.state)[7]) < 0.1 * 0.5 * 150.0 * 0.033**2


def test_without_information_there_is_no_prior_and_with_it_there_is_again():
    model = informed([0.0, 0.1])
    model.update(200_000_000, moving(0.2))
    assert model.predict(300_000_000).prior() is None
    assert model.velocity_covariance is None
    before = model.velocity.copy()
    model.update(300_000_000, moving(0.3), SURE)
    np.testing.assert_array_equal(model.velocity, before)
    assert model.predict(400_000_000).prior() is not None


def test_a_lost_body_with_information_coasts_to_a_stop_and_grows_unsure():
    model = informed(np.arange(10) * 0.1)
    sigma, before = np.sqrt(np.diag(model.predict(900_000_000).covariance)), moving(0.9)
    for k in range(10, 60):
        model.coast(k * 100_000_000, model.predict(k * 100_000_000).state)
    assert np.linalg.norm(model.velocity) < 1e-3
    assert np.linalg.norm(model.predict(5_900_000_000).state.difference(before)[:3]) < 0.5 * 1.1 * np.linalg.norm(VELOCITY[:3])
    assert (np.sqrt(np.diag(model.predict(5_900_000_000).covariance)) > 100.0 * sigma).all()


def test_cameras_of_other_instants_see_the_body_elsewhere():
    model = informed(np.arange(20) * 0.033)
    prediction = model.predict(660_000_000)
    assert ExposureDelays([0.0, 0.0], prediction).offsets(prediction.state) == [None, None]
    none, late, early = ExposureDelays([0.0, 0.01, -0.005], prediction).offsets(prediction.state)
    assert none is None
    np.testing.assert_allclose(late, 0.01 * prediction.velocity)
    np.testing.assert_allclose(early, -0.5 * late)
    faster = prediction.state.retract(0.01 * prediction.velocity)  # it has come farther than expected
    _, later, _ = ExposureDelays([0.0, 0.01, -0.005], prediction).offsets(faster)
    np.testing.assert_allclose(later, 0.01 * prediction.velocity_at(faster))
    assert np.linalg.norm(later[6:]) > 1.2 * np.linalg.norm(late[6:])


def test_a_passage_without_covariances_has_the_velocity_that_the_state_gives():
    model = fed([0.0, 0.1, 0.2], MotionConfig())
    prediction = model.predict(300_000_000)
    offset = ExposureDelays([0.0, 0.02], prediction).offsets(prediction.state)[1]
    np.testing.assert_allclose(offset, 0.02 * model.velocity)
    offset = ExposureDelays([0.0, 0.02], prediction).offsets(moving(0.7))[1]
    model.update(300_000_000, moving(0.7))
    np.testing.assert_allclose(offset[:6], 0.02 * model.velocity[:6], atol=1e-9)


def test_what_is_said_of_a_first_set_is_expected_of_it_alone():
    model = MotionModel(two_links().chain, MotionConfig(base="fixed"))
    sigmas = np.array([0.01] * 3 + [0.02] * 3 + [0.3, 0.4])
    model.expect(5, moving(0.3), sigmas)
    found = model.predict(5)
    np.testing.assert_allclose(found.state.difference(moving(0.3)), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), sigmas)
    model.update(5, moving(0.3), np.zeros((N, N)))
    np.testing.assert_allclose(np.sqrt(np.diag(model.predict(5 + 10**7).covariance))[:3], sigmas[:3], rtol=0.01)
    other = MotionModel(two_links().chain, MotionConfig())
    other.expect(5, moving(0.3), sigmas)
    assert other.predict(6) is None


@pytest.mark.parametrize("restarted", [False, True])
def test_joints_that_are_read_lead_the_prediction_of_their_set(restarted):
    axes = tuple(replace(axis, prismatic=axis.name == "turn") for axis in two_links().chain.axes)
    (joint,) = two_links().chain.joints
    chain = KinematicChain(("upper", "lower"), (replace(joint, axes=axes),))
    model = MotionModel(chain, MotionConfig(joint_state_sigma_deg=0.1, joint_state_sigma_m=0.002))
    model.update(0, moving(0.0), 1e4 * np.eye(N))
    if restarted:
        model.restart(10**8, moving(0.0))
    model.read_joints(2 * 10**8, np.array([0.5, -0.3]))
    found = model.predict(2 * 10**8)
    np.testing.assert_allclose(found.state.joint_positions, [0.5, -0.3], atol=1e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance))[6:], [np.radians(0.1), 0.002], rtol=0.01)
    model.update(2 * 10**8, found.state, np.zeros((N, N)))
    assert model.predict(2 * 10**8 + 1).state.joint_positions[0] == pytest.approx(0.5, abs=1e-3)


def test_a_joint_that_turns_without_end_is_read_on_the_turn_that_it_is_on():
    axes = tuple(replace(axis, lower=-ENDLESS_RAD, upper=ENDLESS_RAD) for axis in two_links().chain.axes)
    (joint,) = two_links().chain.joints
    model = MotionModel(KinematicChain(("upper", "lower"), (replace(joint, axes=axes),)), MotionConfig())
    start = moving(0.0)
    model.update(0, State(start.T_world_root, np.array([3.1, 9.5])), 1e4 * np.eye(N))
    model.read_joints(10**8, np.array([3.2 - math.tau, np.nan]))
    found = model.predict(10**8).state.joint_positions
    np.testing.assert_allclose(found, [3.2, 9.5], atol=1e-2)
