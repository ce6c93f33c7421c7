"""Cameras and images made small and straight."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.observation.small_view import SmallView

K = np.array([[200.0, 0.0, 99.5], [0.0, 210.0, 59.5], [0.0, 0.0, 1.0]])


def camera(model="none", distortion=()):
    return Camera("a", CameraModel(200, 120, K, model, np.array(distortion)), np.eye(4))


def test_the_small_camera_sees_the_same_in_fewer_pixels():
    small = SmallView(camera(), 0.25).camera
    assert (small.model.width, small.model.height) == (50, 30)
    point = np.array([0.3, -0.2, 2.0])
    large, little = camera().project(point)[0], small.project(point)[0]
    np.testing.assert_allclose(little, (large + 0.5) * 0.25 - 0.5)  # edges of images lie on each other
    assert small.name == "a"


@pytest.mark.parametrize(("scale", "size"), [(0.05, (10, 8)), (0.03, (8, 8)), (0.1, (20, 12))])
def test_no_side_is_below_eight_pixels(scale, size):
    view = SmallView(camera(), scale)
    assert (view.camera.model.width, view.camera.model.height) == size
    assert view.shrink(np.zeros((120, 200, 3), np.uint8)).shape == (size[1], size[0], 3)


def test_without_distortion_images_are_averaged():
    image = np.random.default_rng(0).integers(0, 256, (120, 200, 3), dtype=np.uint8)
    expected = image.reshape(30, 4, 50, 4, 3).mean(axis=(1, 3))
    assert np.abs(SmallView(camera(), 0.25).shrink(image) - expected).max() <= 0.51


@pytest.mark.parametrize("distortion", [(-0.3, 0.1, 0.002, -0.001, 0.0), (0.2, 0.0, 0.0, 0.0, 0.0)])
def test_bent_images_are_made_straight(distortion):
    """A dot of the large image lies where the small, straight camera sees its place."""
    bent = camera("plumb_bob", distortion)
    view = SmallView(bent, 0.5)
    assert not np.any(view.camera.model.distortion)
    for point in ([0.5, 0.3, 2.0], [-0.6, -0.25, 2.0]):
        image = np.zeros((120, 200, 3), np.uint8)
        u, v = bent.project(np.array(point))[0]
        cv2.circle(image, (round(u), round(v)), 4, (255, 255, 255), -1)
        small = view.shrink(image)[..., 0].astype(float)
        rows, columns = np.indices(small.shape)
        middle = np.array([(columns * small).sum(), (rows * small).sum()]) / small.sum()
        np.testing.assert_allclose(middle, view.camera.project(np.array(point))[0], atol=0.5)


def test_a_fisheye_stays_bent():
    lens = replace(camera().model, distortion_model="equidistant", distortion=np.array([0.05, -0.01, 0.0, 0.0]))
    small = SmallView(Camera("a", lens, np.eye(4)), 0.5).camera.model
    assert small.distortion_model == "equidistant"
    np.testing.assert_array_equal(small.distortion, lens.distortion)
