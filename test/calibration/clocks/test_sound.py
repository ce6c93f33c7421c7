"""Lags by sound: claps in rooms, of which the truth is known."""

import numpy as np
import pytest

from tracker_node.calibration.clocks.motion import Pair
from tracker_node.calibration.clocks.offsets import clocks_of_pairs
from tracker_node.calibration.clocks.sound import Heard, sound_lags
from tracker_node.errors import CalibrationError

RATE_HZ = 16_000
CLAPS_S = (1.1, 2.0, 3.7, 4.2)


def heard(
    name: str, late_s: float, way_s: float = 0.0, claps=CLAPS_S, rate_hz: int = RATE_HZ, known: bool = False, **more
) -> Heard:  # fmt: skip
    """What a camera hears whose clock is late by so much, with some noise of its own."""
    rng, own = np.random.default_rng(7), np.random.default_rng(ord(name[-1]))
    samples = 0.003 * own.normal(size=6 * rate_hz)
    t = np.arange(len(samples)) / rate_hz
    for at_s in claps:
        phases, tones = rng.uniform(0.0, 2.0 * np.pi, 40), rng.uniform(600.0, 6000.0, 40)
        since = t - (at_s + way_s - late_s)
        sounding = np.flatnonzero((since >= 0.0) & (since < 0.03))
        sound = np.sin(2.0 * np.pi * tones * since[sounding, None] + phases).sum(axis=1)
        samples[sounding] += 0.1 * sound * np.exp(-since[sounding] / 0.004)
    return Heard(name, rate_hz, 0.0, samples.astype(np.float32), way_s if known else 0.0, **more)


def test_lags_are_found_to_parts_of_a_sample():
    late = {"a": 0.0, "b": 0.3337, "c": -0.41213}
    pairs, runners_up = sound_lags([heard(name, value) for name, value in late.items()], 2.0)
    values = list(late.values())
    assert [(pair.i, pair.j) for pair in pairs] == [(0, 1), (0, 2), (1, 2)]
    for pair in pairs:
        assert pair.lag[0] == pytest.approx(values[pair.i] - values[pair.j], abs=2e-5)
        assert 0.0 < pair.covariance[0, 0] < 1e-3**2 and pair.correlation > 0.5
    assert max(runners_up) < 0.8
    clocks = clocks_of_pairs(pairs, list(late), runners_up, 3.0, what="sound")
    found = [clocks.cameras[name].offset_s for name in late]
    assert np.diff(found) == pytest.approx(np.diff(values), abs=3e-5)


def test_other_rates_are_no_matter():
    (pair,), _ = sound_lags([heard("a", 0.0), heard("b", 0.25, rate_hz=22_050)], 2.0)
    assert pair.lag[0] == pytest.approx(-0.25, abs=5e-5)


def test_the_way_of_sound_is_taken_off():
    near, far = heard("a", 0.0, 0.004, known=True), heard("b", 0.1, 0.012, known=True, way_sigma_s=0.001)
    (pair,), _ = sound_lags([near, far], 2.0)
    assert pair.lag[0] == pytest.approx(-0.1, abs=3e-5)
    assert pair.covariance[0, 0] == pytest.approx(0.001**2, rel=0.05)
    (unknown,), _ = sound_lags([heard("a", 0.0, 0.004), heard("b", 0.1, 0.012)], 2.0)
    assert unknown.lag[0] == pytest.approx(-0.1 + 0.008, abs=3e-5)


def test_claps_at_even_times_are_said_to_be_ambiguous():
    even = tuple(0.8 + 0.6 * np.arange(8))
    pairs, runners_up = sound_lags([heard("a", 0.0, claps=even), heard("b", 0.1, claps=even)], 2.0)
    assert len(pairs) == 1 and min(runners_up) > 0.8


def test_a_clap_that_one_camera_has_not_heard():
    tracks = [heard("a", 0.0), heard("b", 0.2), heard("c", 0.0, claps=())]
    pairs, runners_up = sound_lags(tracks, 2.0)
    assert (0, 1) in [(pair.i, pair.j) for pair in pairs]
    with pytest.raises(CalibrationError, match="its sound agrees with no other camera's within the largest offset"):
        clocks_of_pairs(pairs, ["a", "b", "c"], runners_up, 3.0, what="sound")


def test_lags_beyond_what_is_searched_are_not_found():
    pairs, _ = sound_lags([heard("a", 0.0), heard("b", 0.5)], 0.3)
    assert all(abs(pair.lag[0]) <= 0.32 for pair in pairs)


def test_a_silent_track_is_named():
    with pytest.raises(CalibrationError, match="sound track is silent"):
        sound_lags([heard("a", 0.0), Heard("quiet", RATE_HZ, 0.0, np.zeros(5 * RATE_HZ, np.float32))], 2.0)


def test_two_rooms_are_not_brought_together():
    pairs = [Pair(0, 1, np.array([1.0]), np.array([[1e-6]]), 0.9), Pair(2, 3, np.array([0.5]), np.array([[1e-6]]), 0.9)]
    with pytest.raises(CalibrationError, match="agrees with that of no camera of a, b"):
        clocks_of_pairs(pairs, ["a", "b", "c", "d"], [0.0] * 4, 0.0, what="sound")


def test_tracks_that_have_nothing_in_common_agree_nowhere():
    """Noise has onsets everywhere."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        tracks = [Heard(name, RATE_HZ, 0.0, (0.01 * rng.normal(size=8 * RATE_HZ)).astype(np.float32)) for name in "ab"]
        pairs, _ = sound_lags(tracks, 2.0)
        assert all(pair.correlation < 0.5 for pair in pairs)


def test_claps_of_other_times_are_refused():
    claps = {"a": (1.0, 2.3, 4.4), "b": (0.7, 3.2, 5.1), "c": (1.7, 2.1, 3.9)}
    tracks = [heard(name, 0.0, claps=times) for name, times in claps.items()]
    pairs, runners_up = sound_lags(tracks, 2.0)
    with pytest.raises(CalibrationError, match=r"its sound agrees with|repeats itself"):
        clocks_of_pairs(pairs, ["a", "b", "c"], runners_up, 3.0, what="sound")
