"""A body that follows the mouse: the point is where the pointer is, by the joints that should move it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.bodies.bodies import crane, random_state
from helpers.cameras.render_scenes import LENSES, look_at
from helpers.cameras.small_clip import body
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.geometry import se3, so3
from tracker_node.loaders.fetched_files import data_file
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.studio.pose.drag import Grip, drag, moving_dofs, pixel_jacobian

CAMERA = look_at((2.2, 0.4, 0.9), (0.0, 0.0, 0.5), LENSES["radial"])
HUMAN = load_model(data_file("config/models/human.yaml"))
ARM = body()


def shown(model, state, grip):
    """Where a gripped point shows, by the transforms of the links alone."""
    T = Configuration(model, state).Ts_world_link[grip.link]
    return CAMERA.project(T[:3, :3] @ grip.point + T[:3, 3])[0]


def grip_of(model, landmark):
    i = model.landmark_index(landmark)
    return Grip(int(model.landmark_links[i]), model.landmark_positions[i], CAMERA)


def standing(model, z=0.5):
    return State.neutral(model, se3.from_rotation_translation(so3.exp(np.array([0.1, -0.2, 0.6])), np.array([0.0, 0.1, z])))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("model", [crane(), HUMAN], ids=["crane", "human"])
def test_jacobian_of_a_pixel(model, seed):
    state = random_state(model, np.random.default_rng(seed), share=0.5)
    root = se3.from_rotation_translation(state.T_world_root[:3, :3], np.array([0.0, 0.1, 0.4]))
    state = State(root, state.joint_positions)
    for link in (0, len(model.chain.links) // 2, len(model.chain.links) - 1):
        grip = Grip(link, np.array([0.02, -0.03, 0.05]), CAMERA)
        _, J = pixel_jacobian(Configuration(model, state), grip)
        assert_jacobian(J, lambda d, grip=grip: shown(model, state.retract(d), grip), tolerance=1e-6)


bends = st.floats(-0.6, 0.6)


@given(bends, bends, bends)
def test_a_hand_comes_to_the_pointer(x, y, bend):
    """Wherever the arm can be, so that the pixel is within its reach."""
    start, grip = standing(ARM), grip_of(ARM, "wrist")
    start = State(start.T_world_root, np.array([0.2, -0.5, -0.9]))
    wanted = shown(ARM, State(start.T_world_root, start.joint_positions + np.array([x, y, bend])), grip)
    state = drag(ARM, start, grip, wanted)
    assert np.linalg.norm(shown(ARM, state, grip) - wanted) < 0.1
    np.testing.assert_array_equal(state.T_world_root, start.T_world_root)


def test_a_drag_back_leads_back():
    start, grip = standing(HUMAN, 1.0), grip_of(HUMAN, "left_wrist")
    at = shown(HUMAN, start, grip)
    state = drag(HUMAN, start, grip, at)
    np.testing.assert_allclose(state.joint_positions, start.joint_positions, atol=1e-6)


def moved_axes(state, start):
    return {HUMAN.chain.axes[i].name for i in np.flatnonzero(np.abs(state.joint_positions - start.joint_positions) > 1e-9)}


def test_only_the_limb_moves():
    start, grip = standing(HUMAN, 1.0), grip_of(HUMAN, "left_wrist")
    state = drag(HUMAN, start, grip, shown(HUMAN, start, grip) + np.array([15.0, -20.0]))
    moved = moved_axes(state, start)
    assert moved and all(name.startswith(("left_shoulder", "left_elbow", "left_clavicle")) for name in moved), moved
    elbow_only = drag(HUMAN, start, grip, shown(HUMAN, start, grip) + np.array([3.0, -4.0]), "joint")
    moved = moved_axes(elbow_only, start)
    assert moved and all("left_elbow" in name for name in moved), moved


def test_joints_stop_at_their_limits():
    start, grip = standing(ARM), grip_of(ARM, "wrist")
    state = drag(ARM, start, grip, np.array([-4000.0, -9000.0]))
    assert (state.joint_positions >= ARM.chain.lower).all() and (state.joint_positions <= ARM.chain.upper).all()


def test_a_point_of_the_root_shifts_the_body_in_the_image_plane():
    start, grip = standing(ARM), Grip(0, np.array([0.02, 0.01, 0.1]), CAMERA)
    wanted = shown(ARM, start, grip) + np.array([31.0, -12.0])
    for state in (drag(ARM, start, grip, wanted), drag(ARM, start, grip_of(ARM, "wrist"), wanted, "body")):
        np.testing.assert_array_equal(state.joint_positions, start.joint_positions)
        np.testing.assert_array_equal(state.T_world_root[:3, :3], start.T_world_root[:3, :3])
        shift = state.T_world_root[:3, 3] - start.T_world_root[:3, 3]
        assert abs(CAMERA.T_world_cam[:3, 2] @ shift) < 1e-12  # at the depth that it had
    np.testing.assert_allclose(shown(ARM, drag(ARM, start, grip, wanted), grip), wanted, atol=1e-6)


def test_a_turn_keeps_the_root_where_it_is():
    start, grip = standing(ARM), grip_of(ARM, "shoulder")
    root = CAMERA.project(start.T_world_root[:3, 3])[0]
    before = shown(ARM, start, grip) - root
    wanted = root + so3.exp(np.array([0.0, 0.0, 0.5]))[:2, :2] @ before
    state = drag(ARM, start, grip, wanted, "turn")
    np.testing.assert_array_equal(state.T_world_root[:3, 3], start.T_world_root[:3, 3])
    after = shown(ARM, state, grip) - root
    u, v = wanted - root
    assert abs(after[0] * v - after[1] * u) / np.linalg.norm(after) / np.linalg.norm(before) < 0.05
    assert np.linalg.norm(so3.log(state.T_world_root[:3, :3] @ start.T_world_root[:3, :3].T)) == pytest.approx(0.5, abs=0.02)


def test_a_joint_that_does_not_move_the_point_is_left_out():
    start, grip = standing(ARM), grip_of(ARM, "elbow")  # on the axis of the elbow
    names = {ARM.chain.dof_names[i] for i in np.flatnonzero(moving_dofs(ARM, start, grip, nearest=True))}
    assert names and names <= {"shoulder_x", "shoulder_y"}
