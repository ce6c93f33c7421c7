"""Matching in time: interpolation, and the lag."""

import numpy as np
import pytest

from tracker_node.evaluation.truth.association import estimate_lag, image_period_ns, truth_at
from tracker_node.loaders.motion.trajectory_file import Trajectories

PERIOD_NS = 16_666_667


def wave(stamps_ns, names=("a", "b"), seed=0):
    """Smooth points that a lag can be read from."""
    phase = np.random.default_rng(seed).uniform(0, 6, (len(names), 3))
    t = np.asarray(stamps_ns, dtype=np.float64)[:, None, None] * 1e-9
    positions = np.sin(4.0 * t + phase)
    return Trajectories(names, np.asarray(stamps_ns), positions, np.ones(positions.shape[:2], dtype=bool))


def naive_at(trajectories, stamp):
    """One time step by searching from the start."""
    stamps = trajectories.stamps_ns
    for i in range(len(stamps)):
        if stamps[i] == stamp:
            return trajectories.positions_m[i], trajectories.valid[i]
    for i in range(len(stamps) - 1):
        if stamps[i] < stamp < stamps[i + 1]:
            w = (stamp - stamps[i]) / (stamps[i + 1] - stamps[i])
            a, b = trajectories.positions_m[i], trajectories.positions_m[i + 1]
            return a + w * (b - a), trajectories.valid[i] & trajectories.valid[i + 1]
    return np.zeros_like(trajectories.positions_m[0]), np.zeros(len(trajectories.names), dtype=bool)


def test_interpolation_against_a_search():
    rng = np.random.default_rng(5)
    stamps = np.cumsum(rng.integers(1, 40, 30)) + 1_700_000_000_000_000_000  # epoch stamps lose no precision
    t = wave(stamps)
    t = Trajectories(t.names, t.stamps_ns, t.positions_m, rng.random(t.valid.shape) < 0.8)
    query = np.concatenate([stamps, rng.integers(stamps[0] - 20, stamps[-1] + 20, 200)])
    found, found_valid = t.at(query)
    for i, stamp in enumerate(query):
        positions, valid = naive_at(t, stamp)
        assert found_valid[i].tolist() == valid.tolist()
        assert found[i][valid] == pytest.approx(positions[valid], abs=1e-9)


def test_nothing_is_extrapolated():
    t = wave(np.arange(5) * 10)
    assert t.at(np.array([-1, 0, 40, 41]))[1][:, 0].tolist() == [False, True, True, False]
    assert t.at(np.array([0, 10, 40]), earlier_ns=0.5)[1][:, 0].tolist() == [False, True, True]


def test_one_row_is_only_valid_at_its_own_time_step():
    t = wave(np.array([100]))
    assert t.at(np.array([99, 100, 101]))[1][:, 0].tolist() == [False, True, False]


@pytest.mark.parametrize("lag", [-1.37, 0.0, 0.85, 2.0])
def test_the_lag_is_found(lag):
    images = np.arange(100) * PERIOD_NS
    truth = wave(images)  # row i of the truth ...
    estimate = wave(images - round(lag * PERIOD_NS))  # ... shows what image i + lag shows
    estimate = Trajectories(estimate.names, images, estimate.positions_m, estimate.valid)
    assert estimate_lag(estimate, truth, PERIOD_NS) == pytest.approx(lag, abs=0.02)
    moved = truth_at(truth, images, lag, PERIOD_NS)
    both = moved.valid.all(axis=1)
    assert both.sum() >= 97
    assert moved.positions_m[both] == pytest.approx(estimate.positions_m[both], abs=1e-3)


def test_an_offset_along_the_path_is_no_lag():
    images = np.arange(60) * PERIOD_NS
    truth = wave(images)
    positions = truth.positions_m.copy()
    positions += np.linspace(0.0, 1.0, 60)[:, None, None]  # moves one way ...
    truth = Trajectories(truth.names, images, positions, truth.valid)
    estimate = Trajectories(truth.names, images, positions + 0.05, truth.valid)  # ... and is seen ahead of itself
    assert estimate_lag(estimate, truth, PERIOD_NS) == pytest.approx(0.0, abs=0.011)


def test_without_common_sets_the_lag_is_zero():
    images = np.arange(3) * PERIOD_NS
    assert estimate_lag(wave(images), wave(images), PERIOD_NS) == 0.0


def test_the_period_bears_missing_sets():
    assert image_period_ns(np.array([0, 10, 20, 50, 60, 70])) == 10.0
    with pytest.raises(ValueError, match="two stamps"):
        image_period_ns(np.array([3]))


def test_selection_and_shape_checks():
    t = wave(np.arange(4), names=("a", "b", "c"))
    assert t.select(["c", "a"]).positions_m == pytest.approx(t.positions_m[:, [2, 0]])
    assert t.shifted(7).stamps_ns.tolist() == [7, 8, 9, 10]
    with pytest.raises(ValueError, match="increasing"):
        Trajectories(t.names, t.stamps_ns[::-1], t.positions_m, t.valid)
    with pytest.raises(ValueError, match="positions"):
        Trajectories(("a",), t.stamps_ns, t.positions_m, t.valid)
