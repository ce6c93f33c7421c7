import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.bodies.bodies import crane, gantry, random_state
from helpers.numeric import naive
from helpers.numeric.finite_difference import assert_jacobian
from helpers.numeric.rotations import twists
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
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
