"""``calibrate refine`` and ``calibrate background`` on files, as a user runs them."""

import json
import shutil

import cv2
import numpy as np
import pytest

from helpers.bodies.openpose_points import write_points
from helpers.cameras.camera_rigs import circle_rig, disturbed
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file, rig_file_of, write_rig_file


@pytest.fixture
def files(tmp_path):
    rig = circle_rig()
    write_points(tmp_path / "pose", rig)
    write_rig_file(rig_file_of(disturbed(rig)), tmp_path / "rig.yaml")
    return tmp_path


def refine(files, *arguments):
    base = ["calibrate", "refine", "--rig", str(files / "rig.yaml"), "--points2d", str(files / "pose")]
    return main([*base, "-o", str(files / "refined.yaml"), *arguments])


def test_a_disturbed_rig_is_mended(files, capsys):
    assert refine(files) == 0
    metrics = json.loads((files / "refined.json").read_text())["metrics"]
    assert metrics["refine.rms_before_px"] > 3.0
    assert metrics["refine.rms_after_px"] < 1.5
    assert metrics["refine.converged"] == 1
    true, given, refined = circle_rig(), load_rig(files / "rig.yaml"), load_rig(files / "refined.yaml")
    apart = [np.linalg.norm(rig["cam03"].center - rig["cam02"].center) for rig in (true, given, refined)]
    assert abs(apart[2] - apart[0]) < abs(apart[1] - apart[0]) + 0.02
    assert "cam04" in capsys.readouterr().out


def test_each_camera_needs_points_of_its_own(files, capsys):
    shutil.rmtree(files / "pose/cam03_json")
    assert refine(files) == 2
    assert "2D points for camera 'cam03'; valid: cam01_json, cam02_json, cam04_json" in capsys.readouterr().err


def test_joints_in_calibration_pixels_of_a_mapped_video(files, capsys):
    """The map is kept in the file, and only used where the joints are in the file's pixels."""
    rig_file = read_rig_file(files / "rig.yaml")
    mapped = {"pixel_map": ((2.0, 0.0, 0.5), (0.0, 2.0, 0.5)), "file_image_size": (320, 240)}
    write_rig_file(rig_file.with_cameras({"cam02": mapped}), files / "rig.yaml")
    assert refine(files) == 2
    assert "say with --pixels" in capsys.readouterr().err
    assert refine(files, "--pixels", "calibration") == 0
    assert json.loads((files / "refined.json").read_text())["metrics"]["refine.rms_after_px"] < 1.5
    assert load_rig(files / "refined.yaml")["cam02"].model.width == 320


def test_nothing_is_overwritten_unless_asked_for(files, capsys):
    (files / "refined.json").write_text("mine")
    assert refine(files) == 2
    assert "refined.json is there already" in capsys.readouterr().err
    assert (files / "refined.json").read_text() == "mine" and not (files / "refined.yaml").exists()
    assert refine(files, "--force") == 0


def test_a_robust_scale_of_nothing_is_refused(files, capsys):
    assert refine(files, "--robust-px", "0") == 2
    assert "--robust-px" in capsys.readouterr().err


def test_a_camera_without_points_is_named(files, capsys):
    for file in (files / "pose" / "cam03_json").iterdir():
        file.unlink()
    assert refine(files) == 2
    assert "camera 'cam03'" in capsys.readouterr().err


def test_plates_from_recordings_go_into_the_rig(files, capsys):
    rng = np.random.default_rng(0)
    rig_file = read_rig_file(files / "rig.yaml")
    cameras = {}
    for name, entry in list(rig_file.cameras.items())[:2]:
        (files / name).mkdir()
        scene = rng.integers(30, 220, (48, 64, 3)).astype(np.uint8)
        scene = cv2.resize(scene, (640, 480), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(files / f"{name}.png"), scene)
        for i in range(6):
            image = scene.copy()
            cv2.circle(image, (150 + 60 * i, 240), 40, (0, 0, 255), cv2.FILLED)
            cv2.imwrite(str(files / name / f"{i}.png"), image)
        cameras[name] = entry.model_copy(update={"source": name})
    write_rig_file(rig_file.model_copy(update={"cameras": cameras}), files / "sourced.yaml")
    arguments = [
        "--rig",
        str(files / "sourced.yaml"),
        "--background-images",
        str(files),
        "--output-dir",
        str(files / "backgrounds"),
    ]
    assert main(["calibrate", "background", *arguments, "-o", str(files / "with_backgrounds.yaml")]) == 0
    for camera in load_rig(files / "with_backgrounds.yaml"):
        plate, scene = cv2.imread(camera.background), cv2.imread(str(files / f"{camera.name}.png"))
        assert np.abs(plate.astype(int) - scene).max() <= 3
    (files / "cam02.png").unlink()
    capsys.readouterr()
    before = (files / "backgrounds" / "cam01.png").read_bytes()
    assert main(["calibrate", "background", *arguments]) == 2
    assert f"{files / 'backgrounds' / 'cam01.png'} is there already" in capsys.readouterr().err
    cv2.imwrite(str(files / "cam01.png"), np.zeros((480, 640, 3), np.uint8))
    assert main(["calibrate", "background", *arguments, "--force"]) == 2
    assert "has no image named cam02" in capsys.readouterr().err
    assert (files / "backgrounds" / "cam01.png").read_bytes() == before  # none is written unless all can be
    again = [*arguments[:2], *arguments[4:], "-o", str(files / "with_backgrounds.yaml")]
    assert main(["calibrate", "background", *again, "--output-dir", str(files / "others")]) == 2
    assert not (files / "others").exists()
    assert main(["calibrate", "background", *again, "--force"]) == 0
