"""Points from clicks, against OpenCV's lenses and against the spread of simulated clicks."""

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.calibration.points.triangulation import reconstruct_point, repeatability

EYES = ((2.0, 0.3, 1.2), (-0.6, 2.1, 1.0), (-1.5, -1.6, 1.4))
RADIAL = [look_at(eye, (0.0, 0.0, 0.8), LENSES["radial"], f"cam{i}") for i, eye in enumerate(EYES)]
PLAIN = [look_at(eye, (0.0, 0.0, 0.8), LENSES["plain"], f"cam{i}") for i, eye in enumerate(EYES)]
POINT = np.array([0.12, -0.21, 0.93])


def opencv_pixels(cameras, point):
    """Where OpenCV sees a point; it knows no skew, which is put on behind."""
    found = []
    for camera in cameras:
        T, K = camera.T_cam_world, camera.model.K
        distortion = camera.model.distortion if camera.model.distortion.size else None
        seen, _ = cv2.projectPoints(point[None], cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], np.eye(3), distortion)
        found.append(K[:2, :2] @ seen[0, 0] + K[:2, 2])
    return np.array(found)


@pytest.mark.parametrize("cameras", [RADIAL, PLAIN])
def test_exact_clicks_give_the_point_back(cameras):
    found = reconstruct_point(cameras, opencv_pixels(cameras, POINT))
    np.testing.assert_allclose(found.position_m, POINT, atol=1e-7)
    np.testing.assert_allclose(found.residuals_px, 0.0, atol=1e-4)


def test_sigma_is_what_noisy_clicks_scatter_by():
    rng, exact = np.random.default_rng(4), opencv_pixels(PLAIN, POINT)
    found = [reconstruct_point(PLAIN, exact + 0.5 * rng.standard_normal(exact.shape), 0.5) for _ in range(400)]
    scatter = np.std([point.position_m for point in found], axis=0)
    np.testing.assert_allclose(scatter, found[0].sigma_m, rtol=0.15)


def test_two_views_leave_one_residual_and_one_view_no_point():
    pixels = opencv_pixels(RADIAL, POINT)
    off = reconstruct_point(RADIAL[:2], pixels[:2] + np.array([[0.0, 3.0], [0.0, -3.0]]))
    assert 0.5 < off.rms_px < 4.0
    assert reconstruct_point(RADIAL[:1], pixels[:1]) is None


def test_rays_that_part_have_no_point():
    pixels = opencv_pixels(PLAIN, POINT)
    assert reconstruct_point([PLAIN[0], PLAIN[0]], pixels[[0, 0]]) is None


def test_repeatability_is_the_noise_that_went_in():
    rng = np.random.default_rng(2)
    groups = [rng.uniform(0, 100, 2) + 0.7 * rng.standard_normal((n, 2)) for n in (2, 3) * 200]
    sigma, freedom = repeatability([*groups, np.zeros((1, 2))])
    assert freedom == 2 * 200 * (1 + 2)
    assert sigma == pytest.approx(0.7, rel=0.05)
    assert np.isnan(repeatability([np.zeros((1, 2))])[0])
    first, second = np.array([3.0, 4.0]), np.array([4.0, 2.0])
    rms = np.sqrt(np.mean((first - second) ** 2))
    assert repeatability([np.array([first, second])])[0] == pytest.approx(rms / np.sqrt(2.0))
