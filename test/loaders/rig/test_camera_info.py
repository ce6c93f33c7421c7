"""Where lenses are kept: the URLs of ROS's camera_info_manager."""

from pathlib import Path

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.rig.camera_info import camera_info_path, dump_camera_info, load_camera_info, load_lens, save_lens

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


# As camera_calibration writes it.
TEXT = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.78, 0., 305.59, 0., 437.35, 243.73, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361, 0.12, 0.0007, -0.0006, 0.]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.6, 0., 322.4, 0., 0., 393.6, 241.0, 0., 0., 0., 1., 0.]
"""


def load(tmp_path, text):
    path = tmp_path / "left.yaml"
    path.write_text(text)
    return load_camera_info(path)


def test_a_file_of_the_calibrator_is_read(tmp_path):
    name, model = load(tmp_path, TEXT)
    assert name == "narrow_stereo"
    assert (model.width, model.height, model.distortion_model) == (640, 480, "plumb_bob")
    assert model.K[0, 2] == 305.59
    np.testing.assert_array_equal(model.distortion, [-0.361, 0.12, 0.0007, -0.0006, 0.0])


@pytest.mark.parametrize(
    ("kind", "coefficients"),
    [("none", []), ("plumb_bob", [0.1, 0.2, 0.3, 0.4, 0.5]), ("rational_polynomial", [0.1] * 8), ("equidistant", [0.01] * 4)],
)
def test_there_and_back(tmp_path, kind, coefficients):
    K = np.array([[500.1, 0.0, 319.5], [0.0, 501.2, 239.5], [0.0, 0.0, 1.0]])
    model = CameraModel(640, 480, K, kind, np.array(coefficients))
    dump_camera_info("cam01", model, tmp_path / "cam01.yaml")
    name, again = load_camera_info(tmp_path / "cam01.yaml")
    assert name == "cam01"
    np.testing.assert_array_equal(again.K, K)
    points = np.random.default_rng(0).normal(size=(20, 3)) * 0.2 + [0.0, 0.0, 1.0]
    np.testing.assert_array_equal(again.project(points)[0], model.project(points)[0])


def test_zeros_of_prisms_and_tilts_are_none(tmp_path):
    eight = "[-0.361, 0.12, 0.0007, -0.0006, 0.01, 0.02, 0.03, 0.04"
    text = TEXT.replace("plumb_bob", "rational_polynomial")
    text = text.replace("[-0.361, 0.12, 0.0007, -0.0006, 0.]", f"{eight}{', 0.' * 6}]")
    assert load(tmp_path, text)[1].distortion.size == 8
    with pytest.raises(FileFormatError, match="8 coefficients of rational_polynomial"):
        load(tmp_path, text.replace("0., 0., 0., 0., 0.]", "0., 0., 0., 0., 1.e-3]"))


def test_opencv_calls_it_fisheye(tmp_path):
    text = TEXT.replace("plumb_bob", "fisheye").replace(", -0.0006, 0.]", ", -0.0006]")
    assert load(tmp_path, text)[1].distortion_model == "equidistant"


def test_the_file_names_the_camera_when_nothing_else_does(tmp_path):
    assert load(tmp_path, TEXT.replace("camera_name: narrow_stereo\n", ""))[0] == "left"


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("image_width: 640", "image_width: wide", "image_width"),
        ("image_height: 480\n", "", "image_height"),
        ("camera_matrix:\n  rows: 3\n  cols: 3\n  data:", "camera_matrix:\n  rows: 3\n  cols: 3\n  dta:", "camera_matrix"),
        ("243.73, 0., 0., 1.]", "243.73, 0., 0.]", "camera_matrix.data"),
        ("438.78", "'a'", "camera_matrix.data"),
        ("243.73, 0., 0., 1.]", "243.73, 0., 0., 2.]", "camera_matrix.data"),
        ("438.78", "-438.78", "camera_matrix.data"),
        ("plumb_bob", "thin_prism", "distortion_model"),
        ("-0.0006, 0.]", "0.]", "distortion_coefficients.data"),
        ("-0.0006, 0.]", ".nan, 0.]", "distortion_coefficients.data"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, field):
    assert old in TEXT
    text = TEXT.replace(old, new, 1)
    if field == "distortion_coefficients.data" and "0.]" in new and "nan" not in new:
        text = text.replace("0.0007, 0.]", "0.]")
    with pytest.raises(FileFormatError) as caught:
        load(tmp_path, text)
    assert caught.value.field == field


def test_a_driver_without_calibration(tmp_path):
    with pytest.raises(CalibrationError, match="camera 'narrow_stereo': uncalibrated"):
        load(tmp_path, TEXT.replace("438.78", "0."))
