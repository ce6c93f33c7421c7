
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.bodies.bodies import crane, gantry, random_state
from helpers.numeric import naive
from helpers.numeric.finite_difference import assert_jacobian
from helpers.numeric.rotations import twists
from tracker_node.experiments.cross.throw import yellow_stick
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration, State, angles_of, from_variables, to_variables, variable_names
from tracker_node.model.humans.human import human_model

BODIES = {"crane": crane(), "gantry": gantry(), "human": human_model()}


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("seed", range(3))
def test_forward_kinematics_agree_with_a_walk_up_the_tree(body, seed):
    model = BODIES[body]
    state = random_state(model, np.random.default_rng(seed))
    expected = naive.link_transforms(model, state)
    configuration = Configuration(model, state)
    for link, transform in zip(model.chain.links, configuration.Ts_world_link, strict=True):
        assert np.allclose(transform, expected[link], atol=1e-12)
    for landmark, point in zip(model.landmarks, configuration.landmarks_world, strict=True):
        assert np.allclose(point, se3.apply(expected[landmark.link], landmark.position), atol=1e-12)
    for shape, transform in zip(model.shapes, configuration.Ts_world_shape, strict=True):
        assert np.allclose(transform, expected[shape.link] @ shape.T_link_shape, atol=1e-12)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("seed", range(3))
def test_landmark_jacobian_matches_finite_differences(body, seed):
    model = BODIES[body]
    state = random_state(model, np.random.default_rng(seed))
    analytic = Configuration(model, state).landmark_jacobian()
    assert_jacobian(analytic, lambda d: Configuration(model, state.retract(d)).landmarks_world, step=1e-3, tolerance=1e-9)


def test_landmark_jacobian_at_neutral():
    """Where several axes are parallel, and small-angle branches are taken."""
    model = BODIES["human"]
    state = State.neutral(model)
    analytic = Configuration(model, state).landmark_jacobian()
    assert_jacobian(analytic, lambda d: Configuration(model, state.retract(d)).landmarks_world, step=1e-3, tolerance=1e-9)


@given(twists, twists, st.integers(0, 100))
def test_difference_inverts_retract(root, step, seed):
    rng = np.random.default_rng(seed)
    state = State(se3.exp(root), rng.normal(size=4))
    tangent = np.concatenate([step, rng.normal(size=4)])
    back = state.retract(tangent).difference(state)
    assert np.allclose(state.retract(back).T_world_root, state.retract(tangent).T_world_root, atol=1e-9)
    if np.linalg.norm(step[3:]) < 3.1:
        assert np.allclose(back, tangent, atol=1e-9)


@given(twists)
def test_values_there_and_back(root):
    state = State(se3.exp(root), np.arange(3.0))
    again = State.from_values(state.to_values())
    assert np.allclose(again.T_world_root, state.T_world_root, atol=1e-9)
    assert np.array_equal(again.joint_positions, state.joint_positions)


def test_a_state_of_another_body_is_refused():
    with pytest.raises(ValueError, match="34 joint positions"):
        Configuration(BODIES["human"], State(np.eye(4), np.zeros(3)))


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
