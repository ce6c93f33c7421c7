"""The world of a rig from files of clicks: what gives the frame, what the scale, and what is only measured."""

import cv2
import numpy as np
import pytest

from helpers.cameras import board_films
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.board.board import Board
from tracker_node.calibration.world_fit import WorldEvidence, board_points, fit_world, with_world
from tracker_node.calibration.world_frame import WorldChange
from tracker_node.errors import FileFormatError, SourceError, TrackerError, UnknownNameError
from tracker_node.geometry import so3
from tracker_node.loaders.rig.control_points import ControlPoints, dump_clicks, dump_control_points
from tracker_node.loaders.rig.rig_yaml import build_rig, rig_file_of

RIG = circle_rig(3)
SCALED = WorldChange(so3.exp([0.3, -0.5, 0.7]), np.array([1.0, -2.0, 0.5]), 1.1)
PLACES = {"a": (0.3, 0.2, 0.1), "b": (-0.4, 0.3, 0.2), "c": (0.1, -0.5, 0.4), "d": (0.0, 0.1, -0.3)}


def clicks(tmp_path, name, places):
    """A file of where the cameras see the places."""
    pixels = {camera.name: {point: camera.project(np.array([at]))[0][0] for point, at in places.items()} for camera in RIG}
    dump_clicks(pixels, tmp_path / name)
    return tmp_path / name


@pytest.fixture
def points(tmp_path):
    at = np.array(list(PLACES.values()))
    dump_control_points({c.name: ControlPoints(tuple(PLACES), at, c.project(at)[0]) for c in RIG}, tmp_path / "points.csv")
    return tmp_path / "points.csv"


@pytest.fixture
def wand(tmp_path):
    return clicks(tmp_path, "wand.csv", {"1a": (0, 0, 0.1), "1b": (0.5, 0, 0.1), "2a": (0, 0.2, 0), "2b": (0, 0.2, 0.52)})


def test_control_points_give_the_frame_and_on_request_the_scale(points):
    kept, fitted = (fit_world(SCALED.rig(RIG), WorldEvidence(points=points, fit_scale=scale)) for scale in (False, True))
    assert kept.points.scale == fitted.points.scale == pytest.approx(1.0 / 1.1)
    assert kept.points.n_points == 4 and kept.points.rms_m > 0.01 and kept.points.worst in PLACES
    assert fitted.points.rms_m < 1e-6 and fitted.points.worst_px < 1e-3
    for found, true in zip(fitted.rig, RIG, strict=True):
        np.testing.assert_allclose(found.T_world_cam, true.T_world_cam, atol=1e-6)
    assert kept.wand is None and kept.tilt_deg is None


def test_another_unit_is_refused(points):
    millimeters = WorldChange(np.eye(3), np.zeros(3), 1000.0).rig(RIG)
    with pytest.raises(TrackerError, match="not in meters"):
        fit_world(millimeters, WorldEvidence(points=points))


def test_a_wand_scales_unless_points_have_done_so(points, wand):
    alone = fit_world(SCALED.rig(RIG), WorldEvidence(wand=wand, wand_m=0.51))
    np.testing.assert_allclose(alone.wand.lengths_m, [0.55, 0.572], atol=1e-6)
    assert alone.wand.applied and alone.wand.factor == pytest.approx(0.51 / alone.wand.length_m)
    centers = [np.linalg.norm(fit[1].center - fit[0].center) for fit in (alone.rig.cameras, SCALED.rig(RIG).cameras)]
    assert centers[0] == pytest.approx(alone.wand.factor * centers[1])
    both = fit_world(SCALED.rig(RIG), WorldEvidence(points=points, fit_scale=True, wand=wand, wand_m=2.0))
    assert not both.wand.applied
    np.testing.assert_allclose(both.rig.cameras[0].center, RIG.cameras[0].center, atol=1e-6)


def test_a_plumb_line_turns_a_rig_without_a_frame_and_checks_one_with(tmp_path):
    tilt = np.radians(4.0)
    plumb = clicks(tmp_path, "plumb.csv", {"top": (0.1, 0.1 + 0.7 * np.sin(tilt), 0.7 * np.cos(tilt)), "bottom": (0.1, 0.1, 0.0)})
    alone = fit_world(RIG, WorldEvidence(plumb=plumb))
    assert alone.tilt_deg == pytest.approx(4.0, abs=1e-4)
    assert not np.allclose(alone.rig.cameras[0].T_world_cam, RIG.cameras[0].T_world_cam, atol=1e-3)
    checked = fit_world(RIG, WorldEvidence(up=np.array([0.0, 0.0, 1.0]), plumb=plumb))
    assert checked.tilt_deg == pytest.approx(4.0, abs=1e-4)
    np.testing.assert_allclose(checked.rig.cameras[0].T_world_cam, RIG.cameras[0].T_world_cam, atol=1e-12)


def test_missing_points_are_named(tmp_path):
    two = clicks(tmp_path, "axes.csv", {"origin": (0, 0, 0), "x": (0.2, 0, 0)})
    with pytest.raises(FileFormatError, match="a point named 'y'"):
        fit_world(RIG, WorldEvidence(axes=two))
    with pytest.raises(FileFormatError, match="two ends at least"):
        fit_world(RIG, WorldEvidence(wand=two, wand_m=1.0))


def test_boards_that_give_no_frame(tmp_path):
    with pytest.raises(TrackerError, match="the same upside down"):
        board_points(RIG, Board("chessboard", 4, 4, 0.04), {})
    with pytest.raises(SourceError, match="cannot be read"):
        board_points(RIG, Board("chessboard", 5, 4, 0.04), {RIG.names[0]: tmp_path / "none.png"})


def test_images_of_a_board_that_one_camera_has_taken_or_in_another_size(tmp_path):
    rig, lies = board_films.rig(), board_films.pose(0.4)
    image = board_films.image_of(rig.cameras[0], board_films.CARRIED, lies)
    for name, picture in (("small", image), ("large", cv2.resize(image, None, fx=2.0, fy=2.0))):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture)
    with pytest.raises(TrackerError, match="from two cameras, of the same corners, got cam01"):
        board_points(rig, board_films.CARRIED, {"cam01": tmp_path / "small.png"})
    with pytest.raises(SourceError, match="image of 480x300, for which the lens of camera 'cam01' is, got 960x600"):
        board_points(rig, board_films.CARRIED, {"cam01": tmp_path / "large.png"})
    with pytest.raises(UnknownNameError, match="unknown camera 'plan'"):
        board_points(rig, board_films.CARRIED, {"plan": tmp_path / "small.png"})


def test_only_places_of_a_rig_file_change():
    file = rig_file_of(RIG).with_cameras({name: {"time_offset_s": 0.25} for name in RIG.names})
    changed = with_world(file, SCALED.rig(RIG))
    assert all(entry.time_offset_s == 0.25 for entry in changed.cameras.values())
    for camera, moved in zip(build_rig(changed, "."), SCALED.rig(RIG), strict=True):
        np.testing.assert_allclose(camera.T_world_cam, moved.T_world_cam, atol=1e-9)
