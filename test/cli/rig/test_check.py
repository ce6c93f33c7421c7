"""``tracker_node rig check`` on files: exit status, sentences, pictures, JSON."""

import json
import shutil

import cv2
import numpy as np
import pytest

from helpers.cameras.moving_balls import write_balls
from tracker_node.cli.main import main
from tracker_node.doctor.diagnosis import examine
from tracker_node.doctor.recording import record
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A rig of three cameras with folders of images."""
    folder = tmp_path_factory.mktemp("balls")
    write_balls(folder)
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


def late(folder, tmp_path, seconds, **others):
    """The rig with the clock of cam1 later, and other sources."""
    rig_file = rig_file_of(load_rig(folder / "rig.yaml")).with_cameras({"cam1": {"time_offset_s": seconds}})
    sources = {name: {"source": str(source)} for name, source in others.items()}
    write_rig_file(rig_file.with_cameras(sources), tmp_path / "late.yaml")
    return str(tmp_path / "late.yaml")


def test_cameras_that_were_not_compared_are_not_called_sound(folder, tmp_path, capsys):
    output = tmp_path / "check"
    assert main(["rig", "check", late(folder, tmp_path, 60.0), "-o", str(output)]) == 3
    told = capsys.readouterr().out
    assert "not checked: places, lenses and clocks" in told and "Nothing found." not in told
    assert json.loads((output / "findings.json").read_text())["compared"] is False
    assert "nothing is wrong with the images of single cameras" in (output / "index.html").read_text().lower()


def test_all_cameras_are_looked_at_from_when_the_last_begins(folder, tmp_path, capsys):
    """The others began two seconds before, and nothing happened then."""
    sources = {}
    for name in ("cam2", "cam3"):
        sources[name] = tmp_path / name
        sources[name].mkdir()
        files = sorted((folder / name).iterdir())
        for i in range(60):  # two seconds in which nothing happens, and then what the late camera sees
            shutil.copy(files[0], sources[name] / f"{i:03}.png")
        for i, file in enumerate(files, start=60):
            shutil.copy(file, sources[name] / f"{i:03}.png")
    rig = load_rig(late(folder, tmp_path, 2.0, **sources))
    recordings = record(rig, seconds=0.4)
    assert {r.stamps_ns[0] for r in recordings.values()} == {2 * 10**9}
    assert {len(r) for r in recordings.values()} == {12}
    assert examine(rig, recordings).compared
    assert not examine(rig, recordings).findings


def test_a_folder_of_somebody_else_is_not_written_to(folder, tmp_path, capsys):
    mine = tmp_path / "cam1.png"
    mine.write_bytes(b"mine")
    assert main(["rig", "check", str(folder / "rig.yaml"), "-o", str(tmp_path)]) == 2
    assert "holds other files" in capsys.readouterr().err and mine.read_bytes() == b"mine"
    assert [path.name for path in tmp_path.iterdir()] == ["cam1.png"]
    for _ in range(2):  # its own folder is written to again
        main(["rig", "check", str(folder / "rig.yaml"), "-o", str(tmp_path / "check"), "--seconds", "0.1"])
    assert (tmp_path / "check" / "findings.json").exists()


def test_the_rig_is_left_as_it_is(folder, tmp_path):
    before = (folder / "rig.yaml").read_text()
    main(["rig", "check", str(folder / "rig.yaml"), "--output", str(tmp_path / "check"), "--seconds", "0.1"])
    assert (folder / "rig.yaml").read_text() == before
    assert len(load_rig(folder / "rig.yaml")) == 3
