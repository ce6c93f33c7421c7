"""Boxes around shapes, and the part of an image that a body can be seen in."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.render.raycast.extent import body_extent, corners_in_camera
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.synthesis.scenes.scene import looking_at

LENS = CameraModel(320, 240, np.array([[200.0, 0.0, 159.5], [0.0, 200.0, 119.5], [0.0, 0.0, 1.0]]))
CAMERA = Camera("a", LENS, np.eye(4))  # the world is the camera's frame
WHOLE = (0, 0, 320, 240)


def body(primitive, at=(0.0, 0.0, 0.0)):
    T = np.eye(4)
    T[:3, 3] = at
    model = ArticulatedModel("one", KinematicChain(("base",), ()), (Shape("s", "base", primitive, T),))
    return Configuration(model, State.neutral(model))


@pytest.mark.parametrize(
    ("primitive", "low", "high"),
    [
        (Ellipsoid((1.0, 2.0, 3.0)), (-1, -2, -3), (1, 2, 3)), (Box((1.0, 2.0, 3.0)), (-0.5, -1, -1.5), (0.5, 1, 1.5)),
        (TruncatedCone(0.5, 0.4, 0.5, -1.0, 2.0), (-1.0, -0.8, -1.0), (1.0, 0.8, 2.0)),
        (TruncatedCone(0.5, 0.4, -0.5, -1.0, 1.0), (-0.75, -0.6, -1.0), (0.75, 0.6, 1.0)),
        (Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]]), np.array([[0, 1, 2], [0, 2, 3]])), (0, 0, 0), (1, 2, 3)),
    ],
)  # fmt: skip
def test_boxes_hold_their_shapes_and_hardly_more(primitive, low, high):
    corners = corners_in_camera(body(primitive), CAMERA)[0]
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    grown = 0.0005 * (high - low)
    np.testing.assert_allclose(corners.min(axis=0), low - grown, atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), high + grown, atol=1e-12)
    assert len(np.unique(np.round(corners, 9), axis=0)) == 8


def test_corners_are_in_the_camera_s_frame():
    camera = Camera("a", LENS, looking_at(np.array([0.0, -4.0, 1.0]), np.array([0.0, 0.0, 1.0])))
    corners = corners_in_camera(body(Box((0.2, 0.4, 0.6)), (0.5, 0.0, 1.3)), camera)[0]
    np.testing.assert_allclose(corners.mean(axis=0), [0.5, -0.3, 4.0], atol=1e-12)
    np.testing.assert_allclose(np.ptp(corners, axis=0), np.array([0.2, 0.6, 0.4]) * 1.001, atol=1e-12)


def test_the_extent_holds_the_body_and_little_more():
    configuration = body(Box((0.4, 0.2, 0.2)), (0.3, -0.1, 2.0))
    u0, v0, u1, v1 = body_extent(configuration, CAMERA, WHOLE)
    rows, columns = np.nonzero(render_mask(configuration, CAMERA))
    assert u0 <= columns.min()
    assert v0 <= rows.min()
    assert u1 > columns.max()
    assert v1 > rows.max()
    assert columns.min() - u0 <= 3
    assert u1 - columns.max() <= 4
    assert rows.min() - v0 <= 3
    assert v1 - rows.max() <= 4


def test_the_extent_is_within_the_region():
    configuration = body(Box((0.4, 0.2, 0.2)), (0.3, -0.1, 2.0))
    whole = body_extent(configuration, CAMERA, WHOLE)
    region = (whole[0] + 5, whole[1] + 4, whole[2] - 3, whole[3] - 2)
    assert body_extent(configuration, CAMERA, region) == region
    assert body_extent(configuration, CAMERA, (0, 0, 50, 240)) is None
    assert body_extent(configuration, CAMERA, (0, 0, 320, 20)) is None


def test_a_body_behind_the_camera_has_none():
    assert body_extent(body(Box((0.4, 0.2, 0.2)), (0.0, 0.0, -2.0)), CAMERA, WHOLE) is None


def test_a_body_around_the_camera_may_be_anywhere():
    assert body_extent(body(Box((0.4, 0.2, 3.0)), (0.0, 0.0, 1.0)), CAMERA, WHOLE) == WHOLE


def test_shapes_behind_do_not_count():
    model = crane()
    one = body(Box((0.2, 0.2, 0.2)), (0.0, 0.0, 2.0))
    behind = np.eye(4)
    behind[:3, 3] = 0.5, 0.0, -3.0
    two = ArticulatedModel("two", KinematicChain(("base",), ()), (*one.model.shapes, Shape("t", "base", Box((1, 1, 1)), behind)))
    assert body_extent(Configuration(two, State.neutral(two)), CAMERA, WHOLE) == body_extent(one, CAMERA, WHOLE)
    assert len(corners_in_camera(Configuration(model, State.neutral(model)), CAMERA)) == len(model.shapes)
