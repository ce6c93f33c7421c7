"""The command ``calibrate texture``, from pictures to a model that renders as OpenCV expects the board to look."""

import cv2
import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.cli.main import main
from tracker_node.geometry import se3
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.render.raycast.raycaster import render_color


@pytest.mark.parametrize("inverted", [False, True])
def test_a_drawn_board_is_recognised_where_the_model_says_it_is(tmp_path, inverted):
    path = tmp_path / "board.yaml"
    arguments = ["--charuco", "4x5", "--square", "0.04", "--border", "15", "--border-gray", "128", "--name", "board"]
    assert main(["calibrate", "texture", *arguments, *(["--inverted"] if inverted else []), "-o", str(path)]) == 0
    model = load_model(path)
    # One meter above the board, looking down: image x is the board's x, image y against its y
    camera = Camera("above", CameraModel(640, 480, np.array([[1500.0, 0, 320], [0, 1500.0, 240], [0, 0, 1]])),
                    se3.from_rotation_translation(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0])))  # fmt: skip
    rendered = render_color(Configuration(model, State.neutral(model)), camera)
    image = np.full((480, 640, 3), 128, dtype=np.uint8)
    u0, v0, u1, v1 = rendered.region
    crop = image[v0:v1, u0:u1]
    crop[rendered.labels > 0] = rendered.rgb[rendered.labels > 0].astype(np.uint8)
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000)
    board = cv2.aruco.CharucoBoard((4, 5), 0.04, 0.03, markers)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(255 - image if inverted else image)
    assert len(ids) == 12
    on_board = board.getChessboardCorners()[ids.ravel()] - [0.08, 0.1, 0.0]
    expected = np.array([320.0, 240.0]) + 1500.0 * on_board[:, :2]
    np.testing.assert_allclose(corners.reshape(-1, 2), expected, atol=0.5)


def test_a_picture_becomes_a_plate_of_its_shape(tmp_path, capsys):
    picture = tmp_path / "poster.png"
    cv2.imwrite(str(picture), np.random.default_rng(0).integers(0, 256, (30, 40, 3)).astype(np.uint8))
    path = tmp_path / "poster.yaml"
    assert main(["calibrate", "texture", "--image", str(picture), "--width", "0.8", "-o", str(path)]) == 0
    box = load_model(path).shapes[0].primitive
    np.testing.assert_allclose(box.size, (0.8, 0.6, 0.005))
    np.testing.assert_array_equal(box.textures[4][:, :, ::-1], cv2.imread(str(picture)))
    assert "800.0 x 600.0 mm" in capsys.readouterr().out


def test_a_model_that_is_there_stays_without_force(tmp_path, capsys):
    path = tmp_path / "plate.yaml"
    path.write_text("mine")
    command = ["calibrate", "texture", "--charuco", "4x5", "--square", "0.05", "-o", str(path)]
    assert main(command) == 2
    assert "--force to overwrite it" in capsys.readouterr().err and path.read_text() == "mine"
    assert main([*command, "--force"]) == 0
    assert load_model(path).name == "plate"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--image", "nowhere.png", "--width", "1"], "nowhere.png"),
        (["--image", "nowhere.png"], "--width"),
        (["--charuco", "4"], "--charuco"),
        (["--charuco", "4x5"], "--square"),
        (["--charuco", "4x5", "--square", "0.05", "--dictionary", "DICT_9"], "DICT_4X4_50"),
        (["--charuco", "40x50", "--square", "0.05", "--dictionary", "DICT_4X4_50"], "--charuco"),
        (["--charuco", "4x5", "--square", "0.05", "--marker-ratio", "2"], "--marker-ratio"),
        (["--charuco", "4x5", "--square", "0.05", "--border", "-3"], "--border"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said_in_one_line(arguments, named, tmp_path, capsys):
    assert main(["calibrate", "texture", *arguments, "-o", str(tmp_path / "plate.yaml")]) == 2
    error = capsys.readouterr().err.strip()
    assert named in error
    assert "\n" not in error
    assert not (tmp_path / "plate.yaml").exists()
