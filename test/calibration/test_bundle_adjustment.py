"""Bundle adjustment: analytic derivatives, and a disturbed rig found again."""

import numpy as np
import pytest
from camera_rigs import circle_rig, disturbed

from tracker_node.calibration.bundle_adjustment import AdjustmentOptions, PointObservations, _Problem, adjust
from tracker_node.calibration.triangulation import reproject
from tracker_node.camera.camera_rig import CameraRig
from tracker_node.geometry import se3, so3


def observations(rig: CameraRig, n: int = 200, seed: int = 1) -> tuple[np.ndarray, PointObservations]:
    points = np.random.default_rng(seed).uniform([-0.7, -0.7, 0.1], [0.7, 0.7, 1.9], (n, 3))
    pixels, visible = reproject([c.model for c in rig], np.array([c.T_world_cam for c in rig]), points)
    return points, PointObservations(pixels, visible.astype(float))


def scale_and_shape_error(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Scale, and median error (m) of the mutual distances after it: what no choice of world frame changes."""
    a = np.linalg.norm(found[:, None] - found[None], axis=-1)
    b = np.linalg.norm(true[:, None] - true[None], axis=-1)
    scale = float(np.median(a[b > 0.0] / b[b > 0.0]))
    return scale, float(np.median(np.abs(a / scale - b)))


def test_gradient_agrees_with_finite_differences_of_the_cost():
    rig = circle_rig(3)
    _, seen = observations(rig, 5)
    problem = _Problem(disturbed(rig), seen, AdjustmentOptions())
    rng = np.random.default_rng(0)
    start = np.array([se3.exp(rng.normal(size=6) * 0.01) @ T for T in problem.given_Ts_cam_world])
    points = problem.start_points + rng.normal(size=problem.start_points.shape) * 0.01
    blocks = problem.linearize(start, points)
    step = 1e-6
    for camera in range(3):
        for k in range(6):
            twist = np.zeros(6)
            twist[k] = step
            costs = []
            for sign in (1.0, -1.0):
                moved = start.copy()
                moved[camera] = se3.exp(sign * twist) @ start[camera]
                costs.append(problem.cost(moved, points))
            numeric = (costs[0] - costs[1]) / (2.0 * step)
            assert 2.0 * blocks.gradient_cameras[camera, k] == pytest.approx(numeric, rel=2e-4, abs=1e-3)
    for k in range(3):
        move = np.zeros_like(points)
        move[2, k] = step
        numeric = (problem.cost(start, points + move) - problem.cost(start, points - move)) / (2.0 * step)
        assert 2.0 * blocks.gradient_points[2, k] == pytest.approx(numeric, rel=1e-4, abs=1e-3)


def test_a_disturbed_rig_is_found_again_up_to_scale():
    rig = circle_rig()
    points, seen = observations(rig)
    result = adjust(disturbed(rig), seen)
    assert result.converged
    assert np.abs(result.residuals_px).max() < 0.2  # the prior pulls a little
    scale, shape = scale_and_shape_error(result.points, points)
    assert 0.97 < scale < 1.03
    assert shape < 5e-4
    for camera, transform in zip(rig.cameras, result.Ts_world_cam, strict=True):
        T_first_cam = se3.inverse(result.Ts_world_cam[0]) @ transform
        expected = se3.inverse(rig.cameras[0].T_world_cam) @ camera.T_world_cam
        assert np.linalg.norm(so3.log(T_first_cam[:3, :3].T @ expected[:3, :3])) < np.radians(0.1)


def test_the_first_camera_is_held():
    rig = disturbed(circle_rig())
    _, seen = observations(circle_rig())
    result = adjust(rig, seen)
    np.testing.assert_allclose(result.Ts_world_cam[0], rig.cameras[0].T_world_cam, atol=1e-12)


def test_confused_joints_hardly_matter():
    rig = circle_rig()
    points, seen = observations(rig)
    rng = np.random.default_rng(5)
    pixels = seen.pixels + rng.normal(size=seen.pixels.shape) * 1.0
    wrong = rng.random(seen.weights.shape) < 0.1
    pixels[wrong] += rng.normal(size=(wrong.sum(), 2)) * 80.0
    robust = adjust(disturbed(rig), PointObservations(pixels, seen.weights))
    naive = adjust(disturbed(rig), PointObservations(pixels, seen.weights), AdjustmentOptions(robust_scale_px=1e3))
    good, bad = scale_and_shape_error(robust.points, points)[1], scale_and_shape_error(naive.points, points)[1]
    assert good < 0.01
    assert bad > 3.0 * good


def test_points_only_leaves_the_cameras():
    rig = circle_rig()
    points, seen = observations(rig)
    result = adjust(rig, seen, AdjustmentOptions(free_cameras=False))
    np.testing.assert_allclose(result.points, points, atol=1e-7)
    np.testing.assert_allclose(result.Ts_world_cam, [c.T_world_cam for c in rig], atol=1e-12)


def test_points_that_one_camera_sees_are_left_out():
    rig = circle_rig()
    _, seen = observations(rig, 30)
    weights = seen.weights.copy()
    weights[:7, 1:] = 0.0
    result = adjust(rig, PointObservations(seen.pixels, weights))
    assert not result.valid[:7].any() and result.valid[7:].all()
    assert not result.residuals_px[:7].any()
    with pytest.raises(ValueError, match="at least two cameras"):
        adjust(rig, PointObservations(seen.pixels[:7], weights[:7]))


def test_observations_must_fit_the_rig():
    rig = circle_rig()
    _, seen = observations(rig, 5)
    with pytest.raises(ValueError, match="expected observations of 4 cameras, got 3"):
        adjust(rig, PointObservations(seen.pixels[:, :3], seen.weights[:, :3]))
    with pytest.raises(ValueError, match="expected pixels of shape"):
        PointObservations(seen.pixels[:, :2], seen.weights)
