"""What folders lack or have too much of, and what steps are refused: in words, and without a process started."""

import json
import shutil
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.studio.studio_process import running_studio
from helpers.studio.wizard_client import Client
from tracker_node.cli.main import main
from tracker_node.errors import TrackerError
from tracker_node.studio.wizard import page
from tracker_node.studio.wizard.folder import contents_of
from tracker_node.studio.wizard.page import Jobs, files_of
from tracker_node.studio.wizard.steps import Steps


@pytest.fixture
def folder(recorded, tmp_path) -> Path:
    shutil.copytree(recorded, tmp_path / "walk")
    return tmp_path / "walk"


def film(path: Path, size: tuple[int, int]) -> None:
    path.parent.mkdir(exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, size)
    for _ in range(4):
        writer.write(np.full((size[1], size[0], 3), 120, np.uint8))
    writer.release()


def test_an_empty_folder_says_what_to_put_there(tmp_path):
    steps = {step.name: step for step in Steps(tmp_path).all()}
    assert steps["rig"].state == "not yet" and "no videos in this folder" in steps["rig"].said
    assert [step.state for step in steps.values()] == 7 * ["not yet"]
    for name in steps:
        with pytest.raises(TrackerError):
            Steps(tmp_path).commands(name, "any", {})


def test_a_folder_that_is_none_is_refused(tmp_path, capsys):
    assert main(["studio", "--no-browser", "--new", str(tmp_path / "none")]) == 2
    assert "--new" in capsys.readouterr().err
    assert main(["studio", "--no-browser", "--new", str(tmp_path), "--rig", "rig.yaml"]) == 2
    assert "none beside --new" in capsys.readouterr().err


def test_of_two_calibrations_one_must_be_chosen(folder):
    shutil.copyfile(folder / "Calib.toml", folder / "old.toml")
    steps = Steps(folder)
    assert "2 calibrations here: choose" in steps.all()[0].said
    with pytest.raises(TrackerError, match=r"calibration: choose one of Calib.toml, old.toml"):
        steps.commands("rig", "import", {})
    for wrong in ("/etc/passwd", "../walk/Calib.toml", "--help"):
        with pytest.raises(TrackerError, match=r"Calib\.toml"):
            steps.commands("rig", "import", {"calibration": wrong})
    found = steps.commands("rig", "import", {"calibration": "old.toml", "backgrounds": "none"})
    assert found == [["rig", "import", "old.toml", "--sources", "videos", "-o", "rig.yaml"]]


def test_a_run_that_ended_early_is_said_to(folder):
    (folder / "recording.yaml").write_text("rig: rig.yaml\n")
    (folder / "run").mkdir()
    ended = "ended by Ctrl-C before the last image set"
    (folder / "run/run.json").write_text(json.dumps({"image_sets": 27, "status_counts": {"TRACKING": 27}, "errors": [ended]}))
    (run,) = (step for step in Steps(folder).all() if step.name == "run")
    assert run.found == ("27 image sets: 27 TRACKING", ended)


def test_what_is_typed_is_no_option_of_a_command(folder):
    film(folder / "board/cam01.mp4", (64, 48))
    steps = Steps(folder)
    board = {"size": "7x5", "square": "0.1", "backgrounds": "none"}
    (found,) = steps.commands("rig", "board", board)
    assert found[:4] == ["calibrate", "rig", "--videos", "board/cam01.mp4"]
    assert found[-4:] == ["--sources", "videos", "-o", "rig.yaml"]
    for name, wrong, said in (
        ("size", "--output=x", "size"), ("size", "", "columns x rows .*: still to be filled in"),
        ("square", "1; ls", "edge of a square, m: expected a number, got '1; ls'"), ("square", " ", "still to be filled in"),
        ("clocks", "never", "never"), ("other", "x", "other"),
    ):  # fmt: skip
        with pytest.raises(TrackerError, match=said):
            steps.commands("rig", "board", {**board, name: wrong})
    for step, way, said in (("nap", "any", "body, look"), ("rig", "guess", "board, import"), ("run", "track", "recording.yaml")):
        with pytest.raises(TrackerError, match=said):
            steps.commands(step, way, {})


