"""What the OpenGL renderer is given, without drawing: normals, light, windows."""

import numpy as np
import pytest

from tracker_node.synthesis.scenes.rasterizer import KEY_DIRECTION, LIGHTS, _looking_along, light_coordinates, vertex_normals


def test_the_key_light_is_the_first():
    """The strongest of all, and from above."""
    assert np.argmax([intensity for _, intensity in LIGHTS]) == 0
    assert np.linalg.norm(KEY_DIRECTION) == pytest.approx(1.0) and KEY_DIRECTION[2] < -0.8
    np.testing.assert_allclose(np.cross(KEY_DIRECTION, LIGHTS[0][0]), 0.0, atol=1e-12)


def test_all_lights_travel_downward_from_different_sides():
    ways = np.array([direction for direction, _ in LIGHTS])
    assert ways.shape == (3, 3) and np.all(ways[:, 2] < 0.0)
    assert len({tuple(np.sign(way[:2])) for way in ways}) == 3
    assert all(intensity > 0.0 for _, intensity in LIGHTS)


@pytest.mark.parametrize("way", [(1.0, 2.0, -3.0), (0.0, -2.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 2.0)])
def test_a_view_along_a_direction(way):
    pose = _looking_along(np.array(way))
    x, y, z = pose[:3, :3].T
    np.testing.assert_allclose(-z, np.array(way) / np.linalg.norm(way), atol=1e-12)
    np.testing.assert_allclose(np.cross(x, y), z, atol=1e-12)
    assert x[2] == pytest.approx(0.0) and np.linalg.norm(x) == pytest.approx(1.0) and y[2] >= -1e-12
    np.testing.assert_array_equal(pose[:, 3], [0.0, 0.0, 0.0, 1.0])


def test_normals_are_averaged_by_area():
    """A right angle between a face of area 1/2 and one of area 1 at the edge that they share."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2], [9, 9, 9]])
    normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 3, 1]]))
    np.testing.assert_allclose(normals[2], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(normals[3], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(normals[:2], np.tile(np.array([0.0, 2.0, 1.0]) / 5**0.5, (2, 1)))
    np.testing.assert_array_equal(normals[4], 0.0)  # of no face


def test_places_in_the_image_of_the_key_light():
    """Its middle is the center; half its size to the right of it is the border, above the middle is up."""
    pose, center = _looking_along(KEY_DIRECTION), np.array([1.0, 2.0, 3.0])
    points = np.stack([center, center + 2.0 * pose[:3, 0], center + 1.0 * pose[:3, 1], center + 5.0 * KEY_DIRECTION])
    found = light_coordinates(points, center, 2.0, 100)
    np.testing.assert_allclose(found, [[49.5, 49.5], [99.5, 49.5], [49.5, 24.5], [49.5, 49.5]], atol=1e-9)
