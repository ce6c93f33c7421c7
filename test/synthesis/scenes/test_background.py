"""Pictures of things that stand about: the same for a seed, since published figures are of these, and without strong yellows."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.synthesis.scenes.scene import meshes, patches

CAMERAS = [replace(camera, model=camera.model.resized(120, 90)) for camera in circle_rig(2)]


@pytest.mark.parametrize(
    ("camera", "mean", "spread", "pixels"),
    [
        (0, (116.85, 131.26, 140.78), (47.03, 49.83, 47.25), {(10, 10): (128, 144, 152), (45, 60): (117, 164, 162)}),
        (1, (97.83, 108.66, 110.72), (50.62, 53.58, 57.8), {(80, 100): (37, 55, 30), (70, 20): (84, 84, 84)}),
    ],
)
def test_a_seed_and_a_camera_have_one_picture(camera, mean, spread, pixels):
    picture = cluttered_background(CAMERAS[camera], 3).astype(float)
    assert picture.shape == (90, 120, 3)
    np.testing.assert_allclose(picture.mean(axis=(0, 1)), mean, atol=0.1)
    np.testing.assert_allclose(picture.std(axis=(0, 1)), spread, atol=0.1)
    for place, color in pixels.items():
        np.testing.assert_allclose(picture[place], color, atol=1.5)


def test_another_seed_has_another():
    assert np.abs(cluttered_background(CAMERAS[0], 4).astype(float) - cluttered_background(CAMERAS[0], 3)).mean() > 10.0


@pytest.mark.parametrize("seed", range(3))
def test_no_yellow_is_strong(seed):
    hue, saturation, _ = np.moveaxis(cv2.cvtColor(cluttered_background(CAMERAS[0], seed), cv2.COLOR_BGR2HSV), 2, 0)
    yellow = (hue > 22) & (hue < 30)
    assert not yellow.any() or saturation[yellow].max() <= 115


def test_patches_are_the_same_for_a_seed():
    """Ninety texels a meter."""
    texture = patches(np.random.default_rng(5), 2.0, 1.0).astype(float)
    assert texture.shape == (90, 180, 3)
    np.testing.assert_allclose(texture.mean(axis=(0, 1)), (100.27, 113.13, 121.91), atol=0.1)
    np.testing.assert_allclose(texture.std(axis=(0, 1)), (40.27, 42.79, 45.63), atol=0.1)
    for place, color in {(3, 3): (128, 64, 89), (20, 40): (84, 113, 116), (30, 70): (82, 112, 115)}.items():
        np.testing.assert_allclose(texture[place], color, atol=1.5)


def test_a_room_has_six_sides_that_look_inwards():
    middle = np.mean([mesh.vertices.mean(axis=0) for mesh in meshes(2)], axis=0)
    sides = meshes(2)
    assert len(sides) == 6
    assert middle[:2] == pytest.approx([0.0, 0.0])
    for side in sides:
        corners = side.vertices[np.asarray(side.faces)]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.all(normals @ (middle - side.vertices.mean(axis=0)) > 0.0)
    floor, ceiling = sides[0].vertices, sides[1].vertices
    assert not floor[:, 2].any()
    assert np.ptp(ceiling[:, 2]) == 0.0
    assert np.ptp(floor[:, 0]) == np.ptp(floor[:, 1]) == np.ptp(ceiling[:, 0])
    for wall in sides[2:]:
        assert sorted(set(wall.vertices[:, 2])) == [0.0, ceiling[0, 2]]
