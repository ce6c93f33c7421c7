"""Poses of a board in single images, and where cameras are by them: exact corners give the true ones."""

import numpy as np
import pytest

from helpers.cameras.board_scenes import CHARUCO, board_pose, corners_seen, ring
from tracker_node.calibration.board.board import BoardView
from tracker_node.calibration.board.start import (
    board_poses,
    common_time_steps,
    groups,
    initial_lens,
    initial_state,
    place_boards,
)
from tracker_node.calibration.board.views import BoardTimeStep, group_views
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3

RIG = CameraRig(ring(8, ("plumb_bob",)).cameras[:3])
SEEN = corners_seen(RIG, n=60, noise_px=0.0)
TIME_STEPS = [i for i in group_views({name: one.views for name, one in SEEN.items()}, 0.01) if len(i.views) > 1]
LENSES = {camera.name: camera.model for camera in RIG}


def test_the_better_pose_comes_first_and_is_the_true_one():
    camera = RIG.cameras[0]
    for view in SEEN[camera.name].views[:5]:
        poses, errors = board_poses(CHARUCO, camera.model, view)
        assert len(poses) == len(errors) == 2
        assert errors == sorted(errors)
        assert errors[0] < 1e-3
        assert np.allclose(poses[0], camera.T_cam_world @ board_pose(1e-9 * view.stamp_ns), atol=1e-4)


def test_the_error_is_a_root_mean_square_of_distances():
    camera, view = RIG.cameras[0], SEEN[RIG.names[0]].views[0]
    shifted = BoardView(view.stamp_ns, view.ids, view.pixels + np.where(np.arange(len(view.ids)) % 2, 3.0, -3.0)[:, None])
    assert board_poses(CHARUCO, camera.model, shifted)[1][0] == pytest.approx(3.0 * np.sqrt(2.0), rel=0.1)


def test_three_corners_are_too_few():
    view = SEEN[RIG.names[0]].views[0]
    few = BoardView(0, view.ids[:3], view.pixels[:3])
    assert board_poses(CHARUCO, RIG.cameras[0].model, few) == ([], [1e6])
    square = [0, 1, CHARUCO.grid[0], CHARUCO.grid[0] + 1]
    pixels, valid = RIG.cameras[0].model.project(se3.apply(camera_board(), CHARUCO.corners[square]))
    assert valid.all()
    assert board_poses(CHARUCO, RIG.cameras[0].model, BoardView(0, np.array(square), pixels))[1][0] < 1e-3


def camera_board():
    return se3.exp(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])) @ se3.exp(np.array([0.0, 0.0, 0.0, 2.5, 0.4, 0.2]))


@pytest.mark.parametrize("focal", [500.0, 1500.0])
def test_a_first_lens_has_about_the_right_focal_length(focal):
    lens = CameraModel(1280, 800, np.array([[focal, 0.0, 639.5], [0.0, focal, 399.5], [0.0, 0.0, 1.0]]))
    views = []
    for i in range(6):
        tilted = se3.exp(np.array([0.1 * i - 0.2, 0.05, 1.6 * focal / 900.0, 0.0, 0.0, 0.0])) @ se3.exp(
            np.array([0.0, 0.0, 0.0, np.pi - 0.5, 0.3 * (i - 2.5), 0.0])
        )
        views.append(BoardView(i, np.arange(len(CHARUCO.corners)), lens.project(se3.apply(tilted, CHARUCO.corners))[0]))
    found = initial_lens(CHARUCO, views, (1280, 800), "plumb_bob")
    assert found.K[0, 0] == found.K[1, 1] == pytest.approx(focal, rel=0.06)
    assert found.K[:2, 2].tolist() == [639.5, 399.5]
    assert (found.distortion_model, len(found.distortion)) == ("plumb_bob", 5)
    assert not found.distortion.any()
    upright = initial_lens(CHARUCO, views[:1], (800, 1280), "none")
    assert upright.K[:2, 2].tolist() == [399.5, 639.5]


def time_step(*names):
    return BoardTimeStep({name: SEEN[RIG.names[0]].views[0] for name in names})


def test_cameras_that_see_the_board_together_are_counted():
    common = common_time_steps("abc", [time_step("a", "b"), time_step("b"), time_step("b", "a"), time_step("c")])
    assert common.tolist() == [[2, 2, 0], [2, 3, 0], [0, 0, 1]]
    assert common_time_steps("ab", []).tolist() == [[0, 0], [0, 0]]


def test_cameras_that_hang_together_are_groups_the_largest_first():
    common = np.array([[5, 0, 0, 0], [0, 5, 2, 0], [0, 2, 5, 1], [0, 0, 1, 5]])
    assert groups("abcd", common) == [["b", "c", "d"], ["a"]]
    assert groups("abcd", common, 2) == [["b", "c"], ["a"], ["d"]]
    assert groups("abcd", common, 3) == [["a"], ["b"], ["c"], ["d"]]


def test_cameras_and_boards_are_where_they_are_seen_from_the_first_camera():
    state = initial_state(CHARUCO, RIG.names, LENSES, TIME_STEPS)
    origin = RIG.cameras[0].T_cam_world
    assert np.allclose(state.Ts_cam_world[0], np.eye(4))
    for camera, T in zip(RIG, state.Ts_cam_world, strict=True):
        assert np.allclose(T, camera.T_cam_world @ se3.inverse(origin), atol=1e-3)
    for one, T in zip(TIME_STEPS, state.Ts_world_board, strict=True):
        assert np.allclose(T, origin @ board_pose(1e-9 * one.stamp_ns), atol=1e-3)
    assert np.allclose(place_boards(CHARUCO, RIG.names, state, TIME_STEPS), state.Ts_world_board)
    assert not state.clocks_s.any()


def test_cameras_that_do_not_hang_together_are_refused():
    apart = [i for i in TIME_STEPS if RIG.names[2] not in i.views]
    with pytest.raises(ValueError, match="expected cameras that hang together"):
        initial_state(CHARUCO, RIG.names, LENSES, apart)
