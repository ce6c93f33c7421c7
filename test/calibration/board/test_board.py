import cv2
import numpy as np
import pytest

from helpers.cameras.board_scenes import CHARUCO, CHESSBOARD, picture, ring
from tracker_node.calibration.board.board import Board, BoardDetector
from tracker_node.calibration.board.views import CameraViews, detect_boards, with_board, without_blur
from tracker_node.camera.rig import Camera
from tracker_node.errors import CalibrationError
from tracker_node.geometry import se3, so3
from tracker_node.loaders.images.source import open_source

SMALL = Board("charuco", 5, 4, 0.12, inverted=True)


def held_towards(camera, turn=(0.35, -0.25, 0.4), distance=2.0):
    """T_world_board of a board in the middle of the view, not quite facing the camera."""
    facing = np.diag([1.0, -1.0, -1.0]) @ so3.exp(turn)
    return camera.T_world_cam @ se3.from_rotation_translation(facing, np.array([0.05, -0.03, distance]))


@pytest.mark.parametrize("board", [CHARUCO, CHESSBOARD, SMALL], ids=["charuco", "chessboard", "inverted"])
@pytest.mark.parametrize("kind", ["plumb_bob", "equidistant"])
def test_corners_are_where_the_board_is(board, kind):
    camera = ring(1, [kind]).cameras[0]
    T = held_towards(camera)
    view = BoardDetector(board).find(picture(camera, board, T))
    expected, _ = camera.project(se3.apply(T, board.corners[view.ids]))
    errors = np.linalg.norm(view.pixels - expected, axis=1)
    assert len(view.ids) > 0.8 * len(board.corners)
    assert np.median(errors) < 0.1 and np.sqrt(np.mean(errors**2)) < 0.2
    assert 1.0 < view.edge_px < 4.0


@pytest.mark.parametrize("angle", [90.0, 180.0, 250.0])
def test_a_chessboard_is_numbered_alike_however_it_is_turned(angle):
    camera = ring(1, ["plumb_bob"]).cameras[0]
    T = held_towards(camera, (0.2, 0.1, np.radians(angle)))
    view = BoardDetector(CHESSBOARD).find(picture(camera, CHESSBOARD, T))
    expected, _ = camera.project(se3.apply(T, CHESSBOARD.corners))
    assert np.abs(view.pixels - expected).max() < 0.5


def test_large_images_are_searched_small_and_refined_in_full():
    camera = ring(1, ["none"]).cameras[0]
    T = held_towards(camera)
    image = cv2.resize(picture(camera, CHESSBOARD, T), None, fx=2.0, fy=2.0, interpolation=cv2.INTER_CUBIC)
    view = BoardDetector(CHESSBOARD).find(image)
    expected, _ = camera.model.resized(2560, 1600).project(se3.apply(camera.T_cam_world @ T, CHESSBOARD.corners))
    assert np.abs(view.pixels - expected).max() < 0.5


def test_no_board_or_too_little_of_it_is_none():
    camera = ring(1, ["none"]).cameras[0]
    image = picture(camera, CHARUCO, held_towards(camera))
    assert BoardDetector(CHARUCO).find(np.full((480, 640), 128, dtype=np.uint8)) is None
    assert BoardDetector(CHESSBOARD).find(image) is None
    view = BoardDetector(CHARUCO).find(image)
    low, high = view.pixels[:, 1].min(), view.pixels[:, 1].max()
    image[int(low + 0.12 * (high - low)) :] = 128
    assert BoardDetector(CHARUCO).find(image) is None


@pytest.mark.parametrize("direction", [0, 1])
def test_motion_blur_shows_in_any_direction(direction):
    camera = ring(1, ["none"]).cameras[0]
    image = picture(camera, CHARUCO, held_towards(camera, (0.1, -0.1, 0.05), 1.7))
    sharp = BoardDetector(CHARUCO).find(image)
    kernel = np.zeros((7, 7))
    kernel[(3, slice(None)) if direction == 0 else (slice(None), 3)] = 1.0 / 7.0
    blurred = BoardDetector(CHARUCO).find(cv2.filter2D(image, -1, kernel))
    assert blurred.edge_px > 1.8 * sharp.edge_px
    kept, left_out = without_blur([sharp] * 5 + [blurred])
    assert kept == [sharp] * 5 and left_out == 1


