"""Ray tables against the rays of the camera model."""

import gc
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES
from tracker_node.camera.model import CameraModel
from tracker_node.render.shape_arrays import MadeOnce, ray_table

K = np.array([[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]])
STRONG = {
    "barrel": CameraModel(321, 240, K, "plumb_bob", np.array([-0.45, 0.3, 0.003, -0.002, -0.1])),
    "pincushion": CameraModel(320, 240, K, "plumb_bob", np.array([0.4, 0.2, 0.0, 0.0, 0.0])),
    "rational": CameraModel(320, 240, K, "rational_polynomial", np.array([0.3, 0.1, 0.001, 0.0, 0.02, 0.5, 0.1, 0.01])),
    "fold": CameraModel(320, 240, 0.4 * K + np.diag([0, 0, 0.6]), "plumb_bob", np.array([-0.5, 0.0, 0.0, 0.0, 0.0])),
}


@pytest.mark.parametrize("name", [*LENSES, *STRONG])
def test_every_pixel_has_its_ray(name):
    model = {**LENSES, **STRONG}[name]
    table = ray_table(model)
    pixels = np.stack(np.meshgrid(np.arange(model.width), np.arange(model.height)), axis=-1)
    rays, valid = model.rays(pixels)
    expected = rays[..., :2] / rays[..., 2:]
    found = np.stack([table.xs, table.ys], axis=-1)[:, : model.width]
    np.testing.assert_allclose(found[valid], expected[valid], atol=1e-5, rtol=1e-5)
    assert np.isnan(found[~valid]).all()
    assert table.xs.shape[1] % 16 == 0
    assert np.isnan(table.xs[:, model.width :]).all()
    x0, y0, x1, y1 = table.limits
    inside = found[valid]
    assert (inside.min(axis=0) == [x0, y0]).all() and (inside.max(axis=0) == [x1, y1]).all()


def test_tables_are_made_once_and_die_with_their_lens():
    calls = []
    made_once = MadeOnce(lambda owner: calls.append(owner.width) or len(calls))
    model = CameraModel(20, 10, K)
    assert made_once(model) == made_once(model) == 1
    assert made_once(CameraModel(30, 10, K)) == 2
    del model
    calls_before, kept = len(calls), made_once._made
    gc.collect()
    assert not kept
    assert calls_before == 2


def test_what_several_threads_ask_for_at_once_is_made_once():
    made = []
    once = MadeOnce(lambda owner: made.append(time.sleep(0.05)) or len(made))
    model = CameraModel(32, 24, K)
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(once, 4 * [model])) == [1, 1, 1, 1]
