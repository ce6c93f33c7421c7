"""Position, somersault, tilt and twist of a pose, there and back, with full turns counted on."""

import math

import numpy as np
import pytest

from tracker_node.experiments.cross.yellow_stick import yellow_stick
from tracker_node.geometry import so3
from tracker_node.model.configuration import State
from tracker_node.model.pose_variables import angles_of, from_variables, to_variables, variable_names


def about(axis, angle):
    return so3.exp(angle * np.eye(3)["xyz".index(axis)])


def test_the_order_of_the_turns():
    """R = Ry(somersault) Rx(tilt) Rz(twist)."""
    rotation = about("y", 0.5) @ about("x", -0.3) @ about("z", 1.1)
    assert angles_of(rotation) == pytest.approx([0.5, -0.3, 1.1])
    state = from_variables(np.array([1.0, 2.0, 3.0, 0.5, -0.3, 1.1, 7.0, 8.0]))
    np.testing.assert_allclose(state.T_world_root[:3, :3], rotation, atol=1e-12)
    np.testing.assert_array_equal(state.T_world_root[:3, 3], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(state.joint_positions, [7.0, 8.0])


@pytest.mark.parametrize(
    "near",
    [(0.5, -0.3, 1.1), (0.5 + 2 * math.pi, -0.3, 1.1 - 4 * math.pi), (0.5 + math.pi, math.pi + 0.3, 1.1 - math.pi),
     (0.5 + 9 * math.pi, 0.3 - math.pi, 1.1 + math.pi)],
)  # fmt: skip
def test_angles_stay_close_to_what_is_given(near):
    """Full turns, and the other solution: half a turn of somersault and twist, and the tilt beyond 90 degrees."""
    rotation = about("y", 0.5) @ about("x", -0.3) @ about("z", 1.1)
    beside = np.array(near) + np.array([0.2, -0.2, 0.2])
    assert angles_of(rotation, beside) == pytest.approx(near)


def test_variables_are_there_and_back():
    model = yellow_stick()
    assert variable_names(model)[:6] == ("x", "y", "z", "somersault", "tilt", "twist")
    assert variable_names(model)[6:] == tuple(axis.name for axis in model.chain.axes)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = about("y", 0.4), (0.1, 0.2, 0.3)
    state = State(pose, np.array([0.6, 0.7]))
    assert to_variables(state) == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.0, 0.0, 0.6, 0.7])
    near = np.array([9.0, 9.0, 9.0, 0.4 - 2 * math.pi, 0.0, 0.0, 0.0, 0.0])
    assert to_variables(state, near) == pytest.approx([0.1, 0.2, 0.3, 0.4 - 2 * math.pi, 0.0, 0.0, 0.6, 0.7])
    np.testing.assert_allclose(from_variables(to_variables(state, near)).T_world_root, pose, atol=1e-12)