def test_a_board_that_looks_the_same_upside_down_is_known():
    assert Board("chessboard", 9, 7, 0.03).turns_unseen and not CHESSBOARD.turns_unseen and not CHARUCO.turns_unseen
    with pytest.raises(ValueError, match="one of"):
        Board("dots", 4, 4, 0.1)


def film(folder, name, images):
    (folder / name).mkdir()
    for i, image in enumerate(images):
        cv2.imwrite(str(folder / name / f"{i:03d}.png"), image)
    return open_source(folder / name)


def test_all_cameras_are_searched_and_long_recordings_in_bursts(tmp_path):
    cameras = ring(2, ["plumb_bob"]).cameras
    images = [cv2.resize(picture(c, SMALL, held_towards(c)), (640, 400)) for c in cameras]
    sources = {c.name: film(tmp_path, c.name, [image] * 20) for c, image in zip(cameras, images, strict=True)}
    told = []
    seen = detect_boards(sources, SMALL, 6, lambda *progress: told.append(progress))
    for found in seen.values():
        assert isinstance(found, CameraViews) and found.image_size == (640, 400)
        assert 5 <= found.n_searched <= 8 and len(found.views) == found.n_searched
        numbers = [view.image for view in found.views]
        assert numbers[:3] == [0, 1, 2] and np.diff(numbers).max() > 5
    assert [v.image for v in seen["cam1"].views] == [v.image for v in seen["cam2"].views]
    assert told[-1][1:] == (40, 40)


def test_a_camera_without_the_board_is_named(tmp_path):
    sources = {"left": film(tmp_path, "left", [np.full((120, 160), 90, dtype=np.uint8)] * 3)}
    seen = detect_boards(sources, SMALL)
    with pytest.raises(CalibrationError, match=r"'left': the board \(charuco 5x4.*in none of its 3 images"):
        with_board(seen, SMALL, 1)


def smaller(camera: Camera) -> Camera:
    return Camera(camera.name, camera.model.resized(640, 400), camera.T_world_cam)


def test_the_mirrored_back_of_a_board_is_recognized_and_not_measured_from(tmp_path):
    """As through thin paper, or printed on the other side so that both lie on each other."""
    camera = smaller(ring(1, ["plumb_bob"]).cameras[0])
    front = picture(camera, SMALL, held_towards(camera))
    back = np.ascontiguousarray(front[:, ::-1])
    assert BoardDetector(SMALL).find(back) is None and BoardDetector(SMALL).sees_back(back)
    assert not BoardDetector(SMALL).sees_back(front)
    sources = {"both": film(tmp_path, "both", [front, back] * 3), "behind": film(tmp_path, "behind", [back] * 6)}
    seen, left_out = with_board(detect_boards(sources, SMALL), SMALL, 1)
    assert len(seen["both"].views) == 3 and 1 <= seen["both"].backs <= 3
    assert list(seen) == ["both"] and "its mirrored back is" in left_out["behind"]
    with pytest.raises(CalibrationError, match=r"'behind'.*mirrored back"):
        with_board(seen | {"behind": CameraViews((640, 400), (), 6, backs=2)}, SMALL, 2)


def test_corners_that_turn_the_other_way_are_no_view():
    """What markers of a mirrored print are taken for by chance: the numbers of the other side."""
    camera = smaller(ring(1, ["plumb_bob"]).cameras[0])
    detector = BoardDetector(SMALL)
    view = detector.find(picture(camera, SMALL, held_towards(camera)))
    columns, rows = SMALL.grid
    swapped = (np.arange(columns * rows).reshape(rows, columns)[:, ::-1]).ravel()
    detector._charuco_corners = lambda gray: (swapped[view.ids], view.pixels)
    assert view is not None and detector.find(np.zeros((800, 1280), np.uint8)) is None


def test_images_of_another_size_are_left_out_and_named(tmp_path):
    images = [np.zeros((120, 160), dtype=np.uint8)] * 2 + [np.zeros((240, 320), dtype=np.uint8)]
    found = detect_boards({"left": film(tmp_path, "left", images)}, SMALL)["left"]
    (problem,) = found.problems
    assert found.n_searched == 2 and "is of 320x240 pixels, not 160x120" in problem
