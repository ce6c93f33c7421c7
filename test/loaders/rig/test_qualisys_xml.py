"""Qualisys calibrations: figures of a file worked out by hand, and what is refused."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.rig.qualisys_xml import dump_qualisys, load_qualisys

FOV = '<fov_video left="10" top="20" right="649" bottom="499"/>'
TRANSFORM = '<transform r11="0" r12="1" r13="0" r21="0" r22="0" r23="1" r31="1" r32="0" r33="0" x="1000" y="-2500" z="1750"/>'
INTRINSIC = (
    '<intrinsic focalLengthU="38400" focalLengthV="37760" centerPointU="20480" centerPointV="17280" skew="64" '
    'radialDistortion1="-0.1" radialDistortion2="0.02" radialDistortion3="0.003" '
    'tangentalDistortion1="0.0001" tangentalDistortion2="-0.0002"/>'
)


def xml(*cameras: str, tag: str = "calibration") -> str:
    return f"<{tag}><cameras>{''.join(cameras)}</cameras></{tag}>"


def camera(inside: str = FOV + TRANSFORM + INTRINSIC, head: str = 'active="1" serial="7"') -> str:
    return f"<camera {head}>{inside}</camera>"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.qca.txt"


def loaded(path, text: str) -> CameraRig:
    path.write_text(text)
    return load_qualisys(path)


def test_a_camera(path):
    (one,) = loaded(path, xml(camera()))
    lens = one.model
    assert one.name == "cam_7" and (lens.width, lens.height) == (640, 480)
    assert pytest.approx(np.array([[600.0, 1.0, 310.0], [0.0, 590.0, 250.0], [0.0, 0.0, 1.0]])) == lens.K
    assert lens.distortion_model == "plumb_bob" and lens.distortion.tolist() == [-0.1, 0.02, 0.0001, -0.0002, 0.003]
    # Its right is the world's y, its up z, its back x: forward is -x, down -z
    wanted = [[0.0, 0.0, -1.0, 1.0], [1.0, 0.0, 0.0, -2.5], [0.0, -1.0, 0.0, 1.75], [0.0, 0.0, 0.0, 1.0]]
    assert one.T_world_cam == pytest.approx(np.array(wanted))


def test_a_lens_without_distortion_and_skew(path):
    plain = '<intrinsic focalLengthU="38400" focalLengthV="37760" centerPointU="20480" centerPointV="17280"/>'
    (one,) = loaded(path, xml(camera(FOV + TRANSFORM + plain)))
    assert one.model.distortion_model == "none" and one.model.K[0, 1] == 0.0


def test_only_active_cameras_count(path):
    rig = loaded(path, xml(camera(head='serial="a"'), camera("", 'active="0" serial="b"'), camera(head='active="1" serial="c"')))
    assert [one.name for one in rig] == ["a", "c"]


def test_what_is_written_is_read_back(path):
    rig = loaded(path, xml(camera(), camera(head='serial="b"')))
    dump_qualisys(rig, path)
    text = path.read_text()
    assert 'serial="cam_7"' in text and 'left="0" top="0" right="639" bottom="479"' in text
    assert 'focalLengthU="38400.0"' in text and 'x="1000.0"' in text and 'radialDistortion3="0.003"' in text
    again = load_qualisys(path)
    for old, new in zip(rig, again, strict=True):
        assert old.name == new.name and pytest.approx(old.model.K) == new.model.K
        assert new.model.distortion.tolist() == old.model.distortion.tolist()
        assert new.T_world_cam == pytest.approx(old.T_world_cam)


def test_lenses_that_the_format_cannot_hold(path):
    lens = CameraModel(64, 48, [[60, 0, 32], [0, 60, 24], [0, 0, 1]], "equidistant", [0.1, 0, 0, 0])
    with pytest.raises(CalibrationError, match="cannot hold a lens of the kind equidistant"):
        dump_qualisys(CameraRig((Camera("a", lens, np.eye(4)),)), path)
    dump_qualisys(CameraRig((Camera("a", CameraModel(64, 48, lens.K), np.eye(4)),)), path)
    assert load_qualisys(path)["a"].model.distortion_model == "none"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<calibration>", r"'line 1, column 14': expected XML, got 'no element found'"),
        (xml(camera(), tag="rig"), r"<calibration> with <cameras> of which one is active, got '?<rig>"),
        (xml(camera(head='active="0" serial="7"')), r"of which one is active, got '?<calibration>"),
        (xml(camera(), camera()), r"'serial': expected cameras, each with a different name, got \['cam_7', 'cam_7'\]"),
        (xml(camera(FOV + INTRINSIC)), r"'cameras.cam_7.transform': expected an element of that name, got 'none'"),
        (xml(camera(FOV.replace("10", "x") + TRANSFORM + INTRINSIC)), r"'cameras.cam_7.fov_video.left': expected a number"),
        (xml(camera(FOV.replace('left="10" ', "") + TRANSFORM + INTRINSIC)), r"fov_video.left': expected a number"),
        (xml(camera(FOV + TRANSFORM.replace("1750", "nan") + INTRINSIC)), r"transform.z': expected a finite number"),
        (xml(camera(FOV + TRANSFORM.replace("1750", "1.1e12") + INTRINSIC)), r"transform.z': expected a finite number"),
        (xml(camera(FOV + TRANSFORM.replace('r31="1"', 'r31="1.01"') + INTRINSIC)), r"transform': expected a proper rotation"),
        (xml(camera(FOV + TRANSFORM.replace('r31="1"', 'r31="-1"') + INTRINSIC)), r"transform': expected a proper rotation"),
        (xml(camera(FOV.replace("649", "9") + TRANSFORM + INTRINSIC)), r"fov_video': expected a width and a height of 1 to"),
        (xml(camera(FOV.replace("499", "19") + TRANSFORM + INTRINSIC)), r"fov_video': expected a width and a height of 1 to"),
        (xml(camera(FOV.replace("649", "500000") + TRANSFORM + INTRINSIC)), r"1 to 100000 whole pixels, got \(499991.0, 480.0\)"),
        (xml(camera(FOV + TRANSFORM + INTRINSIC.replace("38400", "-1"))), r"intrinsic': expected a lens that can be built"),
    ],
)
def test_refusals(path, text, said):
    with pytest.raises(FileFormatError, match=said):
        loaded(path, text)


def test_rounded_rotations_become_exact(path):
    (one,) = loaded(path, xml(camera(FOV + TRANSFORM.replace('r31="1"', 'r31="1.00002"') + INTRINSIC)))
    rotation = one.T_world_cam[:3, :3]
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
