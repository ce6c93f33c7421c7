"""Degrees of freedom as people read them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.bodies.bodies import crane
from helpers.bodies.robot_text import ROBOT
from helpers.cameras.small_clip import body
from tracker_node.errors import FileFormatError
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.studio.pose.page import dof_groups, state_of, values_of

angles = st.floats(-3.1, 3.1)


@given(st.tuples(angles, angles, angles), st.tuples(angles, angles, angles), st.floats(0, 1))
def test_values_give_the_state_back(turn, place, share):
    model = crane()
    joints = model.chain.followed(model.chain.lower + share * (model.chain.upper - model.chain.lower))
    state = State(se3.from_rotation_translation(so3.exp(np.array(turn)), np.array(place)), joints)
    back = state_of(values_of(state, model), model)
    np.testing.assert_allclose(back.T_world_root, state.T_world_root, atol=1e-9)
    np.testing.assert_allclose(back.joint_positions, state.joint_positions, atol=1e-12)


def test_a_body_that_lies_is_no_special_case():
    model = body()
    state = State(se3.from_rotation_translation(so3.exp(np.array([0.0, np.pi / 2, 0.0])), np.zeros(3)), np.zeros(3))
    np.testing.assert_allclose(state_of(values_of(state, model), model).T_world_root, state.T_world_root, atol=1e-12)


def test_joints_are_put_within_their_limits():
    model = body()
    state = state_of([0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 500.0, 0.0, -500.0], model)
    assert state.joint_positions.tolist() == [model.chain.upper[0], 0.0, model.chain.lower[2]]


def test_driven_axes_follow(tmp_path):
    path = tmp_path / "arm.urdf"
    driven = '<joint name="follower" type="revolute"><parent link="tool"/><child link="tip"/><axis xyz="0 1 0"/>'
    driven += '<limit lower="-3" upper="3" effort="1" velocity="1"/><mimic joint="elbow" multiplier="-0.5" offset="0.1"/></joint>'
    path.write_text(ROBOT.replace("</robot>", f'<link name="tip"/>{driven}</robot>'))
    model = load_model(path)
    names = list(model.chain.dof_names)
    values = values_of(State.neutral(model), model)
    values[names.index("elbow")] = 60.0
    values[names.index("follower")] = 17.0
    after = values_of(state_of(values, model), model)
    assert after[names.index("follower")] == pytest.approx(np.rad2deg(-0.5 * np.deg2rad(60.0) + 0.1))
    dofs = {dof["name"]: dof for group in dof_groups(model, values) for dof in group["dofs"]}
    assert dofs["follower"]["driven"] and not dofs["elbow"]["driven"]
    assert dofs["lift"]["unit"] == "m" and (dofs["lift"]["lower"], dofs["lift"]["upper"]) == (0.1, 0.5)
    assert (dofs["turntable"]["lower"], dofs["turntable"]["upper"]) == (-180.0, 180.0)


def test_every_degree_of_freedom_is_in_one_group():
    model = human_model()
    groups = dof_groups(model, values_of(State.neutral(model), model))
    assert sorted(dof["index"] for group in groups for dof in group["dofs"]) == list(range(model.n_dof))
    assert [dof["name"] for dof in groups[0]["dofs"]] == ["x", "y", "z", "roll", "pitch", "yaw"]
    assert all(dof["name"] == model.chain.dof_names[dof["index"]] for group in groups[1:] for dof in group["dofs"])


def test_another_number_of_values_is_refused():
    with pytest.raises(FileFormatError, match=r"9 numbers.*got 3"):
        state_of([0.0, 1.0, 2.0], body())
