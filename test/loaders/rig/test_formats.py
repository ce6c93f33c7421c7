"""Calibrations in other programs' formats: read, written, told by their contents."""

import pickle

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.points.dlt import camera_of_parameters, dlt_parameters
from tracker_node.camera.distortion import COEFFICIENT_COUNTS
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError, FileFormatError, UnknownNameError
from tracker_node.geometry import se3, so3
from tracker_node.loaders.rig.calibration_toml import DIALECTS, dump_calibration_toml, load_pose2sim
from tracker_node.loaders.rig.camera_info import dump_camera_info, load_camera_info
from tracker_node.loaders.rig.control_points import dump_dlt, load_dlt
from tracker_node.loaders.rig.formats import detect, detect_all, dropped
from tracker_node.loaders.rig.opencap_pickle import FILE_NAME as OPENCAP_FILE
from tracker_node.loaders.rig.opencap_pickle import load_opencap
from tracker_node.loaders.rig.opencv_storage import dump_opencv, load_opencv
from tracker_node.loaders.rig.qualisys_xml import dump_qualisys, load_qualisys
from tracker_node.loaders.rig.rig_yaml import LightEntry, rig_file_of

few = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def cameras(draw, kinds=("none", "plumb_bob", "rational_polynomial", "equidistant")):
    """A rig of two cameras, of lenses of the given kinds, that look at the origin from anywhere."""
    result = []
    for name in ("left", "right"):
        kind = draw(st.sampled_from(kinds))
        count = max(COEFFICIENT_COUNTS[kind])
        coefficients = [draw(st.floats(-0.05, 0.05)) for _ in range(count)]
        if kind != "none" and not any(coefficients):
            coefficients[0] = 0.01
        fx, fy, cx = draw(st.floats(300, 2000)), draw(st.floats(300, 2000)), draw(st.floats(300, 340))
        K = np.array([[fx, 0.0, cx], [0.0, fy, 240.5], [0.0, 0.0, 1.0]])
        rotation = so3.exp(np.array([draw(st.floats(-1.8, 1.8)) for _ in range(3)]))
        center = rotation @ np.array([draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.5, 0.5)), -draw(st.floats(1.0, 9.0))])
        lens = CameraModel(640, 480, K, kind, np.array(coefficients))
        result.append(Camera(name, lens, se3.from_rotation_translation(rotation, center)))
    return CameraRig(tuple(result))


