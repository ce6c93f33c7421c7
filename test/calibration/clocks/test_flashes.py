"""Lags by flashes: each says no more than an interval, all of them together a short one."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.calibration.clocks.flashes import Flashes, flash_lags, seen_flashes
from tracker_node.errors import CalibrationError

RNG = np.random.default_rng(3)
FLASHES_S = np.sort(RNG.uniform(1.0, 29.0, 20))


def seen(name: str, late_s: float, rate_hz: float = 30.0, flashes=FLASHES_S) -> Flashes:
    """The image in whose period each flash falls."""
    period = 1.0 / rate_hz
    stamps = np.arange(round(30.0 * rate_hz)) * period
    times = np.unique(np.round((np.asarray(flashes) - late_s) / period) * period)
    return Flashes(name, times, period, stamps, np.zeros(len(stamps)))


@pytest.mark.parametrize("rates_hz", [(30.0, 30.0), (25.0, 59.94)])
def test_many_flashes_tell_a_lag_far_below_a_period(rates_hz):
    (pair,), runners_up = flash_lags([seen("a", 0.0, rates_hz[0]), seen("b", 0.3456, rates_hz[1])], 2.0)
    sigma = float(np.sqrt(pair.covariance[0, 0]))
    assert pair.lag[0] == pytest.approx(-0.3456, abs=2.5 * sigma) and abs(pair.lag[0] + 0.3456) < 6e-3
    assert 1e-4 < sigma < 5e-3 and pair.correlation == 1.0 and max(runners_up) < 0.5


def test_errors_are_as_large_as_is_said():
    rng, off = np.random.default_rng(5), []
    for _ in range(60):
        late, flashes = rng.uniform(-0.5, 0.5), np.sort(rng.uniform(1.0, 29.0, 20))
        (pair,), _ = flash_lags([seen("a", 0.0, 30.0, flashes), seen("b", late, 29.97, flashes)], 2.0)
        off.append((pair.lag[0] + late) / np.sqrt(pair.covariance[0, 0]))
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_one_flash_tells_four_tenths_of_a_period():
    (pair,), _ = flash_lags([seen("a", 0.0, flashes=[5.0]), seen("b", 0.1, flashes=[5.0])], 2.0)
    assert np.sqrt(pair.covariance[0, 0]) == pytest.approx(1.0 / 30.0 / np.sqrt(6.0), rel=0.1)


def test_flashes_that_one_camera_has_missed_do_no_harm():
    (pair,), _ = flash_lags([seen("a", 0.0, flashes=FLASHES_S[::2]), seen("b", 0.2, flashes=FLASHES_S[1:])], 2.0)
    assert pair.lag[0] == pytest.approx(-0.2, abs=8e-3)


def test_a_lamp_that_blinks_evenly_is_ambiguous():
    even = 1.0 + 0.5 * np.arange(20)
    (pair,), runners_up = flash_lags([seen("a", 0.0, flashes=even), seen("b", 0.1, flashes=even[1:])], 2.0)
    assert min(runners_up) > 0.8
    whole = round(float(pair.lag[0] + 0.1) / 0.5) * 0.5 - 0.1
    assert pair.lag[0] == pytest.approx(whole, abs=0.03)  # one of those that fit, and not between them


def test_flashes_of_other_times_give_no_pair():
    pairs, _ = flash_lags([seen("a", 0.0), seen("b", 0.0, flashes=np.sort(RNG.uniform(1.0, 29.0, 20)))], 0.2)
    assert not pairs or pairs[0].correlation < 0.7


def test_places_where_somebody_moves_are_no_flashes_in_common():
    """Of two and three that meet nowhere, one always meets another at some lag; so do two, of those of a lamp, now and then."""
    assert flash_lags([seen("a", 0.0, flashes=[5.0, 9.0]), seen("b", 0.1, flashes=[5.3, 11.0, 20.0])], 2.0)[0] == []
    for n, fits in ((1, False), (2, False), (6, True)):
        lamps = [replace(seen(name, late, flashes=FLASHES_S[:n]), in_room=False) for name, late in (("a", 0.0), ("b", 0.1))]
        if fits:
            assert flash_lags(lamps, 2.0)[0][0].lag[0] == pytest.approx(-0.1, abs=0.01)
        else:
            with pytest.raises(CalibrationError, match=f"'a': {n} changes? of light .* may be somebody who moves"):
                flash_lags(lamps, 2.0)


def images(n: int, bright: set[int], part: tuple[slice, slice] = (slice(None), slice(None)), gain: float = 40.0):
    rng = np.random.default_rng(1)
    for i in range(n):
        image = np.full((72, 128, 3), 80.0)
        image[20:40, (i * 3) % 100 : (i * 3) % 100 + 15] = 30.0  # somebody who walks
        if i in bright:
            image[part] += gain
        yield i * 40_000_000, np.clip(image + rng.normal(0.0, 2.0, image.shape), 0, 255).astype(np.uint8)


def test_flashes_are_found_beside_what_moves():
    found = seen_flashes("a", images(80, {11, 30, 31, 55}))
    assert found.times_s == pytest.approx([0.44, 1.2, 2.2]) and found.period_s == pytest.approx(0.04)
    assert len(found.stamps_s) == len(found.levels) == 80 and found.in_room


def test_a_lamp_in_a_corner_is_found():
    corner = (slice(60, 72), slice(100, 128))
    found = seen_flashes("a", images(80, set(range(20, 40)) | {60}, corner, 120.0))
    assert found.times_s == pytest.approx([0.8, 2.4]) and not found.in_room


def test_where_nothing_flashes_it_is_said():
    with pytest.raises(CalibrationError, match="no flash is seen"):
        seen_flashes("a", ((i * 40_000_000, np.full((72, 128, 3), 80, np.uint8)) for i in range(30)))
    with pytest.raises(CalibrationError, match="has 3 images"):
        seen_flashes("a", images(3, {1}))
