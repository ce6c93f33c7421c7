"""The grid that a start is looked for in: fine for a room, never more than a machine can hold."""

import numpy as np

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.objective.area.visual_hull import seen_volume

LENS = CameraModel(640, 480, np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]]))
EYES = ((1.0, 0.1, 0.2), (-0.9, 0.5, 0.3), (-0.2, -1.0, 0.25))


def volume(radius_m: float):
    cameras = [look_at(tuple(radius_m * x for x in eye), (0.0, 0.0, 1.0), LENS) for eye in EYES]
    return seen_volume(cameras, 1.8, 0.13)


def test_a_room_has_the_step_that_is_asked_for():
    found = volume(5.0)
    assert found.step_m == 0.13
    assert max(found.shape) < 60


def test_a_stadium_and_a_mistaken_unit_have_no_more_points_than_fit_into_memory():
    for radius_m in (80.0, 5000.0):
        found = volume(radius_m)
        assert np.prod(found.shape) < 9e6
        assert found.step_m * (found.shape[0] - 1) > radius_m  # still the whole of what they look at
