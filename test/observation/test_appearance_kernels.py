"""The vectorized pixel loops against the formulas, written out with whole arrays."""

import math

import numpy as np
import pytest

from tracker_node.observation.appearance import ColorModel, SceneModel, body_log_odds
from tracker_node.observation.appearance_kernels import log_odds, update_scene

HEIGHT, WIDTH, REGION, SHIFT = 40, 71, (5, 3, 64, 37), 4
PART = slice(3, 37), slice(5, 64)
SHADOW, OUTLIER, REACH, LOG_SHADOW = 0.7, -3.9, 10.0, -7.5


@pytest.fixture
def scene():
    """Image, mean, variance and known pixels of a scene of which part is lit, part in shadow, part hidden."""
    rng = np.random.default_rng(0)
    mean = rng.uniform(30, 220, (HEIGHT, WIDTH, 3)).astype(np.float32)
    kind = rng.integers(0, 3, (HEIGHT, WIDTH, 1))
    live = np.where(kind == 0, mean, np.where(kind == 1, 0.8 * mean, rng.uniform(0, 255, mean.shape)))
    live = np.clip(live + rng.normal(0, 6, mean.shape), 0, 255).astype(np.uint8)
    variance = rng.uniform(20, 300, (HEIGHT, WIDTH)).astype(np.float32)
    return live, mean, variance, (rng.random((HEIGHT, WIDTH)) < 0.8).astype(np.uint8)


@pytest.mark.parametrize("has_scene", [True, False])
def test_log_odds(scene, has_scene):
    live, mean, variance, known = scene
    pairs = np.random.default_rng(1).uniform(-20, -8, (16**3, 2)).astype(np.float32)
    options = np.array([SHADOW, OUTLIER, REACH, LOG_SHADOW], dtype=np.float32)
    out = np.empty((34, 59), dtype=np.float32)
    flat = live.reshape(HEIGHT, -1), (5, 3), mean.reshape(HEIGHT, -1)
    log_odds(*flat, variance, known, has_scene, SHIFT, pairs.ravel(), options, out)

    x, m, v = live[PART].astype(np.float64), mean[PART].astype(np.float64), variance[PART].astype(np.float64)
    bins = live[PART] >> SHIFT
    body, around = np.moveaxis(pairs[(bins[..., 0] * 16 + bins[..., 1].astype(int)) * 16 + bins[..., 2]], -1, 0)
    lit = -1.5 * np.log(2 * math.pi * v) - 0.5 * ((x - m) ** 2).sum(axis=2) / v
    gain = (x * m).sum(axis=2) / ((m * m).sum(axis=2) + 1)
    across = ((x - gain[..., None] * m) ** 2).sum(axis=2)
    shaded = np.where((gain > SHADOW) & (gain < 1), LOG_SHADOW - np.log(v) - 0.5 * across / v, -np.inf)
    background = np.maximum(np.maximum(lit, shaded), OUTLIER + around)
    background = np.where((known[PART] > 0) & has_scene, background, around)
    np.testing.assert_allclose(out, np.clip(body - background, -REACH, REACH), atol=2e-3)
    assert len(np.unique(np.sign(out))) >= 2


def test_update_scene(scene):
    live, mean, variance, known = scene
    body = (np.random.default_rng(2).random((34, 59)) < 0.4).astype(np.uint8)
    new_mean, new_variance, new_known = mean.copy(), variance.copy(), known.copy()
    rate, floor = np.float32(0.1), np.float32(36.0)
    update_scene(
        live.reshape(HEIGHT, -1), (5, 3), body, new_mean.reshape(HEIGHT, -1), new_variance, new_known, rate, floor
    )  # fmt: skip

    expected_mean, expected_variance, expected_known = mean.copy(), variance.copy(), known.copy()
    for v in range(3, 37):
        for u in range(5, 64):
            if body[v - 3, u - 5]:
                continue
            difference = live[v, u].astype(np.float32) - mean[v, u]
            total = float((difference**2).sum())
            if not known[v, u]:
                expected_known[v, u], expected_mean[v, u], expected_variance[v, u] = 1, live[v, u], 4 * floor
            elif total <= 36 * variance[v, u]:
                expected_mean[v, u] += rate * difference
                expected_variance[v, u] = max(floor, variance[v, u] + rate * (total / 3 - variance[v, u]))
    np.testing.assert_allclose(new_mean, expected_mean, rtol=1e-5)
    np.testing.assert_allclose(new_variance, expected_variance, rtol=1e-5)
    np.testing.assert_array_equal(new_known, expected_known)
    assert 0.1 < (new_mean != mean).mean() < 0.6


def test_images_of_any_layout_give_the_same(scene):
    live, mean, _, _ = scene
    model, colors = SceneModel.from_images([mean.astype(np.uint8)]), ColorModel()
    rgb = np.ascontiguousarray(live[:, :, ::-1])
    expected = body_log_odds(live, REGION, model, colors)
    np.testing.assert_array_equal(body_log_odds(rgb[:, :, ::-1], REGION, model, colors), expected)
    np.testing.assert_array_equal(body_log_odds(live, (0, 0, WIDTH, HEIGHT), model, colors)[PART], expected)
    assert (body_log_odds(live, REGION, None, colors) == 0).all()  # nothing known of either: even odds
    with pytest.raises(ValueError, match="expected a region"):
        body_log_odds(live, (0, 0, WIDTH + 1, HEIGHT), model, colors)
