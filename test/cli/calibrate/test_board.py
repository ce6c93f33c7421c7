"""``calibrate rig`` and ``calibrate intrinsics``: from folders and videos of a board to a rig file, and what is refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.board_scenes import picture, ring
from tracker_node.calibration.board.board import Board
from tracker_node.calibration.board.rig import calibrate_rig
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.cli.main import main
from tracker_node.geometry import se3, so3
from tracker_node.loaders.rig.rig_yaml import load_rig

BOARD = Board("charuco", 6, 5, 0.12)
RIG = CameraRig(tuple(Camera(c.name, c.model.resized(640, 400), c.T_world_cam) for c in ring(8, ["plumb_bob"]).cameras[:2]))
GIVEN = ["--charuco", "6x5", "--square", "0.12", "--quiet"]


def held(i: int) -> np.ndarray:
    """T_world_board between the two cameras, leaning another way each time."""
    middle = 0.5 * (RIG.cameras[0].center + RIG.cameras[1].center)
    angle = 2.4 * i
    place = 0.35 * middle + [0.25 * np.cos(angle), 0.25 * np.sin(angle), 0.75 + 0.1 * np.sin(3.0 * angle)]
    z = (middle - place) / np.linalg.norm(middle - place)
    x = np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    lean = so3.exp([0.45 * np.cos(angle), 0.45 * np.sin(1.7 * angle), 0.3 * angle])
    return se3.from_rotation_translation(np.column_stack([x, np.cross(z, x), z]) @ lean, place)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Image folders ``left`` and ``right`` with twelve pictures each of one board."""
    folder = tmp_path_factory.mktemp("films")
    for name, camera in zip(("left", "right"), RIG, strict=True):
        (folder / name).mkdir()
        for i in range(12):
            cv2.imwrite(str(folder / name / f"{i:02d}.png"), picture(camera, BOARD, held(i), seed=i))
    return folder


def calibrate(*arguments):
    return main(["calibrate", *map(str, arguments)])


def test_a_rig_from_folders_of_images(folders, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)  # sources are given relative to it
    output = tmp_path / "rig.yaml"
    videos = [folders / "left", folders / "right"]
    assert calibrate("rig", "--videos", *videos, *GIVEN, "--sources", "videos/{name}.mp4", "-o", output) == 0
    rig, said = load_rig(output), capsys.readouterr().out
    assert rig.names == ("left", "right") and rig["left"].source == str(tmp_path / "videos" / "left.mp4")
    relative = [cameras[0].T_cam_world @ cameras[1].T_world_cam for cameras in (rig.cameras, RIG.cameras)]
    assert np.linalg.norm(relative[0][:3, 3] - relative[1][:3, 3]) < 0.03
    assert np.degrees(np.linalg.norm(so3.log(relative[0][:3, :3].T @ relative[1][:3, :3]))) < 1.0
    assert "left right" in said and "left: the board in 12 of 12 images" in said
    assert (tmp_path / "rig.html").read_text().count("data:image/png") == 2
    assert cv2.imread(str(tmp_path / "coverage_left.png")).shape == (400, 640, 3) and (tmp_path / "rig.json").exists()


def test_a_camera_without_boards_does_not_stop_the_others(folders, tmp_path, capsys):
    for name, image in (("away", np.full((400, 640), 90, np.uint8)), ("behind", None)):
        (tmp_path / name).mkdir()
        for i in range(4):
            back = cv2.flip(cv2.imread(str(folders / "left" / f"{i:02d}.png")), 1)
            cv2.imwrite(str(tmp_path / name / f"{i:02d}.png"), back if image is None else image)
    videos = [folders / "left", tmp_path / "away", folders / "right", tmp_path / "behind"]
    assert calibrate("rig", "--videos", *videos, *GIVEN, "-o", tmp_path / "rig.yaml") == 1
    said = capsys.readouterr().err.splitlines()
    assert [line.split(":")[1] for line in said] == [" away", " behind"]
    assert all("this camera is left out" in line for line in said)
    assert "are its columns and rows" in said[0] and "its mirrored back is" in said[1]
    assert load_rig(tmp_path / "rig.yaml").names == ("left", "right")


@pytest.mark.long
def test_lenses_first_then_places_and_nothing_is_overwritten(folders, tmp_path, capsys):
    lenses, output = tmp_path / "lenses.yaml", tmp_path / "rig.yaml"
    videos = [f"a={folders / 'left'}", f"b={folders / 'right'}"]
    assert calibrate("intrinsics", "--videos", *videos, *GIVEN, "-o", lenses) == 0
    found = load_rig(lenses)["a"].model
    assert found.K[0, 0] == pytest.approx(RIG.cameras[0].model.K[0, 0], rel=0.02)
    assert calibrate("rig", "--videos", *videos, *GIVEN, "--lenses", lenses, "--keep-lenses", "-o", output) == 0
    np.testing.assert_allclose(load_rig(output)["a"].model.K, found.K)
    capsys.readouterr()
    for command in (("intrinsics", "-o", lenses), ("rig", "-o", output), ("rig", "-o", tmp_path / "x.yaml", "--report", lenses)):
        before = {file: file.read_bytes() for file in tmp_path.iterdir()}
        assert calibrate(command[0], "--videos", *videos, *GIVEN, *command[1:]) == 2
        assert "is there already" in capsys.readouterr().err
        assert before == {file: file.read_bytes() for file in tmp_path.iterdir()}
    assert calibrate("intrinsics", "--videos", *videos, *GIVEN, "-o", lenses, "--force") == 0


