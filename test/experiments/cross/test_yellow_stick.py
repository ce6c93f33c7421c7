"""The yellow cross: two prisms, four unequal arms, and a pose that no turn repeats."""

import itertools

import numpy as np

from tracker_node.experiments.cross.throw import yellow_stick
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.shapes.primitives import Box

MODEL = yellow_stick()


def corners(model):
    """(2, 8, 3) corners of both prisms in the frame of the cross."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    Ts = Configuration(model, State.neutral(model)).Ts_world_shape
    return np.array([signs * s.primitive.size @ T[:3, :3].T + T[:3, 3] for s, T in zip(model.shapes, Ts, strict=True)])


def test_two_prisms_cross_at_the_origin():
    assert [type(shape.primitive) for shape in MODEL.shapes] == [Box, Box]
    assert MODEL.n_dof == 6
    for prism in corners(MODEL):
        assert np.all(prism.min(axis=0) < 0.0)
        assert np.all(prism.max(axis=0) > 0.0)
    assert np.isclose(np.ptp(corners(MODEL).reshape(-1, 3), axis=0).max(), 1.0)


def test_landmarks_are_the_ends_of_the_arms():
    marks = dict(zip(MODEL.landmark_names, MODEL.landmark_positions, strict=True))
    points = corners(MODEL)
    assert np.isclose(marks["top"][2], points[0, :, 2].max())
    assert np.isclose(marks["bottom"][2], points[0, :, 2].min())
    assert np.isclose(marks["left_end"][1], points[1, :, 1].max())
    assert np.isclose(marks["right_end"][1], points[1, :, 1].min())
    arms = sorted(np.linalg.norm(marks[name]) for name in ("top", "bottom", "left_end", "right_end"))
    assert np.diff(arms).min() > 0.015


def test_no_turn_maps_the_cross_onto_itself():
    """All 23 turns of a cube, about the origin and about the middle of the cross."""
    points = corners(MODEL).reshape(-1, 3)
    turns = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in itertools.permutations(range(3)) for signs in itertools.product((1, -1), repeat=3)
    ]  # fmt: skip
    turns = [turn for turn in turns if np.linalg.det(turn) > 0.0 and not np.array_equal(turn, np.eye(3))]
    assert len(turns) == 23
    for turn in turns:
        for middle in (np.zeros(3), 0.5 * (points.min(axis=0) + points.max(axis=0))):
            turned = (points - middle) @ turn.T + middle
            assert max(np.linalg.norm(points - p, axis=1).min() for p in turned) > 0.02


def test_the_file_that_comes_with_the_package_is_this_cross(repository):
    shipped = load_model(repository / "config" / "models" / "yellow_stick.yaml")
    assert (shipped.name, shipped.landmarks) == (MODEL.name, MODEL.landmarks)
    assert np.allclose(shipped.Ts_link_shape, MODEL.Ts_link_shape, atol=1e-12)
    assert [(s.name, s.primitive, s.color_rgb) for s in shipped.shapes] == [
        (s.name, s.primitive, s.color_rgb) for s in MODEL.shapes
    ]
    r, g, b = MODEL.shapes[0].color_rgb
    assert min(r, g) > 200 > 60 > b  # bright yellow
    assert MODEL.has_colors