def test_numbers_and_sizes_as_people_write_them(folder):
    """A command line would take -1e-3 for an option, and no size with blanks."""
    files = str(folder / "Calib.toml"), "--sources", str(folder / "videos"), "-o", str(folder / "rig.yaml")
    assert main(["rig", "import", *files]) == 0
    (folder / "world").mkdir()
    cv2.imwrite(str(folder / "world/cam01.png"), np.zeros((4, 4), np.uint8))
    (clap,) = Steps(folder).commands("time", "sound", {"at": "-1e-3, 0.20  1", "max_offset": "0.5e1"})
    assert clap == ["synchronize", "--rig", "rig.yaml", "--by", "sound", "--at", "-0.001", "0.2", "1", "--max-offset", "5",
                    "-o", "rig_timed.yaml"]  # fmt: skip
    for wrong in ("1 2", "1 2 3 4", "1 2 x", "1 2 nan", "1 2 inf"):
        with pytest.raises(TrackerError, match="where the clap was: expected "):
            Steps(folder).commands("time", "sound", {"at": wrong})
    with pytest.raises(TrackerError, match="unknown field 'max_offset'"):  # timecode tells any
        Steps(folder).commands("time", "timecode", {"max_offset": "2"})
    for size in ("9x6", " 9 x 6", "9\N{MULTIPLICATION SIGN}6"):
        (lying,) = Steps(folder).commands("world", "board", {"pattern": "chessboard", "size": size, "square": "3e-2"})
        assert lying[5:9] == ["--chessboard", "9x6", "--square", "0.03"] and "--scale" not in lying


def test_tables_of_points_are_found_as_spreadsheets_write_them(folder):
    tables = {
        "clicked.csv": "camera,point,x,y,z,u,v\n", "marked.csv": "\ufeffcamera,point,x,y,z,u,v,note\n",
        "other.csv": "Camera;Point;X;Y;Z;U;V\n", "object.csv": "\ufeffpoint,x,y,z\n", "joints.csv": "stamp_ns,point,x,y,z\n",
    }  # fmt: skip
    (folder / "clicks").mkdir()
    for name, text in {**tables, "clicks/control_points.csv": tables["clicked.csv"]}.items():
        (folder / name).write_text(text, encoding="utf-8")
    found = contents_of(folder)
    assert found.control_points == ("clicked.csv", "marked.csv", "other.csv", "clicks/control_points.csv")
    assert found.places == ("object.csv",) and files_of(folder)["control_points"] == folder / "object.csv"


def test_links_that_lead_out_of_the_folder_are_not_followed(folder, tmp_path):
    (tmp_path / "secret").mkdir()
    shutil.move(folder / "Calib.toml", tmp_path / "secret/Calib.toml")
    (folder / "Calib.toml").symlink_to(tmp_path / "secret/Calib.toml")
    shutil.move(folder / "videos/cam01.mp4", tmp_path / "secret/cam01.mp4")
    (folder / "videos/cam01.mp4").symlink_to(tmp_path / "secret/cam01.mp4")
    (folder / "more").symlink_to(tmp_path / "secret")
    found = contents_of(folder)
    assert found.calibrations == () and found.recordings == {"videos": ("videos/cam02.mp4", "videos/cam03.mp4")}


def test_a_step_is_old_when_what_it_was_made_from_is_newer(folder):
    files = str(folder / "Calib.toml"), "--sources", str(folder / "videos"), "-o", str(folder / "rig.yaml")
    assert main(["rig", "import", *files]) == 0
    shutil.copyfile(folder / "rig.yaml", folder / "rig_timed.yaml")
    assert Steps(folder).current_rig() == "rig_timed.yaml"
    (folder / "rig.yaml").write_text((folder / "rig.yaml").read_text())
    time = Steps(folder).all()[1]
    assert time.state == "to do" and time.said == "rig_timed.yaml is older than rig.yaml: do it again"
    assert Steps(folder).current_rig() == "rig.yaml"  # later steps would go by it, without the clocks that were found


def test_a_damaged_world_leaves_the_page_and_can_be_made_again(folder):
    files = str(folder / "Calib.toml"), "--sources", str(folder / "videos"), "-o", str(folder / "rig.yaml")
    assert main(["rig", "import", *files]) == 0
    (folder / "rig_world.yaml").write_text("cameras: {}\n")
    world = Steps(folder).all()[2]
    assert world.state == "to do" and "rig_world.yaml: field 'cameras'" in world.said
    (again,) = Steps(folder).commands("world", "up", {"up": "z"})
    assert again == ["rig", "world", "rig.yaml", "--up=z", "-o", "rig_world.yaml", "--force"]


