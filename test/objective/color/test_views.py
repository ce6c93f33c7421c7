"""Thinned and lying cameras, and where their rays and pixels are put."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.objective.color import drawing as kernel
from tracker_node.objective.color.views import EXCHANGE, ColorViews, every_nth, is_pinhole, lying

K = np.array([[100.0, 0.0, 20.5], [0.0, 80.0, 10.25], [0.0, 0.0, 1.0]])
SKEWED = K + np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
BENT = CameraModel(41, 21, K, "plumb_bob", np.array([-0.1, 0.0, 0.0, 0.0, 0.0]))
PLAIN, SKEW, LENS = (Camera(name, model, np.eye(4)) for name, model in
                     (("plain", CameraModel(41, 21, K)), ("skew", CameraModel(40, 20, SKEWED)), ("lens", BENT)))  # fmt: skip


def test_rays_are_linear_without_skew_and_distortion_only():
    assert is_pinhole(PLAIN) and not is_pinhole(SKEW) and not is_pinhole(LENS)


@pytest.mark.parametrize(("columns", "rows", "size"), [(2, 1, (21, 21)), (3, 2, (14, 11)), (1, 4, (41, 6))])
def test_every_nth_column_and_row_from_the_first_on(columns, rows, size):
    (thin,) = every_nth(CameraRig((PLAIN,)), columns, rows)
    assert (thin.model.width, thin.model.height) == size
    point = np.array([[0.1, 0.2, 1.0]])
    np.testing.assert_allclose(thin.model.project(point)[0] * [columns, rows], PLAIN.model.project(point)[0])
    assert [camera.model.height for camera in every_nth(CameraRig((PLAIN,)), 2)] == [21]


def test_a_lying_camera_has_rows_and_columns_exchanged():
    point = np.array([[0.1, 0.2, 1.5]])
    turned = lying(PLAIN)
    assert (turned.model.width, turned.model.height) == (21, 41)
    np.testing.assert_allclose(turned.model.project(point @ EXCHANGE[:3, :3].T)[0][:, ::-1], PLAIN.model.project(point)[0])


def test_pixels_and_rays_of_each_camera():
    views = ColorViews([PLAIN, LENS, SKEW])
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (c.model.height, c.model.width, 3), dtype=np.uint8) for c in (PLAIN, LENS, SKEW)]
    views.fill([images[0], None, images[2]])
    for i, camera in enumerate((PLAIN, LENS, SKEW)):
        view, width, height = views.views[i], camera.model.width, camera.model.height
        assert (view[kernel.WIDTH], view[kernel.HEIGHT], view[kernel.DISTORTED]) == (width, height, i > 0)
        for channel in range(3):
            expected = images[i][:, :, 2 - channel] if i != 1 else np.zeros((height, width))
            np.testing.assert_array_equal(views.plane(view, channel), expected)
        start, across = int(view[kernel.XS]), width + kernel.LANES
        if i == 0:
            xs = views.rays[start : start + across]
            ys = views.rays[view[kernel.YS] : view[kernel.YS] + height * kernel.LANES].reshape(height, kernel.LANES)
            np.testing.assert_allclose(xs[:width], (np.arange(41) - 20.5) / 100.0, atol=1e-6)
            np.testing.assert_allclose(ys, np.tile(((np.arange(21) - 10.25) / 80.0)[:, None], (1, kernel.LANES)), atol=1e-6)
            assert np.isnan(xs[width:]).all()
            continue
        xs = views.rays[start : start + across * height].reshape(height, across)
        ys = views.rays[view[kernel.YS] : view[kernel.YS] + across * height].reshape(height, across)
        assert np.isnan(xs[:, width:]).all() and np.isnan(ys[:, width:]).all()
        rays = np.stack([xs[:, :width], ys[:, :width], np.ones((height, width))], axis=-1).reshape(-1, 3).astype(float)
        pixels = camera.model.project(rays)[0].reshape(height, width, 2)
        np.testing.assert_allclose(pixels, np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1), atol=0.01)
    assert len(views.planes) == 3 * (2 * 41 * 21 + 40 * 20) + kernel.LANES
    np.testing.assert_array_equal(views.params[2], SKEW.model.params)
    assert views.limits.shape == (3, 4)
    np.testing.assert_allclose(views.limits[0], [-0.205, -0.128125, 0.195, 0.121875], atol=1e-6)
