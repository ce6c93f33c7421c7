from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.board_scenes import CHARUCO, LENSES, board_pose, corners_seen, ring
from helpers.numeric.finite_difference import assert_jacobian, numerical_jacobian
from tracker_node.calibration.board.adjustment import (
    BoardAdjustmentOptions,
    BoardState,
    _moved,
    _Problem,
    adjust_boards,
    lens_jacobian,
    lens_of_vector,
    lens_vector,
)
from tracker_node.calibration.board.refinement import rows_of
from tracker_node.calibration.board.views import group_views, velocities
from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3

NAMES = ["cam1", "cam2", "cam3"]


@pytest.mark.parametrize("kind", ["none", *LENSES])
def test_pixels_follow_the_lens(kind):
    K = np.array([[900.0, 0.0, 640.0], [0.0, 890.0, 400.0], [0.0, 0.0, 1.0]])
    lens = CameraModel(1280, 800, K, kind, np.array(LENSES.get(kind, ())))
    points = np.array([[0.1, -0.2, 1.0], [-0.6, 0.3, 1.2], [0.0, 0.0, 2.0], [0.4, 0.4, 1.0]])
    start = lens_vector(lens)

    def pixels(change):
        return lens_of_vector(start + change, lens).project(points)[0]

    assert_jacobian(lens_jacobian(lens, points), pixels, step=1e-4)


def problem(**options):
    """A problem away from its minimum: cameras, lenses, poses, clocks and stamps are all off."""
    rig = ring(8).subset(NAMES)
    seen = corners_seen(rig, n=25, noise_px=0.5, late_s=[0.0, 0.02, -0.03], jitter_s=0.01)
    time_steps = [i for i in group_views({n: c.views for n, c in seen.items()}, 0.05) if len(i.views) > 1]
    rng = np.random.default_rng(1)
    boards = np.array([board_pose(1e-9 * i.stamp_ns) @ se3.exp(0.01 * rng.standard_normal(6)) for i in time_steps])
    state = BoardState.at(tuple(c.model for c in rig), np.array([c.T_cam_world for c in rig]), boards)
    state = replace(state, clocks_s=0.01 * rng.standard_normal(3), jitter_s=0.01 * rng.standard_normal((len(time_steps), 3)))
    everything = BoardAdjustmentOptions(**{"free_clocks": True, "jitter_sigma_s": 0.02, **options})
    moving = velocities(time_steps, boards)
    return _Problem(CHARUCO.corners, rows_of(NAMES, time_steps), everything, moving), state


def test_gradient_of_the_cost():
    task, state = problem(robust_scale_px=3.0)
    equations = task.linearize(state)
    n, d, c = len(state.Ts_world_board), len(equations.free), 3

    def cost(change):
        cameras = np.split(change[:d], equations.offsets[1:-1])
        poses, late_s = change[d : d + 6 * n].reshape(n, 6), change[d + 6 * n :].reshape(n, c)
        return 0.5 * task.cost(_moved(state, cameras, poses, late_s))

    numeric = numerical_jacobian(cost, d + 6 * n + c * n, 1e-6)
    # What is left of the gradient after the stamps are eliminated: as if each view's stamp had its best value to first order
    by_stamp = numeric[d + 6 * n :].reshape(n, c)
    full = np.concatenate([equations.gradient_shared, equations.gradient_blocks.ravel()])
    for stamps in equations.stamps:
        np.testing.assert_allclose(stamps.gradient, by_stamp[:, stamps.camera], rtol=1e-4, atol=1e-3)
        share = stamps.gradient / stamps.precision
        full[equations.part(stamps.camera)] += stamps.with_camera.T @ share
        full[d:] += (stamps.with_pose * share[:, None]).ravel()
    np.testing.assert_allclose(full, numeric[: d + 6 * n], rtol=1e-4, atol=1e-4 * np.abs(numeric[: d + 6 * n]).max())


def test_eliminating_is_the_same_as_solving_for_everything():
    task, state = problem(robust_scale_px=1e6)
    equations = task.linearize(state)
    equations.hold(True, True, True)
    cameras, poses, late_s = equations.step(0.0)
    before, after = task.cost(state), task.cost(_moved(state, cameras, poses, late_s))
    again = task.linearize(_moved(state, cameras, poses, late_s))
    assert after < 0.02 * before
    for name in ("gradient_shared", "gradient_blocks"):
        free = equations.free if name == "gradient_shared" else slice(None)
        assert np.abs(getattr(again, name)[free]).max() < 0.1 * np.abs(getattr(equations, name)[free]).max()


def test_what_is_held_stays():
    task, state = problem()
    options = BoardAdjustmentOptions(3.0, free_lenses=False, free_cameras=False)
    found = adjust_boards(CHARUCO.corners, task.seen, state, options)
    assert found.state.lenses == state.lenses and np.array_equal(found.state.Ts_cam_world, state.Ts_cam_world)
    assert np.array_equal(found.state.clocks_s, state.clocks_s) and np.array_equal(found.state.jitter_s, state.jitter_s)
    assert found.converged and all(not sigma.any() for sigma in found.sigmas)


def test_a_start_behind_the_camera_is_refused():
    task, state = problem()
    turned = state.Ts_cam_world.copy()
    turned[1] = np.diag([1.0, -1.0, -1.0, 1.0]) @ turned[1]
    with pytest.raises(ValueError, match="in front of the camera"):
        adjust_boards(CHARUCO.corners, task.seen, replace(state, Ts_cam_world=turned))
