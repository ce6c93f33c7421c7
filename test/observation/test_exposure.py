"""The light of whole images, taken out; whatever moves before the wall, and whatever else an image may show."""

import numpy as np
import pytest

from tracker_node.observation.exposure import Exposure, Exposures

WALL = np.random.default_rng(1).integers(30, 160, (30, 40, 3)).repeat(16, axis=0).repeat(16, axis=1).astype(np.uint8)


def in_light(gains, n: int = 0, wall: np.ndarray = WALL) -> np.ndarray:
    noise = np.random.default_rng(n).normal(0.0, 3.0, wall.shape)
    return np.clip(np.rint(wall * np.asarray(gains) + noise), 0, 255).astype(np.uint8)


def seen(*images: np.ndarray) -> Exposure:
    exposure = Exposure()
    for image in images:
        exposure.normalized(image)
    return exposure


@pytest.mark.parametrize("gains", [(0.6, 0.6, 0.6), (1.4, 1.4, 1.4), (0.5, 0.5, 0.5), (0.8, 1.0, 1.3)])
def test_an_image_is_as_in_the_light_of_the_first_one(gains):
    exposure = seen(in_light(1.0), in_light(1.0, 1))
    found = exposure.normalized(in_light(gains, 2))
    np.testing.assert_allclose(exposure.gains, gains, rtol=0.01)
    assert np.abs(np.median(found.astype(float) - WALL, axis=(0, 1))).max() <= 1.0
    again = exposure.normalized(in_light(1.0, 3))
    assert np.abs(again.astype(float) - WALL).mean() < 3.5 and np.abs(exposure.gains - 1.0).max() < 0.01


def test_an_image_in_the_same_light_is_left_as_it_is():
    exposure, image = seen(in_light(1.0)), in_light(1.015, 1)
    assert exposure.normalized(image) is image


def test_what_moves_before_the_wall_does_not_matter():
    before, now = in_light(1.0), in_light(0.7, 1)
    before[:, 100:164], now[:, 300:364] = 220, 20  # a tenth of the image, twice
    exposure = seen(before)
    exposure.normalized(now)
    np.testing.assert_allclose(exposure.gains, 0.7, rtol=0.03)


def test_what_is_cut_off_at_white_tells_no_light():
    bright = WALL.astype(float) * 1.45
    exposure = seen(in_light(1.0, wall=bright))
    exposure.normalized(in_light(1.3, 1, bright))
    np.testing.assert_allclose(exposure.gains, 1.3, rtol=0.01)
    for n in range(20):
        exposure.normalized(in_light(1.3, n, bright))
    found = exposure.normalized(in_light(1.0, 2, bright))
    assert np.abs(exposure.gains - 1.0).max() < 0.02 and np.abs(np.median(found - np.minimum(bright, 255))) < 3.0


@pytest.mark.parametrize("other", [WALL[::-1, ::-1].copy(), np.full_like(WALL, 90), np.zeros_like(WALL)])
def test_another_picture_is_no_other_light(other):
    exposure = seen(in_light(1.0))
    assert exposure.normalized(other) is other and (exposure.gains == 1.0).all()
    dark = in_light(0.6, 1)
    assert np.abs(np.median(exposure.normalized(dark).astype(float) - WALL)) <= 1.0  # the wall is still known


def test_another_picture_that_stays_is_what_is_compared_with():
    turned = np.clip(1.2 * WALL[::-1, ::-1], 0, 255)
    exposure = seen(in_light(1.0), *(in_light(1.0, n, turned) for n in range(30)))
    exposure.normalized(in_light(0.6, 3, turned))
    np.testing.assert_allclose(exposure.gains, 0.6, rtol=0.01)


def test_a_light_that_falls_slowly_is_followed():
    exposure = Exposure()
    for n, gain in enumerate(np.linspace(1.0, 0.5, 60)):
        found = exposure.normalized(in_light(gain, n))
    assert np.abs(np.median(found.astype(float) - WALL)) <= 2.0


def test_each_camera_has_a_light_of_its_own_and_one_without_an_image_keeps_it():
    exposures = Exposures(2)
    first = [in_light(1.0), in_light(1.0, 1)]
    assert all(a is b for a, b in zip(exposures.normalized(first), first, strict=True))
    dark = in_light(0.6, 2)
    left, right = exposures.normalized([None, dark])
    assert left is None and right is not dark
    exposures.reset()
    assert exposures.normalized([first[0], dark])[1] is dark  # which is the first now


def test_images_of_another_size_are_compared_with_each_other():
    exposure = seen(in_light(1.0))
    small = in_light(0.6, 1)[::2, ::2].copy()
    assert exposure.normalized(small) is small
    exposure.normalized(in_light(0.3, 1)[::2, ::2].copy())
    np.testing.assert_allclose(exposure.gains, 0.5, rtol=0.03)
