"""Colors learnt from images: what was painted is what is learnt, whatever the light; and what cannot be seen is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from helpers.numeric.naive import render_color
from tracker_node.camera.light import Light
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import ModelError
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.shapes.primitives import Box
from tracker_node.tracking.color.modality import PartColors, check_colors

LIGHTS = (Light("ambient", (0.3, 0.3, 0.3)), Light("directional", (0.5, 0.5, 0.5), direction=(0.5, 1.0, -1.0)))
RIG = CameraRig(tuple(replace(camera, model=camera.model.resized(320, 240)) for camera in cameras()), lights=LIGHTS)
PLAIN = two_links()
PAINTED = np.array([(200, 60, 40), (40, 90, 210), (60, 200, 80)], dtype=float)
STATE = State.neutral(PLAIN).retract(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0]))


def painted(colors):
    shapes = zip(PLAIN.shapes, colors, strict=True)
    return replace(PLAIN, shapes=tuple(replace(s, color_rgb=tuple(int(v) for v in c)) for s, c in shapes))


def picture(camera, colors=PAINTED) -> np.ndarray:
    """By brute force, with the light of the scene."""
    labels, _, rgb = render_color(Configuration(painted(colors), STATE), camera, LIGHTS)
    return np.rint(np.where(labels[:, :, None] > 0, rgb, 128.0)[:, :, ::-1]).astype(np.uint8)


def test_what_was_painted_is_learnt_without_the_light():
    colors = PartColors(PLAIN, RIG)
    colors.learn([picture(camera) for camera in RIG], STATE, 1.0)
    np.testing.assert_allclose(colors.rgb, np.tile(PAINTED, (2, 1, 1)), atol=3.0)


def test_a_camera_that_shows_nothing_gets_the_colors_of_the_others():
    colors = PartColors(PLAIN, RIG)
    colors.learn([picture(RIG.cameras[0]), None], STATE, 1.0)
    np.testing.assert_allclose(colors.rgb, np.tile(PAINTED, (2, 1, 1)), atol=3.0)
    other = PartColors(PLAIN, RIG)
    other.learn([None, None], STATE, 1.0)
    np.testing.assert_array_equal(other.rgb, 180.0)


def test_colors_follow_by_their_share_where_they_are_seen():
    colors = PartColors(painted(PAINTED), RIG)
    colors.learn([picture(RIG.cameras[0], PAINTED[::-1]), None], STATE, 0.25)
    np.testing.assert_allclose(colors.rgb[0], 0.75 * PAINTED + 0.25 * PAINTED[::-1], atol=2.0)
    np.testing.assert_array_equal(colors.rgb[1], PAINTED)


def test_links_of_one_cloth_are_not_told_from_each_other():
    """The root mean square over channels counts: 60 levels in one of three are 35."""
    near, far = PartColors(painted([(200, 60, 40), (200, 80, 40), (200, 80, 40)]), RIG), PartColors(painted(PAINTED), RIG)
    assert far.distinct_links(55.0).all() and far.distinct_links(30.0).all()
    assert not near.distinct_links(30.0).any() and near.distinct_links(0.0).all()
    assert PartColors(painted([(200, 60, 40), (200, 60, 100), (200, 60, 100)]), RIG).distinct_links(30.0).sum() == 2


def test_a_model_has_colors_if_one_shape_has():
    with pytest.raises(ModelError, match=r"model 'arm' has no colors: expected color_rgb of its shapes, or the parameter"):
        check_colors(PLAIN)
    check_colors(painted([(180, 180, 180), (180, 180, 180), (181, 180, 180)]))
    box = Box((0.1, 0.1, 0.1), face_colors_rgb=np.zeros((6, 3)))
    check_colors(replace(PLAIN, shapes=(replace(PLAIN.shapes[0], primitive=box),)))
