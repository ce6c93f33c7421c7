"""ROS camera_info YAML, there and back."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.rig.camera_info_yaml import dump_camera_info, load_camera_info

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
