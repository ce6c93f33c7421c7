"""Where lenses are kept: the URLs of ROS's camera_info_manager."""

from pathlib import Path

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.rig.camera_info_url import camera_info_path, load_lens, save_lens

LENS = CameraModel(
    64, 48, np.array([[60.0, 0.0, 31.0], [0.0, 61.0, 24.0], [0.0, 0.0, 1.0]]), "plumb_bob", np.array([-0.1, 0.02, 0, 0, 0])
)


@pytest.mark.parametrize(
    ("url", "environment", "path"),
    [
        ("file:///tmp/left.yaml", {}, "/tmp/left.yaml"),
        ("file:///tmp/${NAME}.yaml", {}, "/tmp/cam1.yaml"),
        ("file://${ROS_HOME}/lenses/${NAME}.yaml", {"ROS_HOME": "/ros"}, "/ros/lenses/cam1.yaml"),
        ("file://${ROS_HOME}/cam.yaml", {"HOME": "/home/me"}, "/home/me/.ros/cam.yaml"),
        ("", {"HOME": "/home/me"}, "/home/me/.ros/camera_info/cam1.yaml"),
    ],
)
def test_files(url: str, environment: dict, path: str):
    assert camera_info_path(url, "cam1", environment) == Path(path)


def test_a_package_is_looked_for_where_ros_looks(tmp_path: Path):
    (tmp_path / "second/share/my_rig").mkdir(parents=True)
    environment = {"AMENT_PREFIX_PATH": f"{tmp_path}/first:{tmp_path}/second"}
    found = camera_info_path("package://my_rig/calibration/${NAME}.yaml", "cam1", environment)
    assert found == tmp_path / "second/share/my_rig/calibration/cam1.yaml"
    with pytest.raises(FileFormatError, match=r"a package that is installed .* got 'other'"):
        camera_info_path("package://other/cam.yaml", "cam1", environment)


@pytest.mark.parametrize(
    "url", ["http://host/cam.yaml", "file://relative.yaml", "/tmp/cam.yaml", "package://my_rig", "file:///${USER}.yaml"]
)
def test_other_urls_are_refused(url: str):
    with pytest.raises(FileFormatError, match="camera_info_url"):
        camera_info_path(url, "cam1", {"HOME": "/home/me"})


def test_a_lens_comes_back_and_one_that_is_not_there_is_none(tmp_path: Path):
    url = f"file://{tmp_path}/new/folder/${{NAME}}.yaml"
    assert load_lens(url, "cam1") is None
    path = save_lens(url, "cam1", LENS)
    assert path == tmp_path / "new/folder/cam1.yaml" and [file.name for file in path.parent.iterdir()] == ["cam1.yaml"]
    again = load_lens(url, "cam1")
    assert np.array_equal(again.K, LENS.K) and np.array_equal(again.distortion, LENS.distortion)


def test_what_cannot_be_read_or_written_is_said(tmp_path: Path):
    (tmp_path / "cam1.yaml").write_text("image_width: 64\n")
    with pytest.raises(FileFormatError, match=r"cam1\.yaml"):
        load_lens(f"file://{tmp_path}/cam1.yaml", "cam1")
    save_lens(f"file://{tmp_path}/zero.yaml", "cam1", LENS)
    text = (tmp_path / "zero.yaml").read_text()
    (tmp_path / "zero.yaml").write_text(text.replace("60.0", "0.0"))
    with pytest.raises(CalibrationError, match="uncalibrated"):
        load_lens(f"file://{tmp_path}/zero.yaml", "cam1")
    with pytest.raises(FileFormatError, match="a place to write to"):
        save_lens(f"file://{tmp_path}/cam1.yaml/below.yaml", "cam1", LENS)