def same(read, written, names=True):
    """Whether two rigs see the same, to rounding."""
    for a, b in zip(read, written, strict=True):
        assert not names or a.name == b.name
        assert (a.model.width, a.model.height) == (b.model.width, b.model.height)
        np.testing.assert_allclose(a.model.K, b.model.K, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(a.model.params[8:], b.model.params[8:], rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(a.T_world_cam, b.T_world_cam, atol=1e-9)


@few
@given(rig=cameras(("none", "plumb_bob", "equidistant", "rational_polynomial")), dialect=st.sampled_from(DIALECTS))
def test_toml_of_three_dialects_round_trips(tmp_path, rig, dialect):
    dump_calibration_toml(rig, tmp_path / "calib.toml", dialect)
    assert detect(tmp_path / "calib.toml") == "toml"
    same(load_pose2sim(tmp_path / "calib.toml"), rig)


@few
@given(rig=cameras(), extension=st.sampled_from(["yml", "xml", "json"]))
def test_opencv_storage_round_trips(tmp_path, rig, extension):
    path = tmp_path / f"rig.{extension}"
    dump_opencv(rig, path)
    assert detect(path) == "opencv"
    same(load_opencv([path]), rig)


@few
@given(rig=cameras(("none", "plumb_bob")))
def test_qualisys_round_trips(tmp_path, rig):
    dump_qualisys(rig, tmp_path / "rig.qca.txt")
    assert detect(tmp_path / "rig.qca.txt") == "qualisys"
    same(load_qualisys(tmp_path / "rig.qca.txt"), rig)


@few
@given(rig=cameras())
def test_camera_info_round_trips(tmp_path, rig):
    for camera in rig:
        path = tmp_path / f"{camera.name}.yaml"
        dump_camera_info(camera.name, camera.model, path)
        assert detect(path) == "camera_info"
        name, lens = load_camera_info(path)
        same([Camera(name, lens, camera.T_world_cam)], [camera])


@few
@given(rig=cameras(("none",)))
def test_dlt_coefficients_round_trip(tmp_path, rig):
    dump_dlt([dlt_parameters(camera) for camera in rig], tmp_path / "dlt.csv")
    assert detect(tmp_path / "dlt.csv") == "dlt"
    read = [camera_of_parameters("cam", values, (640, 480)) for values in load_dlt(tmp_path / "dlt.csv")]
    for a, b in zip(read, rig, strict=True):
        np.testing.assert_allclose(a.model.K, b.model.K, rtol=1e-6, atol=1e-5)
        np.testing.assert_allclose(a.T_world_cam, b.T_world_cam, atol=1e-6)


# The elements that the reader looks at, of a file by Qualisys for cam01 of the Balancing recording (Pose2Sim, BSD-3)
QUALISYS = """<?xml version='1.0'?><calibration type="regular"><cameras>
<camera active="1" serial="cam01" viewrotation="0"><fov_video bottom="1919" left="0" right="1087" top="0"/>
<transform r11="0.5536380477336265" r12="0.8046719867383512" r13="0.2144479094331626" r21="-0.4345300743838753"
 r22="0.05946489349975602" r23="0.8986921279821063" r31="0.7104002579937896" r32="-0.5907342212870501" r33="0.3825762057979294"
 x="1460.2323709212087" y="-1909.1590482454608" z="1896.5058524092062"/>
<intrinsic centerPointU="34110.316406" centerPointV="60680.792969" focalLengthU="107599.671875" focalLengthV="107588.828125"
 radialDistortion1="-0.046183" radialDistortion2="0.139983" radialDistortion3="0" skew="0" tangentalDistortion1="0.000608"
 tangentalDistortion2="0.00069"/></camera><camera active="0" serial="off"/></cameras></calibration>"""


def test_a_qualisys_camera_stands_where_pose2sim_has_it(tmp_path):
    (tmp_path / "a.qca.txt").write_text(QUALISYS)
    (camera,) = load_qualisys(tmp_path / "a.qca.txt")
    rotation, translation = [1.68827548, 1.04832205, -0.41955852], [0.32110489, 0.95633206, 2.89071305]
    expected = se3.inverse(se3.from_rotation_translation(cv2.Rodrigues(np.array(rotation))[0], np.array(translation)))
    np.testing.assert_allclose(camera.T_world_cam, expected, atol=1e-7)
    expected_K = [[1681.24487, 0.0, 532.97369], [0.0, 1681.07544, 948.13739], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(camera.model.K, expected_K, atol=1e-4)
    assert (camera.name, camera.model.width, camera.model.height) == ("cam01", 1088, 1920)


def test_a_stereo_pair_of_two_files_stands_as_opencv_says(tmp_path):
    K = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])
    lenses = cv2.FileStorage(str(tmp_path / "intrinsics.yml"), cv2.FILE_STORAGE_WRITE)
    for name, value in (("M1", K), ("D1", np.zeros((1, 14))), ("M2", K), ("D2", np.array([[0.1, 0, 0, 0, 0]]))):
        lenses.write(name, value)
    lenses.release()
    places = cv2.FileStorage(str(tmp_path / "extrinsics.yml"), cv2.FILE_STORAGE_WRITE)
    places.write("R", so3.exp(np.array([0.0, 0.1, 0.0])))
    places.write("T", np.array([[-0.2], [0.0], [0.01]]))
    places.release()
    rig = load_opencv([tmp_path / "intrinsics.yml", tmp_path / "extrinsics.yml"], (640, 480))
    point = np.array([0.1, -0.2, 2.0])
    expected = so3.exp(np.array([0.0, 0.1, 0.0])) @ point + [-0.2, 0.0, 0.01]
    np.testing.assert_allclose(se3.apply(rig["right"].T_cam_world, point), expected, atol=1e-12)
    assert rig["left"].model.distortion_model == "none"
    with pytest.raises(FileFormatError, match="size of the images"):
        load_opencv([tmp_path / "intrinsics.yml", tmp_path / "extrinsics.yml"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<html></html>", "other XML"),
        ("1 2\n3 4\n", "expected 11 lines of DLT coefficients, got '2 lines of numbers'"),
        ("1 1681.2 1088 1920 532.9 948.1 1.0 0 0 0 0 0\n2 1673 1088 1920 534.4 963.2 1.0 0 0 0 0 0\n", "got 'lenses of Argus"),
        ('<?xml version="1.0"?>\n<Cameras><Camera SENSOR_SIZE="1088 1920"/></Cameras>', "Vicon (.xcp): Pose2Sim makes TOML of"),
        ("hello", "expected a calibration: Pose2Sim"),
        ("[cam1]\nmatrix = [[0*1.0]]\n", "expected a TOML file, got 'Unclosed array (at line 2"),
        ("", "expected a calibration: Pose2Sim"),
    ],
)
def test_what_is_no_calibration_is_told_whatever_its_extension(tmp_path, content, message):
    path = tmp_path / "calib.toml"
    path.write_text(content)
    with pytest.raises(FileFormatError) as caught:
        detect(path)
    assert message in str(caught.value) and "calib.toml" in str(caught.value)


def test_files_of_two_kinds_are_refused(tmp_path):
    (tmp_path / "a.txt").write_text(QUALISYS)
    (tmp_path / "b.txt").write_text("\n".join(["1 2"] * 11))
    with pytest.raises(FileFormatError, match=r"b.txt.*got 'dlt'"):
        detect_all([tmp_path / "a.txt", tmp_path / "b.txt"])


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ('r11="0.5536380477336265"', 'r11="x"', "transform.r11"),
        ('r11="0.5536380477336265"', 'r11="2"', "transform"),
        ('focalLengthU="107599.671875"', "", "intrinsic.focalLengthU"),
        ('focalLengthU="107599.671875"', 'focalLengthU="nan"', "intrinsic.focalLengthU"),
        ('right="1087"', 'right="-5"', "fov_video"),
        ("<fov_video", "<fov_other", "fov_video"),
    ],
)
def test_what_is_wrong_in_a_qualisys_file_is_named(tmp_path, old, new, field):
    assert old in QUALISYS
    (tmp_path / "a.xml").write_text(QUALISYS.replace(old, new))
    with pytest.raises(FileFormatError) as caught:
        load_qualisys(tmp_path / "a.xml")
    assert field in caught.value.field


