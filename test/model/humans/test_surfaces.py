"""Where surfaces of clothed people are beside the human's shapes."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.model.clothes import _OF_OTHERS, _SURFACES, expected_surfaces
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.humans.measures import mirrored_name

HUMAN = human_model()
MEANS, SIGMAS = expected_surfaces(HUMAN)
ROWS = {shape.name: i for i, shape in enumerate(HUMAN.shapes)}


def test_every_part_of_the_human_has_its_own():
    assert MEANS.shape == SIGMAS.shape == (len(HUMAN.shapes), 4)
    names = {shape.name for body in (HUMAN, gait_human()) for shape in body.shapes}
    assert {name.split("_", 1)[1] if name.startswith(("left_", "right_")) else name for name in names} == set(_SURFACES)
    for name, part in (("torso", "torso"), ("left_upper_arm", "upper_arm"), ("left_foot", "foot"), ("head", "head")):
        np.testing.assert_array_equal([MEANS[ROWS[name]], SIGMAS[ROWS[name]]], _SURFACES[part])


@pytest.mark.parametrize("name", [name for name in ROWS if name.startswith("left_")])
def test_the_sides_are_mirror_images(name):
    left, right = ROWS[name], ROWS[mirrored_name(name)]
    np.testing.assert_array_equal(MEANS[left] * [1.0, 1.0, -1.0, 1.0], MEANS[right])
    np.testing.assert_array_equal(SIGMAS[left], SIGMAS[right])


def test_they_are_centimeters_and_those_of_the_middle_not_aside():
    assert (np.abs(MEANS) < 0.05).all() and (SIGMAS > 0.005).all() and (SIGMAS < 0.04).all()
    middle = [i for name, i in ROWS.items() if not name.startswith(("left_", "right_"))]
    assert (MEANS[middle, 2] == 0.0).all() and (MEANS[:, 0] > -0.005).all()  # clothes are outside


def test_parts_of_other_bodies_have_those_of_others():
    means, sigmas = expected_surfaces(crane())
    assert (means == _OF_OTHERS[0]).all() and (sigmas == _OF_OTHERS[1]).all() and len(means) == 5
