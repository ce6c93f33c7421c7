"""The somersault flies as bodies fly, has the paper's ranges, and stays in view."""

import numpy as np
import pytest

from tracker_node.errors import UnknownNameError
from tracker_node.model.configuration import Configuration
from tracker_node.model.human import human_model
from tracker_node.model.pose_variables import to_variables
from tracker_node.synthesis.somersault import (
    CAMERA_NAMES,
    GRAVITY,
    SomersaultRanges,
    somersault_rig,
    somersault_states,
    somersault_variables,
)


@pytest.mark.parametrize("n_images", [5, 11, 40])
def test_ranges_are_those_of_the_paper(n_images):
    variables = somersault_variables(n_images)
    assert variables.shape == (n_images, 6)
    size = np.ptp(variables, axis=0)
    assert np.allclose(size[:3], [1.0, 0.01, 0.79])
    assert np.allclose(np.degrees(size[3:]), [360.0, 8.0, 180.0])


def test_falls_with_gravity():
    n = 2001
    heights = somersault_variables(n)[:, 2]
    dt = SomersaultRanges().flight_time / (n - 1)
    assert np.allclose(np.diff(heights, 2) / dt**2, -GRAVITY, rtol=1e-4)
    assert heights[0] == pytest.approx(SomersaultRanges().take_off_height)


def test_twists_because_it_is_tilted():
    variables = somersault_variables(2001)
    rate, tilt = np.gradient(variables[:, 5]), variables[:, 4]
    inner = slice(200, -200)
    assert np.allclose(rate[inner] / tilt[inner], rate[1000] / tilt[1000], rtol=1e-3)
    assert tilt[0] == pytest.approx(0.0) and tilt[-1] == pytest.approx(0.0, abs=1e-12)


def test_states_keep_one_posture():
    model, variables = human_model(), somersault_variables(11)
    states = somersault_states(model, variables, {"left_knee_flexion": 20.0})
    index = model.chain.axis_index("left_knee_flexion")
    for state, row in zip(states, variables, strict=True):
        assert state.joint_positions[index] == pytest.approx(np.deg2rad(20.0))
        assert np.allclose(to_variables(state, row)[:6], row)
    with pytest.raises(UnknownNameError, match="left_wing"):
        somersault_states(model, variables, {"left_wing": 1.0})


@pytest.mark.parametrize("width", [768, 192])
def test_the_whole_flight_is_in_view(width):
    model, rig = human_model(), somersault_rig(width)
    assert rig.names == CAMERA_NAMES and rig.cameras[0].model.height == width * 3 // 4
    for state in somersault_states(model, somersault_variables(41), {}):
        points = Configuration(model, state).landmarks_world
        for camera in rig:
            pixels, valid = camera.project(points)
            assert valid.all()
            margin = 0.012 * width  # landmarks lie within the skin
            assert np.all((pixels > margin) & (pixels < [width - margin, camera.model.height - margin]))
