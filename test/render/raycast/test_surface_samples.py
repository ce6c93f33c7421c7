"""Points of a body that a camera sees: where they are, how they are turned, and those near a border left out."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.render.raycast.surface_samples import surface_samples
from tracker_node.synthesis.scenes.scene import looking_at

LENS = CameraModel(160, 120, np.array([[120.0, 0.0, 79.5], [0.0, 120.0, 59.5], [0.0, 0.0, 1.0]]))
CAMERA = Camera("a", LENS, looking_at(np.array([0.3, -3.0, 1.2]), np.array([0.0, 0.0, 1.0])))
MIDDLE = np.array([0.1, 0.0, 1.0])
RADII = np.array([0.5, 0.4, 0.6])


def body(*primitives, apart=0.0):
    shapes = []
    for i, primitive in enumerate(primitives):
        T = np.eye(4)
        T[:3, 3] = MIDDLE + np.array([apart * i, 0.0, 0.0])
        shapes.append(Shape(f"s{i}", "base", primitive, T, (10 + 40 * i, 120, 230)))
    model = ArticulatedModel("m", KinematicChain(("base",), ()), tuple(shapes))
    return Configuration(model, State.neutral(model))


@pytest.fixture(scope="module")
def ellipsoid():
    configuration = body(Ellipsoid(tuple(RADII)))
    return configuration, surface_samples(configuration, CAMERA)


def test_every_pixel_of_the_mask_is_a_sample(ellipsoid):
    configuration, samples = ellipsoid
    seen = np.zeros((120, 160), dtype=bool)
    seen[samples.pixels[:, 1], samples.pixels[:, 0]] = True
    np.testing.assert_array_equal(seen, render_mask(configuration, CAMERA) > 0)
    assert set(samples.shapes) == {0}
    np.testing.assert_allclose(samples.colors_rgb, np.tile([10.0, 120.0, 230.0], (len(samples.pixels), 1)), atol=0.5)


def test_points_lie_on_the_surface_where_their_pixels_are(ellipsoid):
    _, samples = ellipsoid
    np.testing.assert_allclose((((samples.points - MIDDLE) / RADII) ** 2).sum(axis=1), 1.0, atol=2e-3)
    np.testing.assert_allclose(CAMERA.project(samples.points)[0], samples.pixels, atol=1e-2)


def test_normals_are_of_unit_length_and_point_outwards(ellipsoid):
    _, samples = ellipsoid
    expected = (samples.points - MIDDLE) / RADII**2
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(np.linalg.norm(samples.normals, axis=1), 1.0, atol=1e-4)
    np.testing.assert_allclose(samples.normals, expected, atol=2e-3)


@pytest.mark.parametrize("rim", [1, 3])
def test_pixels_near_the_background_are_left_out(ellipsoid, rim):
    configuration, _ = ellipsoid
    mask = render_mask(configuration, CAMERA) > 0
    for u, v in surface_samples(configuration, CAMERA, rim).pixels:
        assert mask[v - rim : v + rim + 1 : rim, u - rim : u + rim + 1 : rim].all()
    assert 0 < len(surface_samples(configuration, CAMERA, rim).pixels) < mask.sum()


def test_pixels_near_another_shape_are_left_out():
    configuration = body(Ellipsoid(tuple(RADII)), Ellipsoid((0.3, 0.5, 0.3)), apart=0.25)
    labels = np.zeros((120, 160), dtype=int)
    whole = surface_samples(configuration, CAMERA)
    labels[whole.pixels[:, 1], whole.pixels[:, 0]] = whole.shapes + 1
    inner = surface_samples(configuration, CAMERA, 2)
    assert set(inner.shapes) == {0, 1}
    for (u, v), shape in zip(inner.pixels, inner.shapes, strict=True):
        assert (labels[v - 2 : v + 3 : 2, u - 2 : u + 3 : 2] == shape + 1).all()


def test_pixels_near_an_edge_of_a_box_are_left_out():
    """Of a box that shows two faces all rows have pixels of both, and none that has the other beside it."""
    configuration = body(Box((0.8, 0.8, 0.8)))
    aside = Camera("a", LENS, looking_at(np.array([2.0, -2.5, 1.2]), np.array([0.0, 0.0, 1.0])))
    inner = surface_samples(configuration, aside, 2)
    faces = np.argmax(np.abs(inner.normals), axis=1)
    at = {tuple(pixel): face for pixel, face in zip(inner.pixels.tolist(), faces, strict=True)}
    assert len(set(faces)) >= 2
    for (u, v), face in at.items():
        for other in ((u + 2, v), (u, v + 2), (u + 2, v + 2), (u - 2, v + 2)):
            assert at.get(other, face) == face


def test_a_body_out_of_sight_has_none():
    configuration = body(Ellipsoid((0.1, 0.1, 0.1)))
    away = Camera("a", LENS, looking_at(np.array([0.0, -3.0, 1.0]), np.array([0.0, -6.0, 1.0])))
    assert len(surface_samples(configuration, away).pixels) == 0
