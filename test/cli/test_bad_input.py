"""What users' files and cameras do wrong, through the real command: named clearly, and what can go on goes on."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import in_millimetres
from helpers.cameras.small_clip import Clip, make_clip
from tracker_node.cli.arguments.run_images import nothing_tracked
from tracker_node.cli.main import main
from tracker_node.errors import SourceError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.loaders.motion.trajectory_file import read_states
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros.ingest.cameras import chosen_cameras, open_cameras

N_IMAGES = 8
CAMERAS = ("cam01", "cam02", "cam03")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_clip(tmp_path_factory.mktemp("bad") / "clip", N_IMAGES)


@dataclass(frozen=True)
class Outcome:
    """What the command left: exit status, what it said, and where."""

    status: int
    said: str
    folder: Path

    @property
    def summary(self) -> dict:
        return json.loads((self.folder / "run.json").read_text())

    @property
    def states(self) -> list[tuple[str, str]]:
        return [(row.status, row.reason) for row in read_states(self.folder / "states.csv").rows]


@pytest.fixture
def outcome(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture) -> Callable[..., Outcome]:
    def run(damage: Callable[[Path], object], *options: str) -> Outcome:
        folder = tmp_path / "clip"
        shutil.copytree(clip.folder, folder)
        damage(folder)
        files = {"rig": "rig.yaml", "model": "model.yaml", "config": "config.yaml", "initial-state": "start.yaml"}
        named = [text for name, file in files.items() for text in (f"--{name}", str(folder / file))]
        quiet = [] if "--told" in options else ["--quiet"]
        options = tuple(option for option in options if option != "--told")
        status = main(["track", *named, "--output", str(tmp_path / "run"), *quiet, *options])
        return Outcome(status, capsys.readouterr().err, tmp_path / "run")

    return run


def edit(file: str, old: str, new: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new, 1))

    return damage


def as_one_file(content: bytes) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        shutil.rmtree(folder / "cam02")
        (folder / "cam02").write_bytes(content)

    return damage


def shrunk(folder: Path) -> None:
    for path in (folder / "cam02").iterdir():
        cv2.imwrite(str(path), np.zeros((60, 80, 3), np.uint8))


UNUSABLE = {
    "missing": (lambda folder: shutil.rmtree(folder / "cam02"), "no such file or folder"),
    "empty folder": (lambda folder: [p.unlink() for p in (folder / "cam02").iterdir()], "no image files there"),
    "no video": (as_one_file(b"nonsense" * 500), "cannot be opened as a video"),
    "empty file": (as_one_file(b""), "cannot be opened as a video"),
    "another size": (shrunk, "image size contradicts the calibration: expected 160x120, got 80x60"),
}


@pytest.mark.parametrize("kind", UNUSABLE)
def test_a_source_that_cannot_be_used_is_named_and_the_others_go_on(outcome, kind):
    damage, complaint = UNUSABLE[kind]
    result = outcome(damage)
    assert result.status == 1
    (line,) = [line for line in result.said.splitlines() if complaint in line]
    assert "cam02" in line and "left out" in line
    assert result.summary["image_sets"] == N_IMAGES
    # The tracker's rig still has the camera
    assert {status for status, _ in result.states} == {"DEGRADED"}


def test_a_source_that_cannot_be_used_is_told_before_anything_is_tracked(outcome):
    result = outcome(lambda folder: shutil.rmtree(folder / "cam02"), "--told", "--max-sets", "2")
    lines = result.said.splitlines()
    (told,) = [i for i, line in enumerate(lines) if "left out" in line]
    assert told < min(i for i, line in enumerate(lines) if "image sets, " in line)


def nobody(folder: Path) -> None:
    for name in CAMERAS:
        for path in (folder / name).iterdir():
            shutil.copy(folder / f"{name}_plate.png", path)


def test_a_run_that_is_lost_throughout_says_so_and_has_a_status_of_its_own(outcome):
    result = outcome(nobody)
    assert result.status == 3
    assert {status for status, _ in result.states} == {"LOST"}
    _, line = result.said.splitlines()  # the first: no rate in image folders
    assert f"LOST in all {N_IMAGES} image sets" in line and "leave out the initial state" in line and "rig check" in line


@pytest.mark.parametrize(("counts", "given", "words"), [
    ({"INITIALIZING": 9}, False, "found in none of 9 image sets (nothing moves): give --initial-state"),
    ({"INITIALIZING": 4, "LOST": 5}, False, "tracked in none of 9 image sets (mostly: nothing moves); likely the start was"),
    ({}, True, "no image set was formed"),
])  # fmt: skip
def test_what_is_said_of_a_run_without_a_tracked_set(capsys, counts, given, words):
    assert nothing_tracked("track", counts, "nothing moves", given) == 3
    assert words in capsys.readouterr().err
    assert nothing_tracked("track", counts | {"DEGRADED": 1}, "", given) == 0
    assert not capsys.readouterr().err


def test_another_aspect_is_refused_with_the_nearest_sizes(outcome):
    result = outcome(lambda folder: None, "--resize", "120x60")
    assert result.status == 2 and not result.folder.exists()
    (line,) = result.said.splitlines()
    assert "120x60 (aspect 2.000) of images of 160x120 (1.333)" in line and "give 120x90 or 80x60" in line
    with pytest.raises(SourceError, match="give 120x90 or 80x60"):
        open_cameras(chosen_cameras(load_rig(result.folder.parent / "clip/rig.yaml")), SourceOptions(size=(120, 60)))


def test_with_no_source_at_all_nothing_is_begun(outcome):
    result = outcome(lambda folder: [shutil.rmtree(folder / name) for name in CAMERAS])
    assert result.status == 2
    assert all(name in result.said for name in CAMERAS)
    assert not result.folder.exists()


MISTAKES = {
    "millimeters": (
        lambda folder: in_millimetres(folder / "rig.yaml", folder / "rig.yaml"),
        ["rig", "millimeters, a rig is in meters", "Divide it by 1000", "rig check"],
    ),
    "uncalibrated": (edit("rig.yaml", "150.0", "0.0"), ["cam01", "uncalibrated (K[0] = 0)"]),
    "two parents": (
        edit("model.yaml", "child: fore", "child: upper"),
        ["model.yaml", "joints.elbow.child", "no other joint carries", "upper"],
    ),
    "cycle": (edit("model.yaml", "parent: trunk", "parent: fore"), ["model.yaml", "cycle"]),
    "self": (edit("model.yaml", "parent: upper", "parent: fore"), ["model.yaml", "cycle"]),
    "unknown parent": (
        edit("model.yaml", "parent: upper", "parent: uper"),
        ["model.yaml", "joints.elbow.parent", "'fore', 'trunk', 'upper'", "uper"],
    ),
    "unknown link of a shape": (
        edit("model.yaml", "link: fore", "link: four"),
        ["model.yaml", "shapes.fore.link", "'fore', 'trunk', 'upper'", "four"],
    ),
    "unknown joint in the state": (edit("start.yaml", "elbow_flexion", "elbow"), ["start.yaml", "elbow", "elbow_flexion"]),
    "unknown parameter": (edit("config.yaml", "threads", "thread"), ["config.yaml", "thread", "threads"]),
    "plate missing": (lambda folder: (folder / "cam03_plate.png").unlink(), ["cam03_plate.png", "cam03"]),
    "plate of another size": (
        lambda folder: cv2.imwrite(str(folder / "cam03_plate.png"), np.zeros((60, 80, 3), np.uint8)),
        ["cam03", "160x120", "80x60"],
    ),
    "state missing": (lambda folder: (folder / "start.yaml").unlink(), ["start.yaml", "no such file"]),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_in_a_file_is_named_before_anything_is_begun(outcome, kind):
    damage, words = MISTAKES[kind]
    result = outcome(damage)
    assert result.status == 2
    assert not result.folder.exists()
    line = result.said.strip().splitlines()[-1]
    assert line.startswith("tracker_node track: error: ")
    assert all(word in line for word in words), line
    assert "Traceback" not in result.said


def test_a_scene_without_the_body_is_lost_and_recorded(outcome):
    def leave(folder: Path) -> None:
        for name in CAMERAS:
            for path in sorted((folder / name).iterdir())[3:]:
                shutil.copy(folder / f"{name}_plate.png", path)

    result = outcome(leave)
    assert result.status == 0
    assert [status for status, _ in result.states] == ["TRACKING"] * 3 + ["LOST"] * 5
    assert all(reason for _, reason in result.states[3:])
    assert result.summary["lost_sets"] == 5


def stops_after(n: int) -> Callable[[Path], None]:
    return lambda folder: [path.unlink() for path in sorted((folder / "cam02").iterdir())[n:]]


def test_a_camera_that_stops_is_named_and_the_others_go_on(outcome):
    result = outcome(stops_after(3))
    assert result.status == 1
    assert "camera 'cam02' stopped 0.17 s before the others" in result.said
    assert [status for status, _ in result.states] == ["TRACKING"] * 3 + ["DEGRADED"] * 5
    assert result.summary["images"]["cam01"]["used"] == N_IMAGES


def test_where_all_cameras_are_asked_for_the_rest_is_kept_and_the_reason_said(outcome):
    def damage(folder: Path) -> None:
        stops_after(3)(folder)
        (folder / "config.yaml").write_text("synchronizer: {min_cameras: 0}\n")

    result = outcome(damage)
    assert result.status == 1
    assert "camera 'cam02' stopped 0.17 s before the others; a set needs all cameras" in result.said
    assert len(result.states) == result.summary["image_sets"] == 3
    with BagReader(result.folder / "bag") as reader:
        assert (reader.topic("/tracker/state").message_count, reader.recovered) == (3, False)


def test_a_video_that_breaks_off_is_named_with_the_place(outcome):
    def damage(folder: Path) -> None:
        for path in sorted((folder / "cam03").iterdir())[5:]:
            path.write_bytes(b"not an image")

    result = outcome(damage)
    assert result.status == 1
    assert "camera 'cam03' after 5 images" in result.said and "0005.png" in result.said
    assert [status for status, _ in result.states] == ["TRACKING"] * 5 + ["DEGRADED"] * 3
