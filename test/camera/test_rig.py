
import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig, epipolar_curve
from tracker_node.errors import UnknownNameError
from tracker_node.geometry import se3

MODEL = CameraModel(640, 480, np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]]))


def camera(name, twist=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)):
    return Camera(name, MODEL, se3.exp(np.array(twist)))


def test_world_points_go_through_the_inverse_of_the_pose():
    there = camera("a", (0.3, -0.2, -2.0, 0.2, -0.1, 0.4))
    point = np.array([0.1, 0.2, 0.3])
    pixel, valid = there.project(point)
    expected, _ = MODEL.project(se3.inverse(there.T_world_cam)[:3] @ np.append(point, 1.0))
    assert valid
    assert np.allclose(pixel, expected)
    assert np.allclose(se3.apply(there.T_cam_world, there.center), 0.0)
    assert there.frame_id == "a_optical_frame"


def test_order_and_names():
    rig = CameraRig((camera("a"), camera("b"), camera("c")))
    assert rig.names == ("a", "b", "c")
    assert rig.subset(["c", "a"]).names == ("c", "a")
    assert rig["b"] is rig.cameras[1]
    with pytest.raises(UnknownNameError, match="'d'; valid: a, b, c"):
        rig["d"]
    with pytest.raises(ValueError, match="unique"):
        CameraRig((camera("a"), camera("a")))


def test_a_pose_must_be_rigid_and_cannot_be_changed():
    with pytest.raises(ValueError, match="rigid"):
        Camera("a", MODEL, np.diag([1.0, 1.0, -1.0, 1.0]))
    with pytest.raises(ValueError, match="read-only"):
        camera("a").T_world_cam[0, 0] = 2.0


def distance_to(curve, pixel):
    """Of a pixel from a line of straight pieces."""
    start, along = curve[:-1], np.diff(curve, axis=0)
    share = np.clip(((pixel - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.linalg.norm(start + share[:, None] * along - pixel, axis=1).min()


@pytest.mark.parametrize("lens", sorted(LENSES))
def test_the_curve_passes_where_the_point_is_seen(lens):
    a = look_at((2.0, 0.3, 1.2), (0.0, 0.0, 0.8), LENSES[lens])
    b = look_at((-0.6, 2.1, 1.0), (0.0, 0.0, 0.8), LENSES[lens])
    for point in np.random.default_rng(0).uniform((-0.3, -0.3, 0.5), (0.3, 0.3, 1.1), (10, 3)):
        (pixel_a, _), (pixel_b, _) = a.project(point), b.project(point)
        assert distance_to(epipolar_curve(a, pixel_a, b), pixel_b) < 0.05


def test_a_ray_that_is_not_in_view_has_no_curve():
    a = look_at((2.0, 0.0, 1.0), (3.0, 0.0, 1.0), LENSES["plain"])
    b = look_at((-2.0, 0.0, 1.0), (-3.0, 0.1, 1.0), LENSES["plain"])
    assert epipolar_curve(a, np.array([80.0, 60.0]), b).shape == (0, 2)


def test_other_sources_keep_the_rest_and_unknown_cameras_are_refused():
    """Of four ways to give sources two left out a camera that the rig does not have, without a word."""
    rig = CameraRig((camera("cam01"), camera("cam02")), "floor", (Light("ambient"),))
    changed = rig.with_sources({"cam02": "b.mp4"})
    assert [camera.source for camera in changed] == [None, "b.mp4"] and changed.names == rig.names
    assert (changed.world_frame, changed.lights) == ("floor", rig.lights)
    assert [camera.source for camera in changed.with_sources({"cam02": None})] == [None, None]
    with pytest.raises(UnknownNameError, match="unknown camera 'cam03'; valid: cam01, cam02"):
        rig.with_sources({"cam01": "a.mp4", "cam03": "c.mp4"})
