"""Triangulation finds points again from their exact pixels, and says where it cannot."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.points.triangulation import reproject, triangulate
from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3, so3


def _rig_arrays(rig):
    return [camera.model for camera in rig], np.array([camera.T_world_cam for camera in rig])


def test_exact_pixels_give_the_points_back():
    rig = circle_rig()
    models, transforms = _rig_arrays(rig)
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 0.2], [0.5, 0.5, 1.8], (50, 3))
    pixels, visible = reproject(models, transforms, points)
    found, valid = triangulate(models, transforms, pixels, visible.astype(float))
    assert visible.all() and valid.all()
    np.testing.assert_allclose(found, points, atol=1e-9)


def test_one_view_or_parallel_rays_are_not_enough():
    rig = circle_rig()
    models, transforms = _rig_arrays(rig)
    pixels, _ = reproject(models, transforms, np.zeros((2, 3)))
    weights = np.zeros((2, 4))
    weights[0, 2] = 1.0
    weights[1, :2] = 1.0
    same_place = np.stack([transforms[0], transforms[0], transforms[2], transforms[3]])
    found, valid = triangulate(models, same_place, pixels[:, [0, 0, 2, 3]], weights)
    assert not valid.any()
    assert not found.any()


def test_weights_decide_between_contradicting_cameras():
    rig = circle_rig()
    models, transforms = _rig_arrays(rig)
    point = np.array([[0.1, -0.2, 1.1]])
    pixels, _ = reproject(models, transforms, point)
    pixels[0, 3] += 80.0
    even, _ = triangulate(models, transforms, pixels, np.ones((1, 4)))
    trusting, _ = triangulate(models, transforms, pixels, np.array([[1.0, 1.0, 1.0, 1e-6]]))
    assert np.linalg.norm(even - point) > 0.02
    assert np.linalg.norm(trusting - point) < 1e-4


def two_rays(degrees: float, n_unseen: int = 0):
    """Cameras a meter to the left and right of where their middle pixels' rays meet at this angle, and some that see nothing."""
    half = np.radians(degrees) / 2.0
    lens = CameraModel(640, 480, np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]))
    target, transforms = np.array([0.2, -0.1, 0.4]), []
    for turn in (half, -half, *[0.3] * n_unseen):
        R = so3.exp(np.array([0.0, turn, 0.0]))
        transforms.append(se3.from_rotation_translation(R, target - 2.0 * R[:, 2]))
    weights = np.array([[1.0, 1.0, *[0.0] * n_unseen]])
    pixels = np.tile([320.0, 240.0], (1, len(transforms), 1))
    return target, triangulate([lens] * len(transforms), np.array(transforms), pixels, weights)


@pytest.mark.parametrize("n_unseen", [0, 2])
def test_two_rays_meet_from_an_angle_of_1_6_degrees_on(n_unseen):
    """1 - cos(angle) is the smallest eigenvalue, 4 the trace."""
    target, (points, valid) = two_rays(1.7, n_unseen)
    assert valid.all()
    np.testing.assert_allclose(points[0], target, atol=1e-9)
    _, (points, valid) = two_rays(1.5, n_unseen)
    assert not valid.any() and not points.any()


def test_no_camera_or_one_gives_no_point():
    models, transforms = _rig_arrays(circle_rig())
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (30, 3))
    pixels, _ = reproject(models, transforms, points)
    weights = np.zeros((30, 4))
    weights[np.arange(1, 30), np.arange(1, 30) % 4] = np.random.default_rng(3).uniform(1e-6, 10.0, 29)
    assert not triangulate(models, transforms, pixels, weights)[1].any()


def test_where_two_rays_pass_each_other_the_point_lies_between_by_their_weights():
    """Perpendicular rays along x and y, 0.3 apart in z: the weighted mean of their feet."""
    lens = CameraModel(640, 480, np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]))
    along_x = se3.from_rotation_translation(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.array([-2.0, 0.5, 0.0]))
    along_y = se3.from_rotation_translation(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.array([0.7, -3.0, 0.3]))
    pixels = np.tile([320.0, 240.0], (1, 2, 1))
    points, valid = triangulate([lens, lens], np.array([along_x, along_y]), pixels, np.array([[1.0, 2.0]]))
    assert valid.all()
    np.testing.assert_allclose(points, [[0.7, 0.5, 0.2]], atol=1e-12)
