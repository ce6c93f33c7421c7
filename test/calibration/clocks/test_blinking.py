"""A light that blinks: found beside somebody who moves, and told from nothing of the kind."""

import numpy as np
import pytest

from benchmark.calibration import synchronize as benchmark
from tracker_node.calibration.clocks.flashes import flash_lags, seen_blinking
from tracker_node.errors import CalibrationError

RATE_HZ, EDGES_S = 30.0, np.cumsum(np.random.default_rng(3).uniform(0.3, 0.9, 40))


def images(late_s: float, edges_s=EDGES_S, n: int = 450, walks: bool = True):
    """A camera that begins late: a small light, and a bright bar that passes slowly."""
    rng = np.random.default_rng(5)
    for i in range(n):
        image = 90.0 + rng.normal(0.0, 2.0, (72, 128))
        t = i / RATE_HZ + late_s
        if walks:
            column = int(60 + 55 * np.sin(0.8 * t))
            image[20:60, column : column + 6] += 80.0
        if np.searchsorted(edges_s, t) % 2:
            image[8:11, 100:103] += 70.0
        yield round(1e9 * i / RATE_HZ), np.repeat(np.clip(image, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def test_changes_are_seen_to_an_image_with_their_kinds():
    found = seen_blinking("left", images(0.0))
    expected = EDGES_S[EDGES_S < 450 / RATE_HZ - 0.05]
    assert len(found.times_s) == pytest.approx(len(expected), abs=1)
    n = min(len(expected), len(found.times_s))
    assert np.abs(found.times_s[:n] - expected[:n]).max() < 0.51 / RATE_HZ
    assert found.kinds.tolist()[:4] == [1, 0, 1, 0]


def test_the_lag_is_found_far_below_an_image():
    (pair,), runners_up = flash_lags([seen_blinking("left", images(0.0)), seen_blinking("right", images(0.4137))], 2.0)
    assert pair.lag[0] == pytest.approx(-0.4137, abs=0.008) and pair.correlation > 0.9
    assert 1e-4 < pair.covariance[0, 0] ** 0.5 < 0.01 and max(runners_up) < 0.8


def test_even_blinking_is_said_to_be_ambiguous():
    even = np.arange(0.4, 20.0, 0.4)
    pairs, runners_up = flash_lags([seen_blinking(name, images(late, even)) for name, late in (("a", 0.0), ("b", 0.1))], 2.0)
    assert len(pairs) == 1 and min(runners_up) > 0.8


@pytest.mark.parametrize("more", [{"edges_s": np.array([])}, {"edges_s": EDGES_S[:2]}, {"edges_s": np.array([]), "walks": False}])
def test_no_light_is_named(more):
    with pytest.raises(CalibrationError, match="camera 'left': no light that blinks is seen"):
        seen_blinking("left", images(0.0, **more))


def test_real_videos_and_a_light_that_one_camera_alone_sees(tmp_path, capsys):
    room = benchmark.make_room(1)
    benchmark.write_blinking(room, tmp_path, 1, 15.0)
    assert np.abs(benchmark.errors_ms(room, tmp_path, "--by", "blinking")).max() < 15.0
    assert (tmp_path / "rig_timed.png").read_bytes().startswith(b"\x89PNG")
    dark = tmp_path / room.rig.cameras[2].source
    benchmark.write_video(dark, (np.full((36, 64, 3), 60, np.uint8) for _ in range(200)), 30.0)
    capsys.readouterr()
    assert np.isnan(benchmark.errors_ms(room, tmp_path, "--by", "blinking")).all()
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "camera 'cam3': no light that blinks is seen" in error