def test_a_camera_that_a_calibration_leaves_out_is_named(folder):
    files = str(folder / "Calib.toml"), "--sources", str(folder / "videos"), "-o", str(folder / "rig.yaml")
    assert main(["rig", "import", *files]) == 0
    assert Steps(folder).all()[0].said == "rig.yaml: 3 cameras"
    film(folder / "videos/cam04.mp4", (200, 200))
    assert Steps(folder).all()[0].said == "rig.yaml: 3 cameras; videos/cam04.mp4 is of none of them"


def test_runs_are_numbered_and_the_newest_is_looked_at(folder):
    """One that was canceled before it had anything keeps its number, and is no run."""
    (folder / "recording.yaml").write_text("rig: rig.yaml\n")
    again = {"max_sets": "", "shrink": "1"}
    for name, newest in (("run", "run"), ("run_2", "run"), ("run_3", "run_3")):
        output = [] if name == "run" else ["--output", name]
        assert Steps(folder).commands("run", "track", again) == [["track", "recording.yaml", *output]]
        (folder / name / "bag").mkdir(parents=True)
        (folder / name / "cam01").mkdir()
        shutil.copyfile(folder / "videos/cam01.mp4", folder / name / "cam01/seen.mp4")
        if name != "run_2":
            (folder / name / "run.json").write_text("{}")
        assert Steps(folder).current_run() == newest
    assert Steps(folder).commands("look", "evaluate", {}) == [["evaluate", "run_3"]]
    assert set(contents_of(folder).recordings) == {"videos"}


def test_notes_stand_apart_and_what_was_written_is_no_error(tmp_path, monkeypatch):
    """A program that ends with 1, having left out a camera: its sentence is the error, not its last line."""
    (tmp_path / "rig.py").write_text(
        "import sys\nprint('cam01: note: blurred')\nprint('note: not converged')\n"
        "print('tracker_node calibrate rig: cam04: no board; this camera is left out', file=sys.stderr, flush=True)\n"
        "print('wrote rig.yaml')\nsys.exit(1)\n"
    )
    monkeypatch.setattr(page, "COMMAND", ())
    job = Jobs(tmp_path)
    job.start("rig", [["rig.py"]], ["rig.py"])
    while job.running:
        time.sleep(0.05)
    facts = job.facts()
    assert facts["error"] == "cam04: no board; this camera is left out"
    assert facts["notes"] == ["cam01: blurred", "not converged"] and "wrote rig.yaml" in facts["lines"]


def test_videos_of_unlike_sizes_and_steps_before_their_time_over_http(folder):
    """The program's own sentence comes to the page; a choice of the candidates goes on; doubtful backgrounds are a note."""
    film(folder / "videos/cam02.mp4", (200, 160))
    with running_studio("--new", folder) as studio:
        client = Client(studio.url)
        early = client.json("/api/wizard/start", {"step": "look", "way": "evaluate", "values": {}}, status=400)
        assert early["error"] == "look: needs a run"
        for page, step in (("digitizing", "Rig"), ("pose/body", "Body")):
            assert f"the step {step} of the page New" in client.json(f"/api/{page}", status=400)["error"]
        job = client.do("rig", "import")
        assert "expected 200x200, got 200x160" in job["error"] and "--pixel-map cam02=cut" in job["error"]
        assert client.step("rig")["state"] == "to do" and not (folder / "rig.yaml").exists()
        for text in ("cam02=cut --force", "cam02", "cam02=cut; rm"):
            asked = {"step": "rig", "way": "import", "values": {"pixel_map": text}}
            assert "expected camera=what" in client.json("/api/wizard/start", asked, status=400)["error"]
        job = client.do("rig", "import", pixel_map="cam02=cut")
        assert not job["error"] and "no background is to be relied on" in job["notes"][-1]
        assert client.step("rig")["found"][1].startswith("cam02: cam02.mp4, 200x160")
        film(folder / "videos/cam03.mp4", (100, 200))  # filmed anew: the rig no longer fits
        rig = client.step("rig")
        assert rig["state"] == "to do" and "expected 200x200, got 100x200" in rig["said"]
        for values in ({}, {"step": 1, "way": "x"}, {"step": "rig", "way": "import", "values": {"calibration": 3}}):
            assert "request" in client.json("/api/wizard/start", values, status=400)["error"]


def test_without_a_folder_the_page_says_how(tmp_path):
    with running_studio() as studio:
        assert "--new FOLDER" in Client(studio.url).json("/api/wizard/steps", status=400)["error"]
