"""``calibrate background``: images of the empty room from recordings, in the rig file, and what is refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file, rig_file_of, write_rig_file

SIZE = (48, 64)


@pytest.fixture
def rig_path(tmp_path):
    """Two cameras with folders of eight images; something white moves over the first half of the images' rows."""
    cameras = []
    rng = np.random.default_rng(0)
    for camera in circle_rig(2).cameras:
        folder = tmp_path / camera.name
        folder.mkdir()
        room = cv2.GaussianBlur(rng.uniform(40, 160, (*SIZE, 3)), (0, 0), 3.0).astype(np.uint8)
        cv2.imwrite(str(tmp_path / f"room_{camera.name}.png"), room)
        for i in range(8):
            image = room.copy()
            image[4:20, 8 * i : 8 * i + 8] = 250
            cv2.imwrite(str(folder / f"{i:03d}.png"), image)
        cameras.append(replace(camera, model=camera.model.resized(SIZE[1], SIZE[0]), source=str(folder)))
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), tmp_path / "rig.yaml")
    return tmp_path / "rig.yaml"


def run(rig_path, *arguments):
    folder = rig_path.parent
    return main(["calibrate", "background", "--rig", str(rig_path), "--output-dir", str(folder / "backgrounds"), *arguments])


def test_backgrounds_show_the_room_and_are_named_in_the_rig(rig_path, tmp_path, capsys):
    assert run(rig_path, "--images", "8", "-o", str(tmp_path / "with.yaml")) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("cam01: 0.0 % of the background not known")
    for camera in load_rig(rig_path):
        plate = cv2.imread(str(tmp_path / "backgrounds" / f"{camera.name}.png")).astype(int)
        room = cv2.imread(str(tmp_path / f"room_{camera.name}.png")).astype(int)
        assert np.abs(plate - room).max() <= 3
    entries = read_rig_file(tmp_path / "with.yaml").cameras
    assert [(tmp_path / entry.background).resolve() for entry in entries.values()] == [
        (tmp_path / "backgrounds" / f"{name}.png").resolve() for name in ("cam01", "cam02")
    ]
    assert said[-1] == f"wrote {tmp_path / 'with.yaml'}"


def test_what_always_stands_there_is_not_known_or_comes_from_a_still(rig_path, tmp_path, capsys):
    """In a quarter of the image something else is seen in every image."""
    rng = np.random.default_rng(1)
    for path in sorted((tmp_path / "cam01").glob("*.png")):
        image = cv2.imread(str(path))
        image[24:, 32:] = rng.integers(0, 256, (24, 32, 3))
        cv2.imwrite(str(path), image)
    assert run(rig_path, "--images", "8") == 0
    share = float(capsys.readouterr().out.split("cam01: ")[1].split(" %")[0])
    assert 10.0 < share < 40.0
    stills = tmp_path / "stills"
    stills.mkdir()
    for name in ("cam01", "cam02"):
        (tmp_path / f"room_{name}.png").rename(stills / f"{name}.png")
    assert run(rig_path, "--images", "8", "--force", "--background-images", str(stills)) == 0
    assert "% of the background from its image alone" in capsys.readouterr().out
    plate = cv2.imread(str(tmp_path / "backgrounds/cam01.png")).astype(int)
    room = cv2.imread(str(stills / "cam01.png")).astype(int)
    assert np.abs(plate - room)[26:, 34:].mean() < 10.0


def test_backgrounds_that_are_there_stay(rig_path, capsys):
    assert run(rig_path, "--images", "8") == 0
    assert run(rig_path, "--images", "8") == 2
    assert "--force" in capsys.readouterr().err
    assert run(rig_path, "--images", "8", "--force") == 0


def test_a_camera_without_a_source_is_named(rig_path, tmp_path, capsys):
    rig = load_rig(rig_path)
    write_rig_file(rig_file_of(CameraRig((rig.cameras[0], replace(rig.cameras[1], source=None)))), tmp_path / "two.yaml")
    assert run(tmp_path / "two.yaml", "--images", "8") == 2
    assert "cam02" in capsys.readouterr().err


def test_an_image_or_a_video_beside_the_recordings_is_found(rig_path, tmp_path, capsys):
    """Somebody is in a part of cam01 always; its image alone lies beside, that of cam02 is a short video."""
    rng = np.random.default_rng(1)
    for path in sorted((tmp_path / "cam01").glob("*.png")):
        image = cv2.imread(str(path))
        image[24:, 32:] = rng.integers(0, 256, (24, 32, 3))
        cv2.imwrite(str(path), image)
    (tmp_path / "background").mkdir()
    (tmp_path / "room_cam01.png").rename(tmp_path / "background/cam01.png")
    writer = cv2.VideoWriter(str(tmp_path / "cam02_empty.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, SIZE[::-1])
    for _ in range(4):
        writer.write(cv2.imread(str(tmp_path / "room_cam02.png")))
    writer.release()
    assert run(rig_path, "--images", "8", "-o", str(tmp_path / "with.yaml")) == 0
    said = capsys.readouterr().out
    assert f"cam01: its background alone is in {tmp_path / 'background/cam01.png'}" in said and "cam02_empty.avi" in said
    plate = cv2.imread(str(tmp_path / "backgrounds/cam01.png")).astype(int)
    room = cv2.imread(str(tmp_path / "background/cam01.png")).astype(int)
    assert np.abs(plate - room)[26:, 34:].mean() < 10.0
    assert read_rig_file(tmp_path / "with.yaml").cameras["cam01"].background == "backgrounds/cam01.png"
    (tmp_path / "cam01_background.png").write_bytes((tmp_path / "background/cam01.png").read_bytes())
    assert run(rig_path, "--images", "8", "--force") == 2
    assert "one image of its background, got" in capsys.readouterr().err


def test_what_is_not_to_be_relied_on_gets_no_background(rig_path, tmp_path, capsys):
    """In cam01 a part never settles; in the second recording of cam02 nobody moves, and may stand there."""
    rng = np.random.default_rng(1)
    for path in sorted((tmp_path / "cam01").glob("*.png")):
        image = cv2.imread(str(path))
        image[24:, 32:] = rng.integers(0, 256, (24, 32, 3))
        cv2.imwrite(str(path), image)
    assert run(rig_path, "--images", "8", "-o", str(tmp_path / "with.yaml")) == 0
    assert "note: cam01 gets no background" in capsys.readouterr().out
    entries = read_rig_file(tmp_path / "with.yaml").cameras
    assert entries["cam01"].background is None and entries["cam02"].background
    assert run(rig_path, "--images", "8", "--force", "--most-unknown", "100", "-o", str(tmp_path / "with.yaml")) == 0
    assert read_rig_file(tmp_path / "with.yaml").cameras["cam01"].background
    for path in (tmp_path / "cam02").glob("*.png"):
        cv2.imwrite(str(path), cv2.imread(str(tmp_path / "room_cam02.png")))
    capsys.readouterr()
    assert run(rig_path, "--images", "8", "--force") == 2
    said = capsys.readouterr()
    assert "nothing moves in its images" in said.out and "no background is to be relied on" in said.err
    assert run(rig_path, "--images", "8", "--most-unknown", "101") == 2


def test_how_much_may_be_unknown_says_nothing_beside_images_of_all_of_it(rig_path, tmp_path, capsys):
    assert run(rig_path, "--images", "8", "--background-images", str(tmp_path), "--most-unknown", "3") == 2
    assert "--most-unknown" in capsys.readouterr().err and not (tmp_path / "backgrounds").exists()
