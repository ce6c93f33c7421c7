import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from helpers.numeric.rotations import twists
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.geometry import se3
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file, rig_file_of, write_rig_file

RIG = """
world_frame: lab
cameras:
  left:
    image_size: [1088, 1920]
    K: [[1681.2, 0.5, 532.9], [0, 1681.0, 948.1], [0, 0, 1]]
    distortion_model: plumb_bob
    distortion: [-7e-4, 2e-3, 9.5e-06, 1.0e-05]
    T_world_cam: [[1, 0, 0, 0.5], [0, 0, 1, -2], [0, -1, 0, 1.1], [0, 0, 0, 1]]
    source: videos/left.mp4
    background: backgrounds/left.png
    time_offset_s: -0.0085
    pixel_map: [[1.0074, 0.001, 0], [0, 1.0074, -7.2]]
    file_image_size: [1080, 1920]
    gain: [1.1, 1.0, 0.9]
    gamma: 2.2
  right:
    image_size: [640, 480]
    K: [[600, 0, 320], [0, 600, 240], [0, 0, 1]]
    T_world_cam: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    source: /data/right.mp4
lights:
  - {kind: spot, position: [0, 0, 3], direction: [0, 0, -1], cone_deg: 30, intensity: 0.8}
  - {kind: ambient, intensity: [0.2, 0.2, 0.3]}
"""


