"""What is left out of a board's views, how well they fit, and whose clock is right."""

import numpy as np
import pytest

from tracker_node.calibration.board.adjustment import BoardState
from tracker_node.calibration.board.board import Board, BoardView
from tracker_node.calibration.board.refinement import BoardRigOptions, _Task, rows_of, view_errors
from tracker_node.calibration.board.views import BoardTimeStep
from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3

LENS = CameraModel(160, 120, np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]]))
BOARD = Board("chessboard", 4, 3, 0.1)


def view(ids=(0, 1), stamp_ns=0):
    return BoardView(stamp_ns, np.array(ids), np.arange(2.0 * len(ids)).reshape(-1, 2))


def at(x, y, z):
    return se3.from_rotation_translation(np.eye(3), np.array([x, y, z], dtype=float))


def state_of(boards, n_cameras=2):
    return BoardState.at((LENS,) * n_cameras, np.array([np.eye(4)] * n_cameras), np.array(boards))


def task_of(time_steps, boards):
    return _Task(BOARD, ["a", "b"], state_of(boards), [BoardTimeStep(views) for views in time_steps])


@pytest.mark.parametrize("clocks", ["exact", "offset", "free"])
def test_clocks_of_three_kinds_are_known(clocks):
    assert BoardRigOptions(clocks=clocks).clocks == clocks


def test_other_clocks_are_refused():
    with pytest.raises(ValueError, match=r"^expected clocks to be one of \('exact', 'offset', 'free'\), got 'late'$"):
        BoardRigOptions(clocks="late")


def test_a_view_s_error_is_the_rms_distance_of_its_corners():
    time_steps = [BoardTimeStep({"a": view((0, 1)), "b": view((2,))}), BoardTimeStep({"b": view((0, 1))})]
    residuals = np.array([[3.0, 4.0], [0.0, 0.0], [6.0, 8.0], [1.0, 0.0], [0.0, 1.0]])
    assert view_errors(time_steps, residuals) == pytest.approx({(0, "a"): np.sqrt(12.5), (0, "b"): 10.0, (1, "b"): 1.0})


def test_rows_are_in_the_order_of_the_views_with_their_cameras_and_lateness():
    time_steps = [BoardTimeStep({"b": view((5,), 3_000), "a": view((6, 7), 1_000)}), BoardTimeStep({"a": view((8,), 9_000)})]
    rows = rows_of(["a", "b"], time_steps)
    assert rows.camera.tolist() == [1, 0, 0, 0] and rows.time_step.tolist() == [0, 0, 0, 1]
    assert rows.corner.tolist() == [5, 6, 7, 8] and rows.late_s == pytest.approx([1e-6, -1e-6, -1e-6, 0.0])


def test_views_with_a_corner_behind_the_camera_are_unseen():
    task = task_of([{"a": view(), "b": view()}, {"b": view()}], [at(0, 0, 2), at(0, 0, -2)])
    assert task.unseen() == {(1, "b")}
    task.state.Ts_cam_world[1] = np.diag([1.0, -1.0, -1.0, 1.0])  # the second camera looks the other way
    assert task.unseen() == {(0, "b")}


def test_only_corners_in_the_view_must_be_seen():
    upright = se3.from_rotation_translation(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.0, 0.0, 0.1]))
    # Its left corners are before the camera, its right ones behind
    depths = se3.apply(upright, BOARD.corners)[:, 2]
    front, back = int(np.argmax(depths)), int(np.argmin(depths))
    assert depths[front] > 0.2 and depths[back] < 0.0
    task = task_of([{"a": view((front,)), "b": view((front, back))}], [upright])
    assert task.unseen() == {(0, "b")}


def test_views_left_out_are_kept_aside_and_empty_time_steps_go():
    first, second, third = {"a": view(stamp_ns=1), "b": view(stamp_ns=2)}, {"a": view(stamp_ns=3)}, {"b": view(stamp_ns=4)}
    task = task_of([first, second, third], [at(0, 0, 1), at(0, 0, 2), at(0, 0, 3)])
    task.state.jitter_s[:, 0] = 1.0, 2.0, 3.0
    task.leave_out({(0, "b"), (1, "a")})
    assert [(name, left.stamp_ns) for name, left in task.left_out] == [("b", 2), ("a", 3)]
    assert [[v.stamp_ns for v in time_step.views.values()] for time_step in task.time_steps] == [[1], [4]]
    assert task.state.Ts_world_board[:, 2, 3].tolist() == [1.0, 3.0] and task.state.jitter_s[:, 0].tolist() == [1.0, 3.0]
    task.leave_out(set())
    assert len(task.left_out) == 2 and len(task.time_steps) == 2


def test_views_far_worse_than_the_others_are_outlying():
    task = task_of([{"a": view((0,)), "b": view((0,))}, {"a": view((0,)), "b": view((0,))}], [at(0, 0, 1)] * 2)
    task.residuals_px = np.array([[0.5, 0.0], [0.5, 0.0], [0.0, 2.1], [0.5, 0.0]])
    assert task.outlying() == {(1, "a")}
    task.residuals_px[2] = 0.0, 1.9
    assert task.outlying() == set()


def test_the_first_clock_is_right_and_jitter_is_zero_on_average():
    task = task_of([{"a": view(), "b": view()}, {"a": view(), "b": view()}, {"b": view()}], [at(0, 0, 1)] * 3)
    task.state = BoardState(
        (LENS, LENS),
        task.state.Ts_cam_world,
        task.state.Ts_world_board,
        np.array([0.0, 0.5]),
        np.array([[0.1, 0.3], [0.3, 0.1], [9.0, 9.0]]),
    )
    moving = np.zeros((3, 6))
    moving[:, :3] = [[1.0, 0, 0], [0, 2.0, 0], [0, 0, -1.0]]
    task.set_first_clock_right(moving)
    # Both cameras' stamps are 0.2 s late on average; the last, seen by one camera, says nothing of it
    assert task.state.clocks_s == pytest.approx([0.0, 0.5])
    assert np.allclose(task.state.jitter_s, [[-0.1, 0.1], [0.1, -0.1], [0.0, 0.0]])
    assert np.allclose(task.state.Ts_world_board[:, :3, 3], [[0.2, 0, 1], [0, 0.4, 1], [0, 0, 0.8]])


def test_a_clock_that_is_late_against_the_first_stays_so():
    task = task_of([{"a": view(), "b": view()}], [at(0, 0, 1)])
    task.state = BoardState(
        (LENS, LENS), task.state.Ts_cam_world, task.state.Ts_world_board, np.array([0.1, 0.4]), np.zeros((1, 2))
    )
    task.set_first_clock_right(np.array([[1.0, 0, 0, 0, 0, 0]]))
    assert task.state.clocks_s == pytest.approx([0.0, 0.3])
    assert np.allclose(task.state.Ts_world_board[0, :3, 3], [0.1, 0, 1])
