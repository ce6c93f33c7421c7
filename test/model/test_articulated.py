"""A body's tables, colors, landmarks and capsules."""

import numpy as np
import pytest

from helpers.bodies.two_links import two_links
from tracker_node.errors import UnknownNameError
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.shapes.capsules import inner_capsules
from tracker_node.model.shapes.primitives import Ellipsoid, Mesh, TruncatedCone

CHAIN = two_links().chain
TURN = np.array([[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
BALL, TUBE = Ellipsoid((0.1, 0.1, 0.1)), TruncatedCone(0.1, 0.1, 0.0, 0.0, 1.0)


def body(*shapes: Shape, landmarks: tuple[Landmark, ...] = ()) -> ArticulatedModel:
    return ArticulatedModel("body", CHAIN, shapes, landmarks)


def test_tables():
    model = body(
        Shape("a", "lower", BALL, TURN), Shape("b", "upper", TUBE), landmarks=(Landmark("tip", "lower", (1.0, 2.0, 3.0)),)
    )
    assert model.shape_links.tolist() == [1, 0] and model.shape_links.dtype == np.int64
    assert np.array_equal(model.Ts_link_shape, [TURN, np.eye(4)])
    assert model.landmark_links.tolist() == [1] and model.landmark_positions.tolist() == [[1.0, 2.0, 3.0]]
    assert model.landmark_names == ("tip",) and model.landmark_index("tip") == 0
    assert model.n_dof == 6 + 2
    with pytest.raises(UnknownNameError, match="unknown landmark 'top'; valid: tip"):
        model.landmark_index("top")
    empty = body()
    assert empty.Ts_link_shape.shape == (0, 4, 4) and empty.landmark_positions.shape == (0, 3)


def test_landmarks_are_found_by_name():
    marks = tuple(Landmark(name, "upper", (0.0, 0.0, 0.0)) for name in "abc")
    assert [body(landmarks=marks).landmark_index(name) for name in "cab"] == [2, 0, 1]


def test_shapes_are_fixed_rigidly():
    bad = np.eye(4)
    bad[0, 0] = 2.0
    with pytest.raises(ValueError, match="shape 'a': expected a rigid T_link_shape"):
        Shape("a", "upper", BALL, bad)


def test_gray_is_no_stated_color():
    assert not Shape("a", "upper", BALL).has_color and not Shape("a", "upper", BALL, color_rgb=(180, 180, 180)).has_color
    assert Shape("a", "upper", BALL, color_rgb=(180, 180, 181)).has_color
    vertices, faces = (
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
    )
    assert not Shape("a", "upper", Mesh(vertices, faces)).has_color
    painted = Mesh(vertices, faces, face_colors_rgb=np.zeros((4, 3), np.uint8))
    assert Shape("a", "upper", painted).has_color
    assert body(Shape("a", "upper", BALL), Shape("b", "upper", BALL, color_rgb=(1, 2, 3))).has_colors
    assert not body(Shape("a", "upper", BALL)).has_colors and not body().has_colors


def test_capsules_stand_in_the_frame_of_the_link():
    """A quarter turn about z, and then 1, 2, 3 meters on: (x, y, z) comes to (1 - y, 2 + x, 3 + z)."""
    own = inner_capsules(TUBE)
    plain, turned = body(Shape("a", "upper", TUBE), Shape("b", "lower", TUBE, TURN)).capsules
    assert np.array_equal(plain, own) and turned.shape == own.shape
    for at in (0, 4):
        x, y, z = own[:, at : at + 3].T
        assert turned[:, at : at + 3] == pytest.approx(np.column_stack([1.0 - y, 2.0 + x, 3.0 + z]))
    assert np.array_equal(turned[:, [3, 7]], own[:, [3, 7]])
    assert se3.is_rigid(TURN)
