"""Filters and derivatives against signals of which both are known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helpers.bodies.moving_person import moving
from helpers.bodies.two_links import two_links
from tracker_node.evaluation.motion.kinematics import (
    SHORTEST,
    derivatives,
    lowpass,
    residual_cutoffs_hz,
    state_kinematics,
    stretches,
)
from tracker_node.model.configuration import State

RATE_HZ = 100.0
TIMES = np.arange(400) / RATE_HZ
MIDDLE = slice(60, -60)


def sine(frequency_hz, phase=0.3):
    return np.sin(2 * np.pi * frequency_hz * TIMES + phase)[:, None]


@pytest.mark.parametrize("cutoff_hz", [4.0, 6.0, 12.0, 30.0])
def test_half_of_the_power_is_left_at_the_cutoff_and_nothing_is_late(cutoff_hz):
    valid = np.ones(400, dtype=bool)
    filtered, good = lowpass(sine(cutoff_hz), valid, RATE_HZ, np.array([cutoff_hz]))
    assert good.all()
    gain = np.vdot(filtered[MIDDLE], sine(cutoff_hz)[MIDDLE]) / np.vdot(sine(cutoff_hz)[MIDDLE], sine(cutoff_hz)[MIDDLE])
    assert gain == pytest.approx(np.sqrt(0.5), abs=0.01)  # of the amplitude, in phase
    assert filtered[MIDDLE] == pytest.approx(gain * sine(cutoff_hz)[MIDDLE], abs=0.02)


@pytest.mark.parametrize("frequency_hz", [2.0, 8.0, 12.0, 20.0])
def test_the_filter_falls_as_one_of_fourth_order(frequency_hz):
    filtered, _ = lowpass(sine(frequency_hz), np.ones(400, dtype=bool), RATE_HZ, np.array([6.0]))
    gain = np.vdot(filtered[MIDDLE], sine(frequency_hz)[MIDDLE]) / np.vdot(sine(frequency_hz)[MIDDLE], sine(frequency_hz)[MIDDLE])
    warped = np.tan(np.pi * frequency_hz / RATE_HZ) / np.tan(np.pi * 6.0 / RATE_HZ)  # the bilinear transform's frequencies
    assert gain == pytest.approx(1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * warped**4), abs=2e-3)


def test_derivatives_of_polynomials_are_exact_and_of_sines_close():
    t = TIMES[:, None]
    values = np.concatenate([1 + 2 * t - 3 * t**2 + 0.5 * t**3, sine(5.0)], axis=1)
    first, second, good = derivatives(values, np.ones(400, dtype=bool), RATE_HZ)
    assert good.all()
    assert first[:, 0] == pytest.approx((2 - 6 * t + 1.5 * t**2)[:, 0], abs=1e-8)
    assert second[:, 0] == pytest.approx((-6 + 3 * t)[:, 0], abs=1e-5)
    w = 2 * np.pi * 5.0
    assert first[MIDDLE, 1] == pytest.approx(w * np.cos(w * TIMES + 0.3)[MIDDLE], abs=1e-4 * w)
    assert second[MIDDLE, 1] == pytest.approx(-(w**2) * sine(5.0)[MIDDLE, 0], abs=1e-3 * w**2)


def test_residual_analysis_finds_the_cutoff_between_signal_and_noise():
    rng = np.random.default_rng(0)
    slow = np.concatenate([sine(0.5), sine(1.5), sine(4.0)], axis=1)
    noisy = slow + 0.02 * rng.normal(size=slow.shape)
    valid = np.ones(400, dtype=bool)
    cutoffs = residual_cutoffs_hz(noisy, valid, RATE_HZ)
    assert np.all(np.diff(cutoffs) > 0) and cutoffs[0] > 0.5 and cutoffs[2] < 15.0
    filtered, _ = lowpass(noisy, valid, RATE_HZ, cutoffs)
    before, after = (np.sqrt(np.mean((values - slow)[MIDDLE] ** 2, axis=0)) for values in (noisy, filtered))
    assert np.all(after < 0.65 * before)


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_gaps_part_signals_and_short_stretches_are_left_out(valid):
    valid = np.array(valid)
    values = np.where(valid[:, None], 7.0, 0.0) * np.ones((1, 2))
    filtered, good = lowpass(values, valid, RATE_HZ, np.array([6.0, 20.0]))
    first, second, derived = derivatives(values, valid, RATE_HZ)
    kept = np.zeros_like(valid)
    for stretch in stretches(valid):
        assert valid[stretch].all() and stretch.stop - stretch.start >= SHORTEST
        kept[stretch] = True
    assert np.array_equal(good, kept) and np.array_equal(derived, kept)
    assert filtered == pytest.approx(np.where(kept[:, None], 7.0, 0.0) * np.ones((1, 2)))  # zeros in gaps have no part in it
    assert first == pytest.approx(np.zeros_like(values), abs=1e-8) and second == pytest.approx(np.zeros_like(values), abs=1e-4)


def test_velocities_of_states_are_those_of_the_tangent():
    motion = moving(120, two_links(), rate_hz=200.0)
    found = state_kinematics(motion, 60.0)  # far above what moves: what is left are the derivatives
    fine = moving(1200, two_links(), rate_hz=2000.0)
    for i in (40, 60, 80):
        before, here, after = (State.from_values(fine.values[10 * i + k]) for k in (-1, 0, 1))
        velocity = after.difference(before) * 1000.0
        acceleration = (after.difference(here) - here.difference(before)) * 2000.0**2
        assert found.velocity[i] == pytest.approx(velocity, abs=2e-3)
        assert found.acceleration[i] == pytest.approx(acceleration, abs=0.1)


def test_noise_of_states_is_filtered_and_orientation_stays_one():
    clean = moving(240)
    rng = np.random.default_rng(2)
    shaken = clean.values + 0.01 * rng.normal(size=clean.values.shape)
    turns = Rotation.from_rotvec(0.01 * rng.normal(size=(240, 3))) * Rotation.from_rotvec(clean.values[:, 3:6])
    shaken[:, 3:6] = turns.as_rotvec()
    found = state_kinematics(replace(clean, values=shaken))
    errors = found.motion.landmarks_m() - clean.landmarks_m()
    before = replace(clean, values=shaken).landmarks_m() - clean.landmarks_m()
    assert np.sqrt(np.mean(errors**2)) < 0.6 * np.sqrt(np.mean(before**2))
    assert found.cutoffs_hz.min() > 0.5 and found.cutoffs_hz.max() < 27.0


def test_rotations_past_half_a_turn_do_not_jump():
    motion = moving(300)  # the root turns by more than one whole turn
    assert np.abs(np.diff(motion.values[:, 3:6], axis=0)).max() > 3.0
    found = state_kinematics(motion, 20.0)
    assert np.abs(found.velocity[:, 3:6]).max() < 3.0


@pytest.mark.parametrize("cutoff_hz", [0.0, -1.0, 28.0, float("nan")])
def test_cutoffs_that_make_no_sense_are_refused(cutoff_hz):
    with pytest.raises(ValueError, match="cutoff"):
        state_kinematics(moving(30, two_links()), cutoff_hz)
