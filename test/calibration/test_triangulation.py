"""Triangulation finds points again from their exact pixels, and says where it cannot."""

import numpy as np
from camera_rigs import circle_rig

from tracker_node.calibration.triangulation import reproject, triangulate


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
