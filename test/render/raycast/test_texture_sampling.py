"""Colors of a texture by closed forms: a ramp between texels, and its levels by the size of a pixel."""

import numpy as np
import pytest

from tracker_node.render.raycast.surface_arrays import N_LEVELS, _Album, _bilinear, sample

f32 = np.float32


def ramp(height, width):
    rows, columns = np.indices((height, width))
    return np.stack([10 * columns, 20 * rows, 2 * rows * columns], axis=-1).astype(np.uint8)


ALBUM = _Album()
ALBUM.add(np.full((3, 5, 3), 7, np.uint8))  # another texture before it
NUMBER = ALBUM.add(ramp(8, 16))
LEVELS, TEXELS = np.array(ALBUM.levels, dtype=np.int64), np.concatenate(ALBUM.texels)


def at(u, v, level=0):
    start, width, height = LEVELS[NUMBER, level]
    return _bilinear(TEXELS, start, width, height, f32(u), f32(v))


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (3.0, 2.0), (3.25, 2.5), (14.9, 6.7), (15.0, 7.0)])
def test_between_texels(x, y):
    assert at((x + 0.5) / 16.0, (y + 0.5) / 8.0) == pytest.approx((10.0 * x, 20.0 * y, 2.0 * x * y), abs=1e-3)


@pytest.mark.parametrize(
    ("u", "v", "x", "y"), [(-1.0, 0.5, 0.0, 3.5), (2.0, 0.5, 15.0, 3.5), (0.5, -1.0, 7.5, 0.0), (0.5, 2.0, 7.5, 7.0)]
)
def test_the_border_goes_on_outside(u, v, x, y):
    assert at(u, v) == pytest.approx((10.0 * x, 20.0 * y, 2.0 * x * y), abs=1e-3)


def seen(step_u, step_v, u=0.4, v=0.6, down=False):
    """Where a pixel to the right (or down) is so many texels on."""
    steps = (f32(step_u / 16.0), f32(step_v / 8.0))
    none = (f32(0.0), f32(0.0))
    return np.array(sample(LEVELS, TEXELS, NUMBER, f32(u), f32(v), *(none + steps if down else steps + none)))


@pytest.mark.parametrize("down", [False, True])
def test_the_level_is_that_of_the_size_of_a_pixel(down):
    levels = [np.array(at(0.4, 0.6, level)) for level in range(5)]
    assert np.ptp(levels, axis=0).max() > 3.0
    for steps, level in (((0.5, 0.5), 0.0), ((1.0, 0.0), 0.0), ((2.0, 0.0), 1.0), ((0.0, 4.0), 2.0), ((8.0, 0.0), 3.0),
                         ((3.0, 4.0), np.log2(5.0)), ((0.0, 2.0**1.5), 1.5), ((1.2, 0.0), np.log2(1.2))):  # fmt: skip
        k = int(level)
        expected = levels[k] + (level - k) * (levels[k + 1] - levels[k])
        np.testing.assert_allclose(seen(*steps, down=down), expected, atol=1e-3)


def test_no_level_is_beyond_the_last():
    last = TEXELS[LEVELS[NUMBER, N_LEVELS - 1, 0]].astype(float)
    np.testing.assert_allclose(seen(1e9, 1e9), last, atol=1e-3)
