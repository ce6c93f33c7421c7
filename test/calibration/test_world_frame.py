"""Changes of the world: onto axes, onto points, upright; and what they do to cameras and lights."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.world_frame import (
    WorldChange,
    onto_axes,
    onto_points,
    scaled,
    seen_points,
    tilt_deg,
    upright,
)
from tracker_node.camera.light import Light
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import CalibrationError, TrackerError, UnknownNameError
from tracker_node.geometry import so3

TURN = so3.exp([0.3, -0.5, 0.7])
MOVE = np.array([1.0, -2.0, 0.5])
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
RIG = circle_rig(3)


def test_points_are_turned_scaled_and_moved():
    change = WorldChange(TURN, MOVE, 2.0)
    np.testing.assert_allclose(change.points(CORNERS[1]), 2.0 * TURN[:, 0] + MOVE)
    np.testing.assert_allclose(change.points(CORNERS)[3], 6.0 * TURN[:, 2] + MOVE)


def test_cameras_see_points_of_the_new_world_where_they_saw_the_old():
    change = WorldChange(TURN, MOVE, 2.0)
    point = np.array([0.2, 0.3, 1.1])
    for old, new in zip(RIG, change.rig(RIG), strict=True):
        np.testing.assert_allclose(new.project(change.points(point))[0], old.project(point)[0], atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(new.center - change.points(point)), 2.0 * np.linalg.norm(old.center - point))


def test_lights_go_with_the_world():
    spot = Light("spot", (1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0), direction=(0.0, 0.0, -1.0), half_angle=0.3)
    sun = Light("directional", (1.0, 1.0, 1.0), direction=(0.0, 0.0, -1.0))
    rig = WorldChange(TURN, MOVE, 2.0).rig(CameraRig(RIG.cameras, lights=(spot, sun, Light("ambient", (0.1, 0.1, 0.1)))))
    np.testing.assert_allclose(rig.lights[0].position, 2.0 * TURN[:, 0] + MOVE)
    np.testing.assert_allclose(rig.lights[0].direction, -TURN[:, 2])
    assert rig.lights[1].position is None
    assert rig.lights[2].direction is None


@pytest.mark.parametrize("scale", [1.0, 1.7])
def test_points_are_fitted(scale):
    targets = WorldChange(TURN, MOVE, scale).points(CORNERS)
    change = onto_points(CORNERS, targets, with_scale=True)
    assert change.scale == pytest.approx(scale)
    np.testing.assert_allclose(change.rotation, TURN, atol=1e-12)
    np.testing.assert_allclose(change.translation, MOVE, atol=1e-12)
    np.testing.assert_allclose(change.residuals_m, 0.0, atol=1e-12)


def test_without_a_scale_the_middles_lie_on_each_other():
    """Points twice as far apart as given: the residual of each is its distance from the middle."""
    change = onto_points(2.0 * CORNERS, CORNERS)
    assert change.scale == 1.0
    np.testing.assert_allclose(change.points(2.0 * CORNERS).mean(axis=0), CORNERS.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(change.residuals_m, np.linalg.norm(CORNERS - CORNERS.mean(axis=0), axis=1), atol=1e-12)


def test_a_mirror_image_is_turned_never_mirrored():
    rotation = onto_points(CORNERS, CORNERS * [1.0, 1.0, -1.0]).rotation
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    flat = CORNERS[:3]
    np.testing.assert_allclose(onto_points(flat, flat).rotation, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("points", [CORNERS[:2], np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]), np.ones((4, 3))])
def test_points_on_a_line_are_refused(points):
    good = CORNERS[: len(points)]
    with pytest.raises(TrackerError, match="as seen"):
        onto_points(points, good)
    if len(points) > 2:
        with pytest.raises(TrackerError, match="as given"):
            onto_points(good, points)


def test_axes_are_right_handed_and_start_at_the_origin():
    """The point on y need not be at a right angle."""
    origin = np.array([1.0, 1.0, 1.0])
    on_x, on_y = origin + np.array([0.0, 2.0, 0.0]), origin + np.array([-3.0, 5.0, 0.0])
    change = onto_axes(origin, on_x, on_y)
    np.testing.assert_allclose(change.points(origin), 0.0, atol=1e-12)
    np.testing.assert_allclose(change.points(on_x), [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(change.points(on_y), [5.0, 3.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(change.points(origin + np.array([0.0, 0.0, 1.0])), [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("on_x", "on_y", "problem"),
    [((0, 0, 0), (0, 1, 0), "point on x"), ((1, 0, 0), (0, 0, 0), "point on y"), ((1, 0, 0), (-2, 0, 0), "one line")],
)
def test_axes_that_are_none_are_refused(on_x, on_y, problem):
    with pytest.raises(TrackerError, match=problem):
        onto_axes(np.zeros(3), np.array(on_x, dtype=float), np.array(on_y, dtype=float))


@pytest.mark.parametrize("up", [(0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0.0, 3.0, 0.0), (0.5, -0.2, 0.1), (-1.0, 0.0, -1.0)])
def test_upright_is_the_smallest_turn(up):
    up = np.array(up)
    rotation = upright(up).rotation
    np.testing.assert_allclose(rotation @ up / np.linalg.norm(up), [0.0, 0.0, 1.0], atol=1e-12)
    assert np.degrees(np.linalg.norm(so3.log(rotation))) == pytest.approx(tilt_deg(up), abs=1e-5)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(("up", "degrees"), [((0, 0, 5), 0.0), ((3, 0, 3), 45.0), ((0, 1, 0), 90.0), ((0, 0, -1), 180.0)])
def test_tilts_are_to_the_vertical(up, degrees):
    assert tilt_deg(np.array(up, dtype=float)) == pytest.approx(degrees)


def test_a_vertical_without_length_is_refused():
    for function in (upright, tilt_deg):
        with pytest.raises(TrackerError, match="no length"):
            function(np.zeros(3))


def test_lengths_are_multiplied_about_the_origin():
    np.testing.assert_allclose(scaled(2.5).points(CORNERS), 2.5 * CORNERS)


def clicks(point, *names):
    return {name: {"p": RIG[name].project(point)[0]} for name in names}


def test_points_are_found_where_cameras_see_them():
    point, names = np.array([0.1, 0.2, 1.0]), RIG.names
    seen = seen_points(RIG, clicks(point, *names[:2]))["p"]
    np.testing.assert_allclose(seen.place, point, atol=1e-6)
    assert seen.worst_px < 1e-3
    off = clicks(point, *names)
    off[names[2]]["p"] = off[names[2]]["p"] + np.array([8.0, 6.0])
    worst = seen_points(RIG, off)["p"].worst_px
    assert 4.0 < worst < 10.0  # of the camera that is off by ten, less what the point gives way


def test_a_point_of_one_camera_is_refused_by_name():
    with pytest.raises(CalibrationError, match=r"cam02.*point 'p' has to be seen by another camera"):
        seen_points(RIG, clicks(np.zeros(3), "cam02"))


def test_a_pixel_beside_the_image_is_refused():
    beside = clicks(np.zeros(3), "cam02", "cam03")
    beside["cam03"]["p"] = np.array([1e4, 20.5])
    with pytest.raises(CalibrationError, match=r"cam03.*point 'p': expected a pixel of its image of \d+x\d+, got 10000, 20.5"):
        seen_points(RIG, beside)


def test_cameras_that_are_not_there_are_refused():
    with pytest.raises(UnknownNameError, match="other"):
        seen_points(RIG, {"other": {}})
