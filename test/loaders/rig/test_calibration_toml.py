"""The TOML of Pose2Sim, aniposelib and Caliscope, read by a TOML parser."""

import tomllib

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError, FileFormatError, UnknownNameError
from tracker_node.geometry import se3, so3
from tracker_node.loaders.rig.calibration_toml import dump_calibration_toml, load_pose2sim

# A camera at (1, 2, 3) whose x axis is the world's y: a point of the world (x, y, z) is (y - 2, 1 - x, z - 3) before it
QUARTER = np.array([[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
K = [[600.0, 0.0, 310.0], [0.0, 590.0, 250.0], [0.0, 0.0, 1.0]]


@pytest.fixture
def rig() -> CameraRig:
    plain = Camera("left", CameraModel(640, 480, K), QUARTER)
    fisheye = Camera("right", CameraModel(64, 48, K, "equidistant", [0.1, 0.0, 0.0, 0.0]), np.eye(4))
    return CameraRig((plain, fisheye))


def dumped(rig, path, *dialect) -> dict:
    dump_calibration_toml(rig, path, *dialect)
    return tomllib.loads(path.read_text())


def test_pose2sim(rig, tmp_path):
    content = dumped(rig, tmp_path / "a.toml")
    assert list(content) == ["left", "right", "metadata"]
    left, right = content["left"], content["right"]
    assert (left["name"], left["size"], left["matrix"], left["fisheye"]) == ("left", [640, 480], K, False)
    assert left["distortions"] == [0.0] * 5
    assert left["rotation"] == pytest.approx([0.0, 0.0, -np.pi / 2]) and left["translation"] == pytest.approx([-2.0, 1.0, -3.0])
    assert right["fisheye"] is True and right["distortions"] == [0.1, 0.0, 0.0, 0.0]
    assert right["rotation"] == right["translation"] == [0.0, 0.0, 0.0]
    assert content["metadata"] == {"adjusted": False, "error": 0.0}


def test_anipose(rig, tmp_path):
    content = dumped(rig, tmp_path / "a.toml", "anipose")
    assert list(content) == ["cam_0", "cam_1", "metadata"]
    assert [content[key]["name"] for key in ("cam_0", "cam_1")] == ["left", "right"]
    assert content["cam_0"]["rotation"] == pytest.approx([0.0, 0.0, -np.pi / 2])
    assert "cam_id" not in content["cam_0"]


def test_caliscope(rig, tmp_path):
    content = dumped(rig, tmp_path / "a.toml", "caliscope")
    assert list(content) == ["cameras"] and list(content["cameras"]) == ["0", "1"]
    left, right = content["cameras"]["0"], content["cameras"]["1"]
    assert np.array(left["rotation"]) == pytest.approx(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert (left["cam_id"], right["cam_id"]) == (0, 1) and left["translation"] == pytest.approx([-2.0, 1.0, -3.0])
    assert (left["rotation_count"], left["error"], left["grid_count"], left["ignore"]) == (0, 0.0, 0, False)


def test_other_dialects(rig, tmp_path):
    with pytest.raises(UnknownNameError, match="unknown dialect 'opencv'; valid: anipose, caliscope, pose2sim"):
        dump_calibration_toml(rig, tmp_path / "a.toml", "opencv")
    assert not (tmp_path / "a.toml").exists()


CAMERA = """
[cam_0]
name = "left"
size = [ 640.0, 480.0]
matrix = [ [ 600.0, 0.0, 320.0], [ 0.0, 610.0, 240.0], [ 0.0, 0.0, 1.0]]
distortions = [ -0.1, 0.02, 0.001, -0.002]
rotation = [ 0.1, -0.2, 0.3]
translation = [ 0.4, 0.5, 2.0]
fisheye = false

[metadata]
adjusted = false
"""


def load(tmp_path, text):
    path = tmp_path / "calib.toml"
    path.write_text(text)
    return load_pose2sim(path)


def test_world_to_camera_becomes_world_from_camera(tmp_path):
    camera = load(tmp_path, CAMERA)["left"]
    world = np.array([0.3, -0.1, 0.7])
    in_camera = so3.exp(np.array([0.1, -0.2, 0.3])) @ world + [0.4, 0.5, 2.0]
    np.testing.assert_allclose(camera.T_world_cam[:3, :3] @ in_camera + camera.center, world, atol=1e-12)
    assert (camera.model.width, camera.model.height) == (640, 480)
    assert camera.model.distortion_model == "plumb_bob"
    assert camera.model.K[1, 1] == 610.0


def test_a_rotation_matrix_and_nested_tables_are_taken_too(tmp_path):
    rows = [[float(v) for v in row] for row in so3.exp(np.array([0.1, -0.2, 0.3]))]
    nested = CAMERA.replace("[cam_0]", "[cameras.0]").replace('name = "left"\n', "")
    rig = load(tmp_path, nested.replace("[ 0.1, -0.2, 0.3]", str(rows)))
    expected = load(tmp_path, CAMERA)["left"].T_world_cam
    assert rig.names == ("cam_0",)
    np.testing.assert_allclose(rig["cam_0"].T_world_cam, expected, atol=1e-12)


def test_a_rotation_matrix_of_five_digits_is_taken_as_the_nearest_proper_one(tmp_path):
    rows = [[round(float(v), 5) for v in row] for row in so3.exp(np.array([0.1, -0.2, 0.3]))]
    (camera,) = load(tmp_path, CAMERA.replace("[ 0.1, -0.2, 0.3]", str(rows)))
    assert se3.is_rigid(camera.T_world_cam, tolerance=1e-12)
    np.testing.assert_allclose(camera.T_world_cam, load(tmp_path, CAMERA)["left"].T_world_cam, atol=1e-4)


def test_cameras_to_be_ignored_are_left_out(tmp_path):
    second = CAMERA.split("[metadata]")[0].replace("cam_0", "cam_1").replace('"left"', '"right"')
    assert load(tmp_path, second + "ignore = false\n" + CAMERA).names == ("right", "left")
    assert load(tmp_path, second + "ignore = true\n" + CAMERA).names == ("left",)


def test_a_fisheye_lens_is_equidistant(tmp_path):
    assert load(tmp_path, CAMERA.replace("fisheye = false", "fisheye = true"))["left"].model.distortion_model == "equidistant"


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("[ 640.0, 480.0]", "[ 640.0]", "cam_0.size"),
        ("[ 640.0, 480.0]", "[ 640.0, -480.0]", "cam_0.size"),
        ("[ 0.0, 610.0, 240.0]", "[ 1.0, 610.0, 240.0]", "cam_0.matrix"),
        ("[ 0.0, 0.0, 1.0]]", "]", "cam_0.matrix"),
        ("[ -0.1, 0.02, 0.001, -0.002]", "[ -0.1, 0.02]", "cam_0.distortions"),
        ("rotation = [ 0.1, -0.2, 0.3]\n", "", "cam_0.rotation"),
        ("[ 0.1, -0.2, 0.3]", "[ 0.1, -0.2]", "cam_0.rotation"),
        ("[ 0.1, -0.2, 0.3]", "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]", "cam_0.rotation"),
        ("[ 0.4, 0.5, 2.0]", '["a", 0.5, 2.0]', "cam_0.translation"),
        ("[ 0.4, 0.5, 2.0]", "[ nan, 0.5, 2.0]", "cam_0.translation"),
        ("[ 600.0, 0.0, 320.0]", "[ -600.0, 0.0, 320.0]", "cam_0.matrix"),
        ("[cam_0]", "[cam_0", "(file)"),
        ("matrix", "K", "cam_0.matrix"),
        ("translation", "t", "cam_0.translation"),
        ("[metadata]", "[cam_1]\nsize = [640, 480]\n[metadata]", "cam_1.matrix"),
        ("[metadata]", "ignore = true\n[metadata]", "ignore"),
        (CAMERA, "[metadata]\nadjusted = false\n", "(top level)"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, field):
    assert old in CAMERA
    with pytest.raises(FileFormatError) as caught:
        load(tmp_path, CAMERA.replace(old, new, 1))
    assert caught.value.field == field
    assert caught.value.file.endswith("calib.toml")


def test_an_uncalibrated_camera_is_named(tmp_path):
    with pytest.raises(CalibrationError, match="camera 'left': uncalibrated"):
        load(tmp_path, CAMERA.replace("600.0", "0.0"))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"none\.toml"):
        load_pose2sim(tmp_path / "none.toml")


def test_real_files(shared_data):
    balancing = load_pose2sim(shared_data / "pose2sim_balancing/Pose2Sim_cameras.toml")
    assert balancing.names == ("cam_01", "cam_02", "cam_03", "cam_04")
    assert all(1.0 < camera.center[2] < 2.5 for camera in balancing)  # cameras on tripods, meters, z up
    board = load_pose2sim(shared_data / "caliscope_board/post_optimization/camera_array.toml")
    assert board.names == ("cam_0", "cam_1", "cam_2", "cam_3")
    assert board["cam_0"].model.distortion.size == 5