def refusal(capsys, tmp_path, *arguments) -> str:
    """What is said, after seeing that nothing has been written."""
    before = set(tmp_path.iterdir())
    capsys.readouterr()
    assert calibrate(*arguments, "-o", tmp_path / "rig.yaml") == 2
    assert set(tmp_path.iterdir()) == before
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "Traceback" not in said
    return said


def test_bad_options_are_named(folders, tmp_path, capsys):
    videos = ["--videos", folders / "left", folders / "right"]

    def said(*arguments):
        return refusal(capsys, tmp_path, "rig", *videos, *arguments)

    assert "'--square': expected the edge of a square in meters, 0.002 to 0.5; 120 mm would be 0.12, got 120.0" in said(
        "--charuco", "6x5", "--square", "120"
    )
    assert "'--charuco'" in said("--charuco", "6by5", "--square", "0.12")
    assert "unknown dictionary 'DICT_9'" in said(*GIVEN, "--dictionary", "DICT_9")
    assert "at most the 50 markers of DICT_4X4_50" in said("--charuco", "30x30", "--square", "0.1", "--dictionary", "DICT_4X4_50")
    assert "'--keep-lenses'" in said(*GIVEN, "--keep-lenses")
    assert "left: field '(file)': expected a video or a sound file, got 'a folder'" in said(*GIVEN, "--clocks", "sound")
    assert "'--clocks': expected no sound beside --stamps" in said(*GIVEN, "--clocks", "sound", "--stamps", "stamps.csv")
    assert "expected a pattern with {name} or {number}" in said(*GIVEN, "--sources", "{nam}.mp4")
    assert "are its columns and rows (inner corners)" in said("--chessboard", "9x6", "--square", "0.1", "--quiet")
    assert "looks the same upside down" in said("--chessboard", "9x7", "--square", "0.1", "--quiet")


def test_bad_recordings_are_named(folders, tmp_path, capsys):
    text = tmp_path / "left.mp4"
    text.write_text("this is no video\n")
    left, right = folders / "left", folders / "right"

    def said(*arguments):
        return refusal(capsys, tmp_path, "rig", *GIVEN, *arguments)

    assert "left.mp4" in said("--videos", text, right)
    assert "no such file" in said("--videos", tmp_path / "nothing.mp4", right)
    assert "two recordings for camera 'left'" in said("--videos", left, left)
    copied = tmp_path / "copied.mp4"
    copied.write_bytes(text.read_bytes())
    assert "got the same for left and copied" in said("--videos", text, copied)
    times = tmp_path / "times.csv"
    times.write_text("camera,time\n" + "".join(f"{name},{i / 10}\n" for name in ("left", "right") for i in range(11)))
    assert "has 11 times for camera 'left'" in said("--videos", left, right, "--stamps", times)
    lenses = tmp_path / "lenses.yaml"
    lenses.write_text(
        "cameras:\n  left: {image_size: [320, 200], K: [[500, 0, 160], [0, 500, 100], [0, 0, 1]],"
        " T_world_cam: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}\n"
    )
    assert "expected 320x200, got 640x400" in said("--videos", left, "--lenses", lenses)
    assert "unknown camera 'right'" in said("--videos", right, left, "--lenses", lenses)


def test_cameras_that_never_see_the_board_together(folders, tmp_path, capsys):
    for name, numbers in (("one", range(6)), ("two", range(6, 12))):
        (tmp_path / name).mkdir()
        for i in range(12):
            image = cv2.imread(str(folders / ("left" if name == "one" else "right") / f"{i:02d}.png"))
            cv2.imwrite(str(tmp_path / name / f"{i:02d}.png"), image if i in numbers else np.full_like(image, 90))
    said = refusal(capsys, tmp_path, "rig", "--videos", tmp_path / "one", tmp_path / "two", *GIVEN)
    assert "the board was never seen by two cameras together: {one} and {two}" in said


def test_a_rig_that_has_not_converged_is_no_success(folders, tmp_path, capsys, monkeypatch):
    def unfinished(*arguments):
        found = calibrate_rig(*arguments)
        return replace(found, adjustment=replace(found.adjustment, converged=False))

    monkeypatch.setattr("tracker_node.calibration.board.rig.calibrate_rig", unfinished)
    output = tmp_path / "rig.yaml"
    assert calibrate("rig", "--videos", folders / "left", folders / "right", *GIVEN, "-o", output) == 1
    said = capsys.readouterr().err
    assert "warning: not converged" in said and f"do not use {output} unseen" in said and "--clocks sound" in said


def test_a_truncated_video_is_used_as_far_as_it_goes_and_said(folders, tmp_path, capsys):
    whole = tmp_path / "left.avi"
    writer = cv2.VideoWriter(str(whole), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (640, 400))
    for i in range(12):
        writer.write(cv2.imread(str(folders / "left" / f"{i:02d}.png")))
    writer.release()
    content = whole.read_bytes()
    whole.write_bytes(content[: int(0.75 * len(content))])
    assert calibrate("intrinsics", "--videos", whole, *GIVEN, "-o", tmp_path / "lenses.yaml") == 0
    assert "left: note:" in capsys.readouterr().out


