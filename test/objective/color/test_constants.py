"""What color kernels take of lights and cameras."""

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from tracker_node.camera.light import COS_OUTER, DIRECTIONAL, KIND, POINT, SPOT, Light
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.shapes.primitives import Box
from tracker_node.objective.color.views import ColorConstants

SUN = Light("directional", (0.5, 0.5, 0.5), direction=(0, 0, -1))
SPOTLIGHT = Light("spot", (0.5, 0.5, 0.5), (0, 0, 3), (0, 0, -1), 0.5)
BULB = Light("point", (0.5, 0.5, 0.5), (0, 0, 3))
HAZE = Light("ambient", (0.2, 0.3, 0.4))


def rig(*lights, gain=(1.0, 1.0, 1.0), gamma=1.0):
    answering = tuple(Camera(c.name, c.model, c.T_world_cam, gain=gain, gamma=gamma) for c in cameras())
    return CameraRig(answering, lights=lights)


def constants(*lights, representation="raw", weight=0.5, colors=None, model=None, **camera):
    return ColorConstants(model or two_links(), rig(*lights, **camera), representation, weight, colors)


@pytest.mark.parametrize(
    ("representation", "weights"), [("raw", (1.0, 0.0)), ("normalized", (0.0, 1.0)), ("blend", (0.7, 0.3))]
)
def test_weights_of_both_differences(representation, weights):
    assert constants(representation=representation, weight=0.3).weights == pytest.approx(weights)


def test_other_representations_are_refused():
    with pytest.raises(ValueError, match="expected a representation"):
        constants(representation="gray")


def test_lights_with_a_direction_come_after_suns():
    found = constants(SPOTLIGHT, HAZE, BULB, SUN)
    assert found.directed[:, KIND].tolist() == [DIRECTIONAL, SPOT, POINT]
    assert (found.n_directional, found.n_spots) == (1, 2)
    assert found.directed[1, COS_OUTER] == pytest.approx(np.cos(0.5))
    assert found.directed[2, COS_OUTER] < -1.0  # a bulb shines everywhere
    assert len(found.lights) == 4


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_light_from_everywhere_adds_up(gamma):
    found = constants(HAZE, HAZE, gain=(2.0, 1.0, 0.5), gamma=gamma)
    assert found.base.shape == (2, 4)
    assert found.base[0] == pytest.approx([*(np.array([0.8, 0.6, 0.4]) ** (1.0 / gamma)), 1.0 / gamma], rel=1e-6)
    assert (found.bent, found.vectorized, len(found.directed)) == (False, True, 0)


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_gamma_bends_what_suns_add(gamma):
    found = constants(HAZE, SUN, gain=(2.0, 1.0, 0.5), gamma=gamma)
    assert found.base[1] == pytest.approx([0.4, 0.3, 0.2, 1.0 / gamma], rel=1e-6)  # not bent before the sun is added
    assert found.bent == (gamma != 1.0)
    assert found.vectorized == (gamma == 1.0)


def test_without_lights_colors_are_as_stated():
    assert constants().base[0] == pytest.approx([1.0, 1.0, 1.0, 1.0])


def test_white_light_cancels_in_normalized_colors():
    found = constants(SUN, Light("ambient", (0.3, 0.3, 0.3)), representation="normalized")
    assert len(found.directed) == 0
    assert found.base[0] == pytest.approx([1.0, 1.0, 1.0, 1.0])
    assert len(constants(SUN, representation="blend").directed) == 1
    assert len(constants(SUN, HAZE, representation="normalized").directed) == 1  # tinted


def test_bodies_with_boxes_are_not_smooth():
    arm = two_links()
    box = ArticulatedModel("box", arm.chain, (*arm.shapes[:2], type(arm.shapes[0])("box", "lower", Box((0.1, 0.1, 0.1)))))
    assert constants().smooth
    found = constants(model=box)
    assert not found.smooth
    assert not found.vectorized


def test_colors_are_the_model_s_or_given():
    found = constants()
    assert found.colors_rgb.shape == (2, 3, 3)
    assert np.array_equal(found.colors_rgb[1], [shape.color_rgb for shape in two_links().shapes])
    assert not found.recolored
    colors = np.arange(18.0).reshape(2, 3, 3)
    found = constants(colors=colors)
    assert found.recolored
    assert np.array_equal(found.colors_rgb, colors)
    colors[:] = 0.0
    assert found.colors_rgb.any()
    with pytest.raises(ValueError, match="one of each shape by camera"):
        constants(colors=colors[:1])
    found.set_colors(two_links(), rig(), None)
    assert not found.recolored