def test_what_a_format_cannot_hold_is_told_or_refused(tmp_path):
    lens = CameraModel(640, 480, np.diag([500.0, 500.0, 1.0]), "equidistant", np.full(4, 0.01))
    rig = CameraRig((Camera("a", lens, np.eye(4), source="a.mp4", time_offset_ns=5),))
    with pytest.raises(CalibrationError, match="cannot hold a lens of the kind equidistant"):
        dump_qualisys(rig, tmp_path / "a.xml")
    rig_file = rig_file_of(rig).model_copy(update={"lights": (LightEntry(kind="ambient"),)})
    told = "; ".join(dropped(rig_file, "dlt"))
    assert all(word in told for word in ("source (a)", "time_offset_s (a)", "lights", "distortion (a)", "sizes"))
    assert "places" in "; ".join(dropped(rig_file, "camera_info"))
    with pytest.raises(UnknownNameError, match="dialect"):
        dump_calibration_toml(rig, tmp_path / "a.toml", "other")
    with pytest.raises(FileFormatError, match="extension"):
        dump_opencv(rig, tmp_path / "a.txt")


def test_a_mirrored_dlt_is_refused():
    lens = CameraModel(640, 480, np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]]))
    parameters = dlt_parameters(Camera("a", lens, se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, -3.0]))))
    parameters[4:8] = 480.0 * np.array([0.0, 0.0, parameters[10], 1.0]) - parameters[4:8]  # v upward
    with pytest.raises(CalibrationError, match="mirrored"):
        camera_of_parameters("a", parameters, (640, 480))


