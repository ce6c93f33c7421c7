"""The TOML of Pose2Sim, aniposelib and Caliscope, read by a TOML parser."""

import tomllib

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import UnknownNameError
from tracker_node.loaders.rig.calibration_toml import dump_calibration_toml

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
