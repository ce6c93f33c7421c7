"""The background model: statistics, shadows, gain, regions, and what it does not know."""

import cv2
import numpy as np
import pytest

from tracker_node.observation.background_subtraction import BackgroundModel, without_specks

HEIGHT, WIDTH = 120, 163
WHOLE = (0, 0, WIDTH, HEIGHT)


@pytest.fixture(scope="module")
def scene():
    """A smooth, colored empty scene."""
    noise = np.random.default_rng(3).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 12)
    smooth = (smooth - smooth.min()) / (smooth.max() - smooth.min())
    return (60 + 140 * smooth).astype(np.uint8)


def noisy(image, sigma, seed):
    noise = np.random.default_rng(seed).normal(0.0, sigma, image.shape)
    return np.clip(image + noise, 0, 255).round().astype(np.uint8)


def test_mean_and_variance_of_many_images(scene):
    images = [noisy(scene, 9.0, seed) for seed in range(40)]
    model = BackgroundModel.from_images(iter(images), noise=1.0, jitter_px=0.0)
    stack = np.stack(images).astype(np.float64)
    np.testing.assert_allclose(np.moveaxis(model.mean, 0, 2), stack.mean(axis=0), atol=1e-3)
    np.testing.assert_allclose(model.variance, stack.var(axis=0, ddof=1).mean(axis=2), rtol=1e-4)


def test_one_image_gets_the_noise_floor_and_more_along_edges():
    image = np.full((20, 30, 3), 50, dtype=np.uint8)
    image[:, 15:] = 150
    model = BackgroundModel.from_images([image], noise=5.0, jitter_px=0.5)
    assert model.variance[10, 3] == 25.0
    assert model.variance[10, 15] == pytest.approx(25.0 + 0.25 * 50.0**2)


def test_score_is_the_formula(scene):
    model = BackgroundModel.from_images([scene], noise=4.0)
    live = noisy(scene[::-1], 20.0, 1)
    gains = np.array([0.9, 1.0, 1.2], dtype=np.float32)
    x, m = live.astype(np.float64), np.moveaxis(model.mean, 0, 2).astype(np.float64) * gains
    a = np.clip((x * m).sum(axis=2) / ((m * m).sum(axis=2) + 1), 0.7, 1.0)
    expected = ((x - a[..., None] * m) ** 2).sum(axis=2) / model.variance
    np.testing.assert_allclose(model.score(live, WHOLE, shadow=0.7, gains=gains), expected, rtol=1e-3, atol=1e-3)


def test_the_scene_itself_is_background_and_a_body_is_not(scene):
    model = BackgroundModel.from_images([noisy(scene, 4.0, seed) for seed in range(10)], noise=4.0)
    live = noisy(scene, 4.0, 99)
    body = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    cv2.ellipse(body, (80, 60), (20, 45), 0, 0, 360, 255, -1)
    live[body > 0] = (20, 30, 220)
    mask = without_specks(model.foreground(live, WHOLE))
    assert (mask != body).mean() < 0.003


def test_a_shadow_is_background_down_to_the_tolerance(scene):
    model = BackgroundModel.from_images([scene])
    for darkness, is_body in ((0.7, 0.0), (0.3, 1.0)):
        live = (scene * darkness).astype(np.uint8)
        assert (model.foreground(live, WHOLE, shadow=0.6) > 0).mean() == pytest.approx(is_body, abs=0.02)
    assert (model.foreground((scene * 0.7).astype(np.uint8), WHOLE, shadow=1.0) > 0).mean() > 0.9


def test_gains_follow_exposure_and_white_balance(scene):
    model = BackgroundModel.from_images([scene])
    true = np.array([0.8, 1.0, 1.15])
    live = np.clip(scene * true, 0, 255).astype(np.uint8)
    body = (40, 20, 100, 110)
    live[20:110, 40:100] = 0
    gains = model.gains(live, body)
    np.testing.assert_allclose(gains, true, rtol=0.01)
    outside = np.ones((HEIGHT, WIDTH), dtype=bool)
    outside[20:110, 40:100] = False
    assert (model.foreground(live, WHOLE)[outside] > 0).mean() > 0.5
    assert (model.foreground(live, WHOLE, gains=gains)[outside] > 0).mean() < 0.01
    np.testing.assert_array_equal(model.gains(np.zeros_like(scene) + 255), np.ones(3))


def test_a_region_is_the_same_as_that_part_of_the_image(scene):
    model = BackgroundModel.from_images([scene])
    live = noisy(scene[:, ::-1], 10.0, 5)
    region = (17, 9, 101, 77)
    part = slice(9, 77), slice(17, 101)
    np.testing.assert_array_equal(model.score(live, region), model.score(live, WHOLE)[part])
    np.testing.assert_array_equal(model.foreground(live, region), model.foreground(live, WHOLE)[part])
    view = cv2.merge([live, live])[:, :, 3:]  # not contiguous
    np.testing.assert_array_equal(model.score(view, region), model.score(live, region))


def test_read_only_images_are_fine(scene):
    frozen = scene.copy()
    frozen.setflags(write=False)
    assert not BackgroundModel.from_images([scene]).foreground(frozen, WHOLE).any()


def test_where_the_scene_is_not_known_nothing_is_foreground(scene):
    known = np.ones((HEIGHT, WIDTH), dtype=bool)
    known[:, :80] = False
    mask = BackgroundModel.from_images([scene], known=known).foreground(255 - scene, WHOLE)
    assert not mask[:, :80].any()
    assert mask[:, 80:].mean() > 200


def test_specks_go_and_bodies_stay():
    mask = np.zeros((40, 60), dtype=np.uint8)
    mask[10:30, 10:40] = 255
    clean = mask.copy()
    mask[20, 20], mask[5, 50] = 0, 255
    mask[30:34, 50:54] = 255
    with_blob = without_specks(mask)
    assert with_blob[5, 50] == 0
    assert with_blob[20, 20] == 255
    assert with_blob[31:33, 51:53].all()
    np.testing.assert_array_equal(without_specks(mask, smallest_px=50), without_specks(clean))
    assert not without_specks(np.zeros((5, 5), dtype=np.uint8), smallest_px=3).any()


def test_misuse_is_named(scene):
    with pytest.raises(ValueError, match="at least one image"):
        BackgroundModel.from_images([])
    with pytest.raises(ValueError, match=r"of shape \(120, 163, 3\), got \(60, 163, 3\)"):
        BackgroundModel.from_images([scene, scene[:60]])
    with pytest.raises(ValueError, match="mask 'known'"):
        BackgroundModel.from_images([scene], known=np.ones((3, 3)))
    model = BackgroundModel.from_images([scene])
    with pytest.raises(ValueError, match="as the background has"):
        model.foreground(scene[:60], WHOLE)
    with pytest.raises(ValueError, match="expected a region"):
        model.foreground(scene, (0, 0, WIDTH + 1, 5))