@pytest.fixture
def rig_path(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text(RIG)
    return path


def test_everything_arrives(rig_path, tmp_path):
    rig = load_rig(rig_path)
    assert rig.names == ("left", "right")
    assert rig.world_frame == "lab"
    left, right = rig.cameras
    assert left.source == str(tmp_path / "videos" / "left.mp4")
    assert left.background == str(tmp_path / "backgrounds" / "left.png")
    assert right.source == "/data/right.mp4"
    assert left.time_offset_ns == -8_500_000
    assert left.center.tolist() == [0.5, -2.0, 1.1]
    assert np.allclose(left.model.distortion, [-7e-4, 2e-3, 9.5e-6, 1e-5])
    content = read_rig_file(rig_path)
    assert content.cameras["left"].gain == (1.1, 1.0, 0.9)
    assert content.cameras["left"].gamma == 2.2
    assert content.cameras["right"].gain == (1.0, 1.0, 1.0)
    assert [light.kind for light in content.lights] == ["spot", "ambient"]
    assert content.lights[0].cone_deg == 30.0


def test_pixel_map_takes_file_pixels_to_calibration_pixels(rig_path):
    rig = load_rig(rig_path)
    entry = read_rig_file(rig_path).cameras["left"]
    calibrated = CameraModel(1088, 1920, np.array(entry.K), "plumb_bob", np.array(entry.distortion))
    point = np.array([0.2, -0.3, 2.0])
    in_file, _ = rig["left"].model.project(point)
    in_calibration, _ = calibrated.project(point)
    assert np.allclose(np.array(entry.pixel_map) @ np.append(in_file, 1.0), in_calibration)
    assert (rig["left"].model.width, rig["left"].model.height) == (1080, 1920)


BAD = [
    ("[1088, 1920]", "[1088]", "cameras.left.image_size"),
    ("[1088, 1920]", "[1088.5, 1920]", "cameras.left.image_size"),
    ("[1088, 1920]", "[.inf, 1920]", "cameras.left.image_size"),
    ("1681.2", "abc", "cameras.left.K"),
    ("[0, 0, 1]]\n    dist", "[0, 0, 2]]\n    dist", "cameras.left.K"),
    ("1681.0", "-1681.0", "cameras.left.K"),
    ("plumb_bob", "fishy", "cameras.left.distortion_model"),
    ("9.5e-06, ", "", "cameras.left.distortion"),
    ("[1, 0, 0, 0.5]", "[2, 0, 0, 0.5]", "cameras.left.T_world_cam"),
    ("[1, 0, 0, 0.5]", "[1, 0, 0, .nan]", "cameras.left.T_world_cam"),
    ("[1, 0, 0, 0.5]", "[-1, 0, 0, 0.5]", "cameras.left.T_world_cam"),
    ("source: videos", "sorce: videos", "cameras.left.sorce"),
    ("source: videos/left.mp4", "source: 7", "cameras.left.source"),
    ("time_offset_s: -0.0085", "time_offset_s: later", "cameras.left.time_offset_s"),
    ("    file_image_size: [1080, 1920]\n", "", "cameras.left.file_image_size"),
    ("[0, 1.0074, -7.2]", "[0.1, 1.0074, -7.2]", "cameras.left.pixel_map"),
    ("gamma: 2.2", "gamma: 0", "cameras.left.gamma"),
    ("gain: [1.1, 1.0, 0.9]", "gain: [1.1, 1.0]", "cameras.left.gain"),
    ("kind: spot", "kind: lamp", "lights.0.kind"),
    ("cone_deg: 30, ", "", "lights.0.cone_deg"),
    ("direction: [0, 0, -1]", "direction: [0, 0, 0]", "lights.0.direction"),
    ("  right:", "  right camera:", "cameras.right camera"),
    ("  right:", "  left:", "left"),
    ("world_frame", "world", "world"),
]


@pytest.mark.parametrize(("old", "new", "field"), BAD)
def test_errors_name_file_and_field(rig_path, old, new, field):
    assert RIG.count(old) >= 1
    rig_path.write_text(RIG.replace(old, new, 1))
    with pytest.raises(FileFormatError) as error:
        load_rig(rig_path)
    assert error.value.field == field
    assert str(rig_path) in str(error.value)
    assert "expected" in str(error.value)


def test_what_is_missing_or_no_yaml_is_named(tmp_path):
    with pytest.raises(FileFormatError, match="existing file"):
        load_rig(tmp_path / "none.yaml")
    for text, message in [
        ("cameras: [", "line 1, column 11"), ("", "mapping"), ("- 1", "mapping"), ("cameras: {}", "cameras"),
        ("{}", "a value"), ("a: \x00", "YAML"),
    ]:  # fmt: skip
        (tmp_path / "bad.yaml").write_text(text)
        with pytest.raises(FileFormatError, match=message):
            load_rig(tmp_path / "bad.yaml")
    (tmp_path / "bad.yaml").write_bytes(b"cameras: \xff\xfe")
    with pytest.raises(FileFormatError, match="UTF-8"):
        load_rig(tmp_path / "bad.yaml")
    with pytest.raises(FileFormatError, match="readable"):
        load_rig(tmp_path)


def test_an_uncalibrated_camera_is_named(rig_path):
    rig_path.write_text(RIG.replace("[600, 0, 320], [0, 600, 240], [0, 0, 1]", "[0, 0, 0], [0, 0, 0], [0, 0, 0]"))
    with pytest.raises(CalibrationError, match="'right': uncalibrated"):
        load_rig(rig_path)


def test_rewritten_elsewhere_it_finds_the_same_files(rig_path, tmp_path):
    target = tmp_path / "deeper" / "down" / "rig.yaml"
    write_rig_file(read_rig_file(rig_path), target, base_dir=tmp_path)
    before, after = load_rig(rig_path), load_rig(target)
    for a, b in zip(before, after, strict=True):
        assert (a.name, a.source, a.background, a.time_offset_ns) == (b.name, b.source, b.background, b.time_offset_ns)
        assert np.array_equal(a.model.params, b.model.params)
    assert read_rig_file(target).lights == read_rig_file(rig_path).lights
    write_rig_file(read_rig_file(rig_path), tmp_path / "same.yaml")
    assert read_rig_file(tmp_path / "same.yaml") == read_rig_file(rig_path)


def test_cameras_placed_anew(rig_path):
    content = read_rig_file(rig_path)
    moved = content.with_extrinsics({"right": se3.exp(np.array([1.0, 2, 3, 0.1, 0.2, 0.3]))})
    assert moved.cameras["left"] == content.cameras["left"]
    assert np.allclose(np.array(moved.cameras["right"].T_world_cam)[:3, 3], se3.exp(np.array([1.0, 2, 3, 0.1, 0.2, 0.3]))[:3, 3])


def test_rounded_rotations_are_made_rigid(rig_path):
    T = se3.exp(np.array([0, 0, 0, 0.3, -0.2, 0.9]))
    values = yaml.safe_load(RIG)
    values["cameras"]["right"]["T_world_cam"] = np.round(T, 5).tolist()
    rig_path.write_text(yaml.safe_dump(values))
    loaded = load_rig(rig_path)["right"].T_world_cam
    assert se3.is_rigid(loaded, 1e-12)
    assert np.allclose(loaded, T, atol=1e-5)


numbers = st.floats(-1e3, 1e3)


@given(
    twists, st.floats(10.0, 1e4), st.floats(10.0, 1e4), numbers, numbers, st.lists(numbers, min_size=4, max_size=4),
    st.sampled_from(["plumb_bob", "equidistant"]), st.integers(-(10**10), 10**10),
)  # fmt: skip
def test_any_rig_comes_back_from_its_file(tmp_path_factory, twist, fx, fy, cx, cy, coefficients, lens, offset_ns):
    path = tmp_path_factory.mktemp("rig") / "rig.yaml"
    model = CameraModel(640, 480, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), lens, np.array(coefficients))
    rig = CameraRig((Camera("a", model, se3.exp(twist), "rtsp://host/a", offset_ns), Camera("b", model, np.eye(4))))
    write_rig_file(rig_file_of(rig), path)
    again = load_rig(path)
    for a, b in zip(rig, again, strict=True):
        assert (a.name, a.source, a.time_offset_ns) == (b.name, b.source, b.time_offset_ns)
        assert np.array_equal(a.T_world_cam, b.T_world_cam)
        assert np.array_equal(a.model.params, b.model.params)
        assert a.model.distortion_model == b.model.distortion_model