LENS = "image_width: 640\nimage_height: 480\ncamera_matrix: [500., 0., 320., 0., 500., 240., 0., 0., 1.]\n"
LENS += "distortion_coefficients: [0., 0., 0., 0., 0.]\n"
ENTRY = "   - { name: a, " + LENS.strip().replace("\n", ", ") + ", R: [0., 0., 0.], T: [0., 0., 1.] }\n"


def opencv_yaml(folder, content):
    path = folder / "calib.yml"
    path.write_text("%YAML:1.0\n---\n" + content)
    return path


def test_matrices_may_be_plain_sequences(tmp_path):
    (single,) = load_opencv([opencv_yaml(tmp_path, LENS)])
    (placed,) = load_opencv([opencv_yaml(tmp_path, "cameras:\n" + ENTRY)])
    for camera in (single, placed):
        np.testing.assert_array_equal(camera.model.K, [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(placed.center, [0.0, 0.0, -1.0])


def camera_files(folder, rig, rotation, translation):
    """A file per camera, with its pose under these names, as somebody's own program writes it."""
    for camera in rig:
        turn = camera.T_cam_world[:3, :3] if rotation == "R" else so3.log(camera.T_cam_world[:3, :3])
        lines = [f"{rotation}: {turn.ravel().tolist()}", f"{translation}: {camera.T_cam_world[:3, 3].tolist()}"]
        (folder / f"{camera.name}.yml").write_text("%YAML:1.0\n---\n" + LENS + "\n".join(lines) + "\n")
    return [folder / f"{camera.name}.yml" for camera in rig]


@pytest.mark.parametrize("names", [("rvec", "tvec"), ("R", "T")])
def test_opencv_files_of_a_camera_each_are_a_rig(tmp_path, names):
    """All but the first were dropped, and the first stood at the origin."""
    rig = circle_rig(3)
    files = camera_files(tmp_path, rig, *names)
    read = load_opencv(files)
    assert read.names == rig.names
    for camera in rig:
        np.testing.assert_allclose(read[camera.name].T_world_cam, camera.T_world_cam, atol=1e-12)
    np.testing.assert_allclose(load_opencv(files[1:2])[rig.names[1]].center, rig.cameras[1].center, atol=1e-12)


@pytest.mark.parametrize("missing", [("rvec", "tvec"), ("tvec",)])
def test_opencv_files_of_a_camera_each_need_poses(tmp_path, missing):
    files = camera_files(tmp_path, circle_rig(2), "rvec", "tvec")
    for name in missing:
        files[1].write_text(files[1].read_text().replace(f"{name}:", f"no_{name}:"))
    with pytest.raises(FileFormatError) as caught:
        load_opencv(files)
    assert (caught.value.file, caught.value.field) == (str(files[1]), missing[0])


def test_two_opencv_rigs_are_not_one(tmp_path):
    path = opencv_yaml(tmp_path, "cameras:\n" + ENTRY)
    with pytest.raises(FileFormatError, match="one file with it"):
        load_opencv([path, path])


@pytest.mark.parametrize(
    ("content", "field"),
    [
        (LENS.replace("camera_matrix:", "unused:") + "camera_matrix: 3\n", "camera_matrix"),
        (LENS.replace("camera_matrix:", "K:"), "camera_matrix"),
        (LENS.replace("distortion_coefficients:", "D:"), "distortion_coefficients"),
        (LENS.replace("500.", "wide"), "camera_matrix"),
        (LENS.replace("camera_matrix: [500., 0.,", "camera_matrix: ["), "camera_matrix"),
        ("M1: [500., 0., 320., 0., 500., 240., 0., 0., 1.]\nD1: [0., 0., 0., 0.]\nimage_width: 640\nimage_height: 480\n", "M2"),
        ("cameras: [1, 2]\n", "cameras[]"),
        ("cameras: []\n", "cameras"),
        ("cameras:\n" + ENTRY + ENTRY, "cameras"),
        (LENS.replace("640", "-5"), "image_width"),
        (LENS.replace("640", ".Nan"), "image_width"),
    ],
)
def test_what_is_wrong_in_an_opencv_file_is_named(tmp_path, content, field):
    with pytest.raises(FileFormatError) as caught:
        load_opencv([opencv_yaml(tmp_path, content)])
    assert caught.value.field == field


@pytest.mark.parametrize("content", ["[" * 20000, "a = " + "[" * 20000])
def test_endless_nesting_is_no_calibration(tmp_path, content):
    path = tmp_path / "calib.yaml"
    path.write_text(content)
    with pytest.raises(FileFormatError, match="expected a calibration"):
        detect(path)


def test_a_date_that_is_none_does_not_matter(tmp_path):
    path = tmp_path / "cam.yaml"
    dump_camera_info("cam", CameraModel(640, 480, np.diag([500.0, 500.0, 1.0])), path)
    path.write_text("date: 2024-13-45\n" + path.read_text())
    assert detect(path) == "camera_info" and load_camera_info(path)[0] == "cam"
    path.write_text("date: 2024-13-45\ncamera_matrix: 3\n")
    assert detect(path) == "camera_info"
    with pytest.raises(FileFormatError):
        load_camera_info(path)


def test_no_distortion_is_none_whatever_the_format(tmp_path):
    """Zeros in TOML, camera_info and OpenCap were a lens with five coefficients, elsewhere one without distortion."""
    lens = CameraModel(640, 480, np.array([[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]]))
    rig, folder = CameraRig((Camera("left", lens, np.eye(4)),)), tmp_path / "Cam0"
    dump_calibration_toml(rig, tmp_path / "a.toml")
    dump_opencv(rig, tmp_path / "a.yaml")
    dump_qualisys(rig, tmp_path / "a.xml")
    dump_camera_info("left", lens, tmp_path / "info.yaml")
    folder.mkdir()
    values = {"imageSize": np.array([480.0, 640.0]), "intrinsicMat": lens.K, "distortion": np.zeros((1, 5))}
    (folder / OPENCAP_FILE).write_bytes(pickle.dumps(values | {"rotation": np.eye(3), "translation": np.zeros((3, 1))}))
    read = [
        *(load_pose2sim(tmp_path / "a.toml"), load_opencv([tmp_path / "a.yaml"]), load_qualisys(tmp_path / "a.xml")),
        load_opencap([folder / OPENCAP_FILE]),
    ]
    lenses = [camera.model for cameras in read for camera in cameras] + [load_camera_info(tmp_path / "info.yaml")[1]]
    assert [(lens.distortion_model, lens.width, lens.height) for lens in lenses] == [("none", 640, 480)] * 5


def test_a_place_far_away_is_one_whatever_the_format(tmp_path):
    """In TOML it was none, since other readers had other largest numbers: coordinates of a survey are large."""
    lens, far = CameraModel(64, 48, np.diag([60.0, 60.0, 1.0])), se3.from_rotation_translation(np.eye(3), np.full(3, 2e6))
    rig = CameraRig((Camera("left", lens, far),))
    for dump, load, name in (
        (dump_calibration_toml, load_pose2sim, "a.toml"), (dump_opencv, lambda path: load_opencv([path]), "a.yaml"),
        (dump_qualisys, load_qualisys, "a.xml"),
    ):  # fmt: skip
        dump(rig, tmp_path / name)
        assert load(tmp_path / name)["left"].center == pytest.approx(2e6)


@pytest.mark.parametrize("width", [".nan", ".inf", "640.5", "wide", "-640", "100001", "[640]"])
def test_a_width_that_is_none_is_refused_by_opencv(tmp_path, width):
    """What was no number counted as not there, and the size given by hand took its place."""
    path = opencv_yaml(tmp_path, LENS.replace("640", width))
    with pytest.raises(FileFormatError, match=r"image_width.*a width and a height of 1 to 100000 whole pixels"):
        load_opencv([path], (640, 480))
    path = opencv_yaml(tmp_path, LENS.replace("640", "0").replace("480", "0") + "errors: [.nan, 1]\n")  # nobody reads the errors
    assert load_opencv([path], (640, 480)).cameras[0].model.width == 640
