"""Cameras from control points, against the cameras that saw them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.optimize import dual_annealing

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.points import dlt
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.errors import CalibrationError
from tracker_node.geometry import se3, so3
from tracker_node.loaders.rig.control_points import ControlPoints

POINTS = np.random.default_rng(5).uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0], size=(20, 3))
SKEWED = np.array([[900.0, 4.0, 331.0], [0.0, 870.0, 225.0], [0.0, 0.0, 1.0]])
SQUARE = np.array([[900.0, 0.0, 331.0], [0.0, 900.0, 225.0], [0.0, 0.0, 1.0]])


def camera(K=SKEWED, i=1) -> Camera:
    return replace(circle_rig().cameras[i], model=CameraModel(640, 480, K))


@pytest.mark.parametrize("i", range(4))
def test_exact_pixels_give_the_camera_back(i):
    true = camera(i=i)
    found = dlt.calibrate("left", POINTS, true.project(POINTS)[0], (640, 480))
    np.testing.assert_allclose(found.camera.model.K, SKEWED, atol=1e-5)
    np.testing.assert_allclose(found.camera.T_world_cam, true.T_world_cam, atol=1e-8)
    assert found.rms_px < 1e-7 and (found.camera.model.width, found.camera.model.height) == (640, 480)


def test_the_linear_solution_alone_is_exact_on_exact_pixels():
    true = camera()
    K, T_world_cam = dlt.decompose(dlt.solve_linear("left", POINTS, true.project(POINTS)[0]), POINTS)
    np.testing.assert_allclose(K, SKEWED, atol=1e-5)
    np.testing.assert_allclose(T_world_cam, true.T_world_cam, atol=1e-8)


def test_decomposition_agrees_with_opencv():
    P = dlt.solve_linear("left", POINTS, camera().project(POINTS)[0] + 0.3 * np.random.default_rng(1).normal(size=(20, 2)))
    K, T_world_cam = dlt.decompose(P, POINTS)
    K_cv, R_cv, center_cv, *_ = cv2.decomposeProjectionMatrix(P)
    np.testing.assert_allclose(np.abs(K), np.abs(K_cv / K_cv[2, 2]), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(T_world_cam[:3, 3], (center_cv[:3] / center_cv[3]).ravel(), atol=1e-8)
    assert np.linalg.det(T_world_cam[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(np.abs(T_world_cam[:3, :3].T), np.abs(R_cv), atol=1e-6)


def test_the_eleven_parameters_are_those_of_the_formula():
    true = camera()
    L = dlt.dlt_parameters(true)
    denominator = POINTS @ L[8:11] + 1.0
    pixels = np.column_stack([POINTS @ L[0:3] + L[3], POINTS @ L[4:7] + L[7]]) / denominator[:, None]
    np.testing.assert_allclose(pixels, true.project(POINTS)[0], atol=1e-8)


def noisy(K, sigma=1.0, seed=0):
    true = camera(K)
    return true, true.project(POINTS)[0] + sigma * np.random.default_rng(seed).normal(size=(20, 2))


def test_refinement_is_no_worse_than_the_linear_solution_and_fits_the_noise():
    _, pixels = noisy(SKEWED)
    K, T_world_cam = dlt.decompose(dlt.solve_linear("left", POINTS, pixels), POINTS)
    linear = Camera("linear", CameraModel(640, 480, K), T_world_cam)
    linear_rms = np.sqrt(((linear.project(POINTS)[0] - pixels) ** 2).sum(axis=1).mean())
    refined = dlt.calibrate("left", POINTS, pixels, (640, 480))
    assert refined.rms_px <= linear_rms + 1e-9
    # 40 residuals of one pixel and 11 parameters: the expected rms distance is sqrt(2 * 29 / 40)
    assert refined.rms_px == pytest.approx(np.sqrt(2 * 29 / 40), abs=0.35)


@pytest.mark.parametrize("constraint", list(dlt.CONSTRAINTS))
def test_constraints_hold_and_fewer_parameters_fit_less_closely(constraint):
    _, pixels = noisy(SQUARE)
    found = dlt.calibrate("left", POINTS, pixels, (640, 480), constraint)
    K = found.camera.model.K
    if constraint != "none":
        assert K[0, 1] == 0.0
    if constraint in ("square", "radial", "centered"):
        assert K[0, 0] == K[1, 1]
    if constraint == "centered":
        assert (K[0, 2], K[1, 2]) == (319.5, 239.5)
    more = "radial" if constraint in ("square", "radial") else "none"  # the only one with another parameter than the eleven
    assert found.rms_px >= dlt.calibrate("left", POINTS, pixels, (640, 480), more).rms_px - 1e-9


def barreled(i=1) -> Camera:
    return replace(camera(i=i), model=CameraModel(640, 480, SQUARE, "plumb_bob", np.array([-0.12, 0.0, 0.0, 0.0])))


def test_the_distortion_of_a_lens_is_found():
    true = barreled()
    pixels = true.project(POINTS)[0]
    found = dlt.calibrate("left", POINTS, pixels, (640, 480), "radial")
    np.testing.assert_allclose(found.camera.model.K, SQUARE, atol=1e-4)
    np.testing.assert_allclose(found.camera.model.distortion, [-0.12, 0.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.camera.T_world_cam, true.T_world_cam, atol=1e-7)
    assert found.rms_px < 1e-6 and dlt.calibrate("left", POINTS, pixels, (640, 480)).rms_px > 0.1
    rough = pixels + np.random.default_rng(0).normal(size=pixels.shape)
    assert dlt.calibrate("left", POINTS, rough, (640, 480), "radial").camera.model.distortion[0] == pytest.approx(-0.12, abs=0.05)


def test_points_seen_through_bent_lenses_are_reconstructed():
    cameras, names = [barreled(i) for i in range(3)], tuple(map(str, range(20)))
    seen = {c.name: ControlPoints(names, POINTS, c.project(POINTS)[0]) for c in cameras}
    assert len(dlt.object_errors_m(cameras, seen)) == 20 and dlt.object_errors_m(cameras, seen).max() < 1e-6
    straight = [replace(c, model=CameraModel(640, 480, SQUARE)) for c in cameras]
    assert dlt.object_errors_m(straight, seen).max() > 1e-3


def test_the_seven_parameters_are_those_that_annealing_finds():
    """The paper finds the camera of seven parameters from that of eleven by simulated annealing: of all near it the best one."""
    _, pixels = noisy(SQUARE)
    found = dlt.calibrate("left", POINTS, pixels, (640, 480), "centered")
    of_eleven = dlt.calibrate("left", POINTS, pixels, (640, 480)).camera

    def cost(x: np.ndarray) -> float:
        f = of_eleven.model.K[0, 0] * (1.0 + x[0])
        lens = CameraModel(640, 480, np.array([[f, 0.0, 319.5], [0.0, f, 239.5], [0.0, 0.0, 1.0]]))
        seen, _ = Camera("left", lens, of_eleven.T_world_cam @ se3.exp(x[1:])).project(POINTS)
        return float(((seen - pixels) ** 2).sum())

    bounds = [(-0.2, 0.2), *[(-0.3, 0.3)] * 3, *[(-0.1, 0.1)] * 3]
    annealed = dual_annealing(cost, bounds, seed=1, maxiter=60)
    own = float((found.residuals_px**2).sum())
    assert own <= annealed.fun * (1.0 + 1e-9) and annealed.fun == pytest.approx(own, rel=1e-3)


def test_true_constraints_make_the_camera_better():
    others = np.random.default_rng(9).uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0], size=(200, 3))
    errors = {name: [] for name in ("none", "square")}
    for seed in range(12):
        true, pixels = noisy(SQUARE, seed=seed)
        for name, found in errors.items():
            seen = dlt.calibrate("left", POINTS, pixels, (640, 480), name).camera.project(others)[0]
            found.append(np.sqrt(((seen - true.project(others)[0]) ** 2).sum(axis=1).mean()))
    assert np.mean(errors["square"]) < np.mean(errors["none"]) < 1.0


def test_reconstruction_finds_points_from_exact_and_from_noisy_pixels():
    cameras = [camera(i=i) for i in range(3)]
    parameters = np.array([dlt.dlt_parameters(c) for c in cameras])
    pixels = np.stack([c.project(POINTS)[0] for c in cameras], axis=1)
    weights = np.ones((20, 3))
    weights[4] = [1.0, 0.0, 0.0]
    weights[5] = [0.0, 1.0, 1.0]
    points, valid = dlt.reconstruct(parameters, pixels, weights)
    np.testing.assert_array_equal(valid, np.arange(20) != 4)
    np.testing.assert_allclose(points[valid], POINTS[valid], atol=1e-9)
    rough, _ = dlt.reconstruct(parameters, pixels + np.random.default_rng(2).normal(size=pixels.shape), np.ones((20, 3)))
    assert np.sqrt(((rough - POINTS) ** 2).mean()) < 0.01


def test_parallel_rays_tell_no_point():
    """Of two cameras side by side, or of one twice, the point was anywhere on its ray, and called valid."""
    one, other = camera(i=0), camera(i=1)
    beside = replace(one, name="beside", T_world_cam=one.T_world_cam @ se3.from_rotation_translation(np.eye(3), [1e-3, 0.0, 0.0]))
    cameras = [one, one, beside, other]
    parameters, pixels = np.array([dlt.dlt_parameters(c) for c in cameras]), [c.project(POINTS)[0] for c in cameras]
    pixels = np.stack(pixels, axis=1) + np.random.default_rng(3).normal(size=(20, 4, 2))
    for chosen, told in (([1.0, 1.0, 0.0, 0.0], False), ([1.0, 0.0, 1.0, 0.0], False), ([1.0, 0.0, 1.0, 1.0], True)):
        points, valid = dlt.reconstruct(parameters, pixels, np.tile(chosen, (20, 1)))
        assert (valid == told).all() and (points.any(axis=1) == told).all()


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (POINTS[:5], "at least 6 control points, got 5"),
        (POINTS * [1.0, 1.0, 0.0] @ so3.exp([0.3, 0.2, 0.1]).T, "lie in one plane"),
        (np.repeat(POINTS[:3], 7, axis=0), "lie in one plane"),
        (np.repeat(POINTS[:5], 4, axis=0), "undetermined"),
    ],
)
def test_points_that_do_not_suffice_are_refused(points, problem):
    with pytest.raises(CalibrationError, match=problem):
        dlt.calibrate("left", points, camera().project(points)[0], (640, 480))


def test_a_mirrored_image_is_refused():
    pixels = camera().project(POINTS)[0] * [1.0, -1.0] + [0.0, 480.0]
    with pytest.raises(CalibrationError, match=r"camera 'left': .*mirrored"):
        dlt.calibrate("left", POINTS, pixels, (640, 480))


def test_clicks_of_no_camera_are_refused():
    """Clicks at random make a poor camera, or are refused by name; nothing else."""
    said = []
    for seed in (0, 3, 4, 13, 36):
        rng = np.random.default_rng(seed)
        try:
            found = dlt.calibrate("left", rng.uniform(-1.0, 1.0, (7, 3)), rng.uniform(0.0, 480.0, (7, 2)), (640, 480))
            assert found.rms_px > 5.0
        except CalibrationError as error:
            said.append(str(error))
    assert any("wrong place" in text for text in said) and all(text.startswith("camera 'left': ") for text in said)


def test_an_origin_beside_the_camera_has_no_parameters():
    at_origin = Camera("left", CameraModel(640, 480, SQUARE), np.eye(4))
    with pytest.raises(CalibrationError, match="move it"):
        dlt.dlt_parameters(at_origin)
