"""Bundle adjustment: analytic derivatives, and a disturbed rig found again."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig, disturbed
from tracker_node.calibration.points.bundle_adjustment import (
    AdjustmentOptions,
    PointObservations,
    _log_derivative,
    _Problem,
    adjust,
)
from tracker_node.calibration.points.triangulation import reproject
from tracker_node.camera.rig import CameraRig
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
    equations = problem.linearize(start, points)
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
            assert 2.0 * equations.gradient_shared[6 * camera + k] == pytest.approx(numeric, rel=2e-4, abs=1e-3)
    for k in range(3):
        move = np.zeros_like(points)
        move[2, k] = step
        numeric = (problem.cost(start, points + move) - problem.cost(start, points - move)) / (2.0 * step)
        assert 2.0 * equations.gradient_blocks[2, k] == pytest.approx(numeric, rel=1e-4, abs=1e-3)


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


def small_problem(n: int = 4, **options):
    """Exact observations of a few points by three cameras, at which everything is as given."""
    rig = circle_rig(3)
    _, seen = observations(rig, n)
    return _Problem(rig, seen, AdjustmentOptions(**options)), seen


def test_the_cost_is_cauchys_loss_and_the_prior_in_standard_deviations():
    problem, _ = small_problem(robust_scale_px=8.0)
    T, points = problem.given_Ts_cam_world, problem.start_points
    assert problem.cost(T, points) == pytest.approx(0.0, abs=1e-9)
    problem.pixels = problem.pixels.copy()
    problem.pixels[1, 2] += [3.0, -4.0]
    problem.weights = problem.weights.copy()
    problem.weights[1, 2] = 0.7
    assert problem.cost(T, points) == pytest.approx(0.7 * np.log1p(25.0 / 64.0))
    moved = T.copy()
    moved[2] = se3.exp(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])) @ T[2]
    off, _, _ = problem._residuals(moved, points)
    data = np.sum(problem.weights * np.log1p(np.sum(off**2, axis=-1) / 64.0))
    assert problem.cost(moved, points) - data == pytest.approx((0.1 / 0.5) ** 2)
    moved[2] = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.1, 0.0])) @ T[2]
    off, _, _ = problem._residuals(moved, points)
    data = np.sum(problem.weights * np.log1p(np.sum(off**2, axis=-1) / 64.0))
    assert problem.cost(moved, points) - data == pytest.approx((0.1 / 0.2) ** 2)


def test_a_point_behind_a_camera_that_has_seen_it_forbids_the_step():
    problem, _ = small_problem()
    behind = problem.start_points.copy()
    behind[0] = se3.inverse(problem.given_Ts_cam_world)[1, :3, 3] * 1.5
    assert problem.cost(problem.given_Ts_cam_world, behind) == np.inf
    problem.weights = problem.weights.copy()
    problem.weights[0] = problem._residuals(problem.given_Ts_cam_world, behind)[2][0]
    assert problem.weights[0, 1] == 0.0 and np.isfinite(problem.cost(problem.given_Ts_cam_world, behind))


def dense(equations, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """The whole normal equations of all cameras and points, damped along their diagonal."""
    n, d, _ = equations.mixed.shape
    H, g = np.zeros((d + 3 * n, d + 3 * n)), np.zeros(d + 3 * n)
    H[:d, :d], g[:d] = equations.shared, equations.gradient_shared
    for k in range(n):
        at = slice(d + 3 * k, d + 3 * k + 3)
        H[at, at], g[at] = equations.blocks[k], equations.gradient_blocks[k]
        H[:d, at], H[at, :d] = equations.mixed[k], equations.mixed[k].T
    return H + damping * np.diag(np.diag(H)), g


@pytest.mark.parametrize("damping", [1e-3, 0.5])
def test_a_step_solves_the_whole_system_with_the_first_camera_held(damping):
    problem, _ = small_problem(6)
    rng = np.random.default_rng(4)
    T = np.array([se3.exp(0.02 * rng.normal(size=6)) @ G for G in problem.given_Ts_cam_world])
    points = problem.start_points + 0.02 * rng.normal(size=problem.start_points.shape)
    equations = problem.linearize(T, points)
    twists, moves = equations.move(damping)
    H, g = dense(equations, damping)
    assert not twists[:6].any()
    expected = -np.linalg.solve(H[6:, 6:], g[6:])
    np.testing.assert_allclose(np.concatenate([twists[6:], moves.ravel()]), expected, rtol=1e-6, atol=1e-9)
    equations.held[2, 1] = True  # then the others' as if it were not there
    rest = np.delete(np.arange(6, len(g)), 12 + 3 * 2 + 1)
    twists, moves = equations.move(damping)
    assert moves[2, 1] == 0.0
    expected = -np.linalg.solve(H[np.ix_(rest, rest)], g[rest])
    np.testing.assert_allclose(np.delete(np.concatenate([twists[6:], moves.ravel()]), 12 + 7), expected, rtol=1e-6, atol=1e-9)
    problem.options = AdjustmentOptions(free_cameras=False)
    twists, moves = problem.linearize(T, points).move(damping)
    assert not twists.any()
    np.testing.assert_allclose(moves.ravel(), -np.linalg.solve(H[18:, 18:], g[18:]), rtol=1e-6, atol=1e-9)


def test_the_matrix_is_that_of_weighted_residuals_by_differences():
    problem, _ = small_problem(3, robust_scale_px=5.0)
    rng = np.random.default_rng(5)
    T, points = problem.given_Ts_cam_world, problem.start_points + 0.01 * rng.normal(size=problem.start_points.shape)
    problem.weights = rng.uniform(0.2, 1.0, problem.weights.shape)

    def residuals(x: np.ndarray) -> np.ndarray:
        moved = np.array([se3.exp(x[6 * i : 6 * i + 6]) @ T[i] for i in range(3)])
        return problem._residuals(moved, points + x[18:].reshape(-1, 3))[0]

    base, h = residuals(np.zeros(27)), 1e-6
    J = np.array([(residuals(h * e) - residuals(-h * e)) / (2.0 * h) for e in np.eye(27)])
    weights = problem.weights / (25.0 + np.sum(base**2, axis=-1))
    expected = np.einsum("xncr,nc,yncr->xy", J, weights, J)
    precision = np.repeat([1.0 / 0.5**2, 1.0 / 0.2**2], 3)
    expected[np.arange(18), np.arange(18)] += np.tile(precision, 3)
    found, _ = dense(problem.linearize(T, points), 0.0)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_the_derivative_of_a_pose_error_is_right_to_the_second_order():
    rng = np.random.default_rng(6)
    for _ in range(10):
        twist, h = 0.05 * rng.normal(size=6), 1e-6
        numeric = np.column_stack([(se3.log(se3.exp(h * e) @ se3.exp(twist)) - twist) / h for e in np.eye(6)])
        np.testing.assert_allclose(_log_derivative(twist), numeric, atol=2e-5)


def test_it_says_when_it_has_not_arrived():
    rig = circle_rig()
    _, seen = observations(rig, 40)
    once = adjust(disturbed(rig), seen, AdjustmentOptions(max_iterations=1))
    assert (once.iterations, once.converged) == (1, False)
    loose = adjust(disturbed(rig), seen, AdjustmentOptions(tolerance=0.9999))
    assert loose.converged and loose.iterations < adjust(disturbed(rig), seen).iterations
    exact = adjust(rig, seen)
    assert exact.converged and exact.cost == pytest.approx(0.0, abs=1e-12)


def test_what_a_camera_has_not_seen_leaves_no_residual():
    rig = circle_rig()
    _, seen = observations(rig, 20)
    weights = seen.weights.copy()
    weights[3, 1] = 0.0
    pixels = seen.pixels.copy()
    pixels[3, 1] += 500.0
    result = adjust(rig, PointObservations(pixels, weights))
    assert not result.residuals_px[3, 1].any() and np.abs(result.residuals_px).max() < 1e-6 and result.valid.all()


def test_two_cameras_are_enough_for_a_point():
    rig = circle_rig()
    points, seen = observations(rig, 12)
    weights = seen.weights.copy()
    weights[4, 2:] = 0.0
    result = adjust(rig, PointObservations(seen.pixels, weights))
    assert result.valid.all()
    np.testing.assert_allclose(result.points, points, atol=1e-6)
