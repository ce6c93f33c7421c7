"""The lag between two cameras whose motion is one known signal, seen earlier or later."""

import numpy as np
import pytest

from tracker_node.calibration.clocks.motion import MotionProfiles, Signals, correlations, refined

PERIOD_S, SMOOTH_S = 0.04, 0.04
RNG = np.random.default_rng(1)
FREQUENCIES, PHASES = RNG.uniform(0.3, 3.0, (8, 5)), RNG.uniform(0.0, 2 * np.pi, (8, 5))


def motion(t):
    """(n, 5) of five planes, smooth and without a period."""
    return np.sin(2.0 * np.pi * FREQUENCIES * np.asarray(t)[:, None, None] + PHASES).sum(axis=1)


def signals(camera, other, start_s, end_s, late_s=0.0, drift=0.0, gain=1.0):
    """Of a camera that shows at t what happened at t - late - drift t."""
    t = np.arange(start_s, end_s, PERIOD_S)
    profiles = MotionProfiles(camera, t, {other: 3.0 + gain * motion(t - late_s - drift * t)}, t[0], t[-1])
    return Signals(profiles, PERIOD_S, SMOOTH_S)


def pair(late_s=0.0, drift=0.0, start_s=0.0, end_s=20.0, gain=1.0):
    return [signals("a", "b", 0.0, 20.0), signals("b", "a", start_s, end_s, late_s, drift, gain)]


def test_signals_are_on_an_even_grid_without_their_mean():
    one = signals("a", "b", 1.0, 5.0)
    other = signals("b", "a", 0.0, 1.0)
    values = one.towards(other)
    assert one.step_s == 0.02
    assert one.first == 50
    assert one.times_s[[0, -1]] == pytest.approx([1.0, 4.96])
    assert np.diff(one.times_s) == pytest.approx(0.02)
    assert values.shape == (len(one.times_s), 5)
    assert values.mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(KeyError):
        one.towards(one)


@pytest.mark.parametrize("late_s", [-0.8, -0.02, 0.0, 0.3, 1.2])
def test_the_correlation_is_highest_at_the_lag(late_s):
    first, table = correlations(pair(late_s), 2.0)[0, 1]
    best = int(np.argmax(table))
    assert (first + best) * 0.02 == pytest.approx(late_s, abs=0.011)
    assert table[best] > 0.98
    assert np.all(table <= 1.0 + 1e-9)
    assert abs(first) == 100
    assert len(table) == 201


def test_recordings_that_begin_at_other_times_have_the_same_lag():
    first, table = correlations(pair(0.3, start_s=3.0, end_s=17.0), 2.0)[0, 1]
    assert (first + int(np.argmax(table))) * 0.02 == pytest.approx(0.3, abs=0.011)


def test_lags_with_little_overlap_are_not_looked_at():
    """Of a recording of ten seconds, four at least: lags up to 16 s where the other has twenty."""
    table = correlations(pair(start_s=0.0, end_s=10.0), 100.0)[0, 1]
    lags = 0.02 * (table[0] + np.arange(len(table[1])))
    assert lags[0] == pytest.approx(-16.0, abs=0.1)
    assert lags[-1] == pytest.approx(6.0, abs=0.1)


def test_cameras_without_motion_have_no_lag():
    still = [signals("a", "b", 0.0, 5.0, gain=0.0), signals("b", "a", 0.0, 5.0)]
    assert correlations(still, 2.0)[0, 1] is None
    short = [signals("a", "b", 0.0, 0.4), signals("b", "a", 0.0, 0.4)]
    assert correlations(short, 2.0)[0, 1] is None


@pytest.mark.parametrize("late_s", [-0.513, 0.0071, 0.2468])
@pytest.mark.parametrize("gain", [1.0, 3.0])
def test_the_lag_is_found_below_the_image_period(late_s, gain):
    found = refined(0, 1, pair(late_s, gain=gain), round(late_s / 0.02) * 0.02, 10.0, 1)
    assert (found.i, found.j) == (0, 1)
    assert found.lag == pytest.approx([late_s], abs=1e-3)
    assert found.correlation > 0.99
    assert found.covariance.shape == (1, 1)
    assert 0.0 <= np.sqrt(found.covariance[0, 0]) < 2e-3


def test_the_lag_and_its_drift_are_those_of_the_middle():
    drift, middle_s = 2e-3, 10.0
    found = refined(0, 1, pair(0.1, drift), 0.12, middle_s, 2)
    # what the first shows at t the other shows at t' = (t + late) / (1 - drift)
    assert found.lag[0] == pytest.approx((middle_s + 0.1) / (1.0 - drift) - middle_s, abs=1e-3)
    assert found.lag[1] == pytest.approx(drift, abs=2e-4)
    assert found.covariance.shape == (2, 2)


def test_a_lag_from_far_off_is_not_believed():
    assert refined(0, 1, pair(0.5), 0.0, 10.0, 1) is None


def test_too_little_in_common_tells_nothing():
    assert refined(0, 1, pair(0.0), 19.5, 10.0, 1) is None
    assert refined(0, 1, pair(0.0), -19.5, 10.0, 1) is None


def test_motion_that_is_another_s_tells_nothing():
    t = np.arange(0.0, 20.0, PERIOD_S)
    noise = np.random.default_rng(5).standard_normal((len(t), 5))
    other = Signals(MotionProfiles("b", t, {"a": noise}, t[0], t[-1]), PERIOD_S, SMOOTH_S)
    assert refined(0, 1, [signals("a", "b", 0.0, 20.0), other], 0.0, 10.0, 1) is None


def test_noise_makes_the_lag_less_sure():
    t = np.arange(0.0, 20.0, PERIOD_S)
    noisy = motion(t - 0.1) + 2.0 * np.random.default_rng(5).standard_normal((len(t), 5))
    other = Signals(MotionProfiles("b", t, {"a": noisy}, t[0], t[-1]), PERIOD_S, SMOOTH_S)
    found = refined(0, 1, [signals("a", "b", 0.0, 20.0), other], 0.1, 10.0, 1)
    clean = refined(0, 1, pair(0.1), 0.1, 10.0, 1)
    assert found.covariance[0, 0] > 4.0 * clean.covariance[0, 0]
    assert abs(found.lag[0] - 0.1) < 4.0 * np.sqrt(found.covariance[0, 0])
    assert np.sqrt(found.covariance[0, 0]) < 0.02
