"""``tracker_node rig check`` on files: exit status, sentences, pictures, JSON."""

import json

import cv2
import numpy as np
import pytest
from moving_balls import ball_images, balls_rig

from tracker_node.cli.main import main
from tracker_node.loaders.rig_yaml import load_rig, rig_file_of, write_rig_file

N = 16


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A rig of three cameras with folders of images."""
    folder = tmp_path_factory.mktemp("balls")
    rig = balls_rig(3)
    for name, images in ball_images(rig, N).items():
        (folder / name).mkdir()
        for i, image in enumerate(images):
            cv2.imwrite(str(folder / name / f"{i:03}.png"), image)
    rig_file = rig_file_of(rig)
    cameras = {name: entry.model_copy(update={"source": name}) for name, entry in rig_file.cameras.items()}
    write_rig_file(rig_file.model_copy(update={"cameras": cameras}), folder / "rig.yaml")
    return folder


def test_a_sound_rig_is_told_to_be_sound_and_drawn(folder, tmp_path, capsys):
    assert main(["rig", "check", str(folder / "rig.yaml"), "--output", str(tmp_path / "check")]) == 0
    assert "Nothing found." in capsys.readouterr().out
    assert json.loads((tmp_path / "check" / "findings.json").read_text())["findings"] == []
    assert "<img" in (tmp_path / "check" / "index.html").read_text()
    for name in ("cam1", "cam2", "cam3"):
        picture = cv2.imread(str(tmp_path / "check" / f"{name}.png"))
        assert picture.shape[1] == 960 and np.ptp(picture) > 100


def test_images_of_another_size_are_told_and_end_with_status_1(folder, tmp_path, capsys):
    small = tmp_path / "small"
    small.mkdir()
    for file in sorted((folder / "cam2").iterdir()):
        cv2.imwrite(str(small / file.name), cv2.resize(cv2.imread(str(file)), (160, 120)))
    output = tmp_path / "check"
    assert main(["rig", "check", str(folder / "rig.yaml"), f"cam2={small}", "-o", str(output)]) == 1
    assert "cam2: its images are 160x120, the calibration is for 320x240" in capsys.readouterr().out
    (finding,) = json.loads((output / "findings.json").read_text())["findings"]
    assert (finding["fault"], finding["cameras"]) == ("resolution", ["cam2"])


def test_a_missing_source_is_a_finding(folder, tmp_path, capsys):
    assert main(["rig", "check", str(folder / "rig.yaml"), "cam3=nowhere.mp4", "-o", str(tmp_path / "check")]) == 1
    assert "cam3: no images: image source 'nowhere.mp4': no such file or folder" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        (["one.mp4", "two.mp4"], "expected a bag, one source for each of cam1, cam2, cam3"),
        (["cam9=one.mp4"], "unknown camera 'cam9'; valid: cam1, cam2, cam3"),
        (["--seconds", "0"], "expected a number in (0, 600], got 0"),
    ],
)
def test_wrong_arguments_are_one_line(folder, inputs, message, capsys):
    assert main(["rig", "check", str(folder / "rig.yaml"), *inputs]) == 2
    assert message in capsys.readouterr().err


def test_the_rig_is_left_as_it_is(folder, tmp_path):
    before = (folder / "rig.yaml").read_text()
    main(["rig", "check", str(folder / "rig.yaml"), "--output", str(tmp_path / "check"), "--seconds", "0.1"])
    assert (folder / "rig.yaml").read_text() == before
    assert len(load_rig(folder / "rig.yaml")) == 3
