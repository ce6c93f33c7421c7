"""``import``: projects in the layouts of five programs become rigs that see what these programs' cameras see."""

import pickle
import shlex
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from helpers.cameras.small_clip import body
from helpers.sources import projects
from tracker_node.calibration.body import model_stature
from tracker_node.cli.main import main
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.projects import recordings_by_camera
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.opencap_pickle import FILE_NAME
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.loaders.trials_yaml import load_trials
from tracker_node.runs.config_file import load_config

POINTS = np.random.default_rng(2).uniform([-0.5, -0.5, 0.2], [0.5, 0.5, 1.8], (40, 3))  # of our world, before all cameras


def imported(folder, output, *arguments) -> Path:
    assert main(["import", str(folder), "-o", str(output), *arguments]) == 0
    return output


def check_seen(rig, tables: list[dict], world: np.ndarray, unit: float) -> None:
    """Each camera of the rig sees points where OpenCV projects them with the numbers of the source."""
    assert len(rig) == len(tables)
    for camera, table in zip(rig, tables, strict=True):
        rotation = np.array(table["rotation"])
        rotation = cv2.Rodrigues(rotation)[0] if rotation.size == 9 else rotation
        theirs = unit * POINTS @ world  # the inverse of ours = world @ theirs
        numbers = [np.array(table[key], dtype=float) for key in ("translation", "matrix", "distortions")]
        expected = cv2.projectPoints(theirs, rotation, *numbers)[0][:, 0]
        turned = POINTS @ turn_about_z(rig, world).T
        pixels, valid = camera.project(turned)
        assert valid.all() and np.abs(pixels - expected).max() < 1e-9


def turn_about_z(rig, world) -> np.ndarray:
    """What z-up worlds may differ in: which way x shows. Told by the first camera, it has to hold for all."""
    ours = projects.rig().cameras[0].T_world_cam[:3, :3]
    turn = rig.cameras[0].T_world_cam[:3, :3] @ ours.T
    np.testing.assert_allclose(turn[2], [0.0, 0.0, 1.0], atol=1e-9)
    return turn


def tables_of(path: Path) -> list[dict]:
    tables = tomllib.loads(path.read_text())
    return [table for table in tables.get("cameras", tables).values() if isinstance(table, dict) and "matrix" in table]


def test_pose2sim(tmp_path, capsys):
    folder = projects.pose2sim(tmp_path / "demo")
    output = imported(folder, tmp_path / "mine")
    rig = load_rig(output / "rig.yaml")
    check_seen(rig, tables_of(folder / "calibration/Calib_scene.toml"), projects.UPRIGHT, 1.0)
    assert rig.names == ("int_cam01_img", "int_cam02_img", "int_cam03_img")  # paired by their numbers
    assert [Path(camera.source).relative_to(folder).as_posix() for camera in rig] == [f"videos/cam0{i}.mp4" for i in (1, 2, 3)]
    assert model_stature(load_model(output / "person.yaml")) == pytest.approx(1.68, abs=1e-3)
    recording = load_recording(output / "recording.yaml")
    assert (Path(recording.rig), Path(recording.output)) == (output / "rig.yaml", output / "run")
    config = load_config(recording.config)
    assert config.modalities == ("region", "keypoints") and config.synchronizer.image_period_s == pytest.approx(0.04)
    assert "turned" not in capsys.readouterr().out


def test_pose2sim_sessions_of_several_trials_and_old_ones(tmp_path):
    folder = projects.pose2sim(tmp_path / "session", trial="P00/T01_walk")
    projects.films(folder / "P00/T02_run/videos", ["cam01.mp4", "cam02.mp4", "cam03.mp4"])
    output = imported(folder, tmp_path / "mine")
    trials = load_trials(output / "trials.yaml")
    assert [trial.name for trial in trials.trials] == ["P00_T01_walk", "P00_T02_run"]
    assert all(trial.problem == "" and Path(trial.recording.model).samefile(output / "person.yaml") for trial in trials.trials)
    assert Path(load_rig(output / "P00_T02_run/rig.yaml").cameras[1].source) == folder / "P00/T02_run/videos/cam02.mp4"
    alone = imported(folder / "P00/T02_run", tmp_path / "alone")  # the calibration lies two folders above
    assert load_rig(alone / "rig.yaml").names == load_rig(output / "P00_T01_walk/rig.yaml").names
    old = projects.pose2sim(tmp_path / "old", old=True)
    output = imported(old, tmp_path / "of_old")
    check_seen(load_rig(output / "rig.yaml"), tables_of(old / "calib-2d/Calib_qca.toml"), projects.UPRIGHT, 1.0)
    assert model_stature(load_model(output / "person.yaml")) == pytest.approx(1.68, abs=1e-3)


def test_anipose(tmp_path, capsys):
    folder = projects.anipose(tmp_path / "experiment")
    output = imported(folder, tmp_path / "mine", "--stature", "1.8")
    names = list(yaml.safe_load((output / "trials.yaml").read_text())["trials"])
    assert names == ["day1_session1_walk1", "day1_session1_walk2", "day1_session2_run"]
    said = capsys.readouterr().out
    assert "its axis -y, which is up for the cameras, is z now" in said and "of 1.80 m" in said
    for name, film in zip(
        names, ("session1/videos-raw/walk1", "session1/videos-raw/walk2", "session2/videos-raw/run"), strict=True
    ):
        rig = load_rig(output / name / "rig.yaml")
        check_seen(rig, tables_of(folder / "calibration/calibration.toml"), projects.Y_DOWN, 1000.0)
        assert [camera.source for camera in rig] == [str(folder / f"day1/{film}-cam{letter}.mp4") for letter in "ABC"]
    other = imported(folder, tmp_path / "meters", "--trial", "day1_session2_run", "--unit", "m")
    assert load_rig(other / "rig.yaml").cameras[0].center == pytest.approx(1000.0 * rig.cameras[0].center)


def test_an_animal_is_no_person(tmp_path, capsys):
    mouse = tmp_path / "mouse.yaml"
    dump_model(body(), mouse)
    output = imported(projects.anipose(tmp_path / "experiment"), tmp_path / "mine", "--model", str(mouse))
    assert not (output / "person.yaml").exists() and "keypoints: in recording.yaml" in capsys.readouterr().out.replace("`", "")
    recording = load_recording(output / "day1_session2_run" / "recording.yaml")
    assert Path(recording.model).resolve() == mouse
    assert load_config(recording.config).modalities == ("region",)


@pytest.mark.parametrize("generation", [0, 1, 2])
def test_freemocap(tmp_path, generation):
    folder = projects.freemocap(tmp_path / "session_1", generation)
    output = imported(folder, tmp_path / "mine")
    rig = load_rig(output / "rig.yaml")
    check_seen(rig, tables_of(folder / "session_1_camera_calibration.toml"), projects.Y_DOWN, 1000.0)
    assert [Path(camera.source).stem[-1] for camera in rig] == ["1", "2", "3"]
    assert model_stature(load_model(output / "person.yaml")) == pytest.approx(1.75, abs=1e-3)


@pytest.mark.parametrize("generation", [0, 1, 2])
def test_caliscope(tmp_path, generation):
    folder = projects.caliscope(tmp_path / "workspace", generation)
    output = imported(folder, tmp_path / "mine", "--trial", "walking")
    file = {0: "config.toml", 1: "camera_array.toml", 2: "calibration/extrinsic/capture_volume/camera_array.toml"}[generation]
    rig = load_rig(output / "rig.yaml")
    assert rig.names == ("cam_0", "cam_1", "cam_2")
    check_seen(rig, tables_of(folder / file), projects.UPRIGHT, 1.0)
    stamped = rig.cameras[0].stamp_file
    assert stamped is None if generation < 2 else Path(stamped) == folder / "recordings/walking/timestamps.csv"
    if generation:
        both = imported(folder, tmp_path / "both")
        assert [trial.name for trial in load_trials(both / "trials.yaml").trials] == ["sitting", "walking"]


@pytest.mark.parametrize("given", ["walk 1", "walk_1"])
def test_a_trial_is_chosen_by_its_folder_or_as_it_is_written(tmp_path, capsys, given):
    """Folders with blanks were chosen by another name than theirs, and printed commands could not be pasted."""
    folder = projects.caliscope(tmp_path / "workspace")
    (folder / "recordings/walking").rename(folder / "recordings/walk 1")
    output = imported(folder, tmp_path / "my walk", "--trial", given)
    assert "walk 1" in load_rig(output / "rig.yaml").cameras[0].source
    commands = [shlex.split(line) for line in capsys.readouterr().out.splitlines() if line.startswith("  tracker_node")]
    body, recording = str(output / "person.yaml"), str(output / "recording.yaml")
    assert [command[-2:] for command in commands] == [[body, "--force"], ["track", recording]]


@pytest.mark.parametrize(
    "board", [projects.WALL, projects.WALL_UPSIDE_DOWN, projects.GROUND], ids=["wall", "upside_down", "ground"]
)
@pytest.mark.parametrize("lab", [False, True])
def test_opencap(tmp_path, board, lab):
    folder = projects.opencap(tmp_path / "session", board, lab)
    output = imported(folder, tmp_path / "mine")
    assert [trial.name for trial in load_trials(output / "trials.yaml").trials] == ["neutral", "squats"]  # without the board's
    rig = load_rig(output / "squats/rig.yaml")
    tables = []
    for file in sorted(folder.rglob("*.pickle")):
        values = pickle.loads(file.read_bytes())
        tables.append({**values, "matrix": values["intrinsicMat"], "distortions": values["distortion"]})
    check_seen(rig, tables, board, 1000.0)
    ending = "squats_syncdWithMocap.avi" if lab else "squats_sync.mp4"  # which begin together
    assert [Path(camera.source).name for camera in rig] == [ending] * 3
    assert model_stature(load_model(output / "person.yaml")) == pytest.approx(1.62, abs=1e-3)


def test_videos_that_were_made_smaller_and_cropped_ones(tmp_path, capsys):
    folder = projects.pose2sim(tmp_path / "demo")
    projects.film(folder / "videos/cam02.mp4", (320, 240))
    projects.film(folder / "videos/cam03.mp4", (480, 480))
    assert main(["import", str(folder), "-o", str(tmp_path / "refused")]) == 2
    said = capsys.readouterr().err
    assert "camera 'int_cam03_img'" in said and "expected 640x480, got 480x480" in said
    assert "(cut), or" in said and "(stretched); say which with --pixel-map int_cam03_img=cut" in said
    rig = load_rig(imported(folder, tmp_path / "mine", "--pixel-map", "int_cam03_img=cut") / "rig.yaml")
    points = POINTS @ turn_about_z(rig, projects.UPRIGHT).T
    whole, cut = projects.rig().cameras[2].project(POINTS)[0], rig.cameras[2].project(points)[0]
    np.testing.assert_allclose(cut, whole - [80.0, 0.0], atol=1e-9)
    full, half = projects.rig().cameras[1].project(POINTS)[0], rig.cameras[1].project(points)[0]
    np.testing.assert_allclose(half, 0.5 * full - 0.25, atol=1e-9)
    said = capsys.readouterr().out
    assert "int_cam02_img: its calibration, of 640x480, is for images of 320x240 now: resampled" in said


def test_names_that_settle_nothing_are_paired_in_order(tmp_path, capsys):
    folder = projects.pose2sim(tmp_path / "demo")
    for name, other in (("cam01", "left"), ("cam02", "middle"), ("cam03", "right")):
        (folder / f"videos/{name}.mp4").rename(folder / f"videos/{other}.mp4")
    rig = load_rig(imported(folder, tmp_path / "mine") / "rig.yaml")
    assert [Path(camera.source).stem for camera in rig] == ["left", "middle", "right"]
    assert "are paired in their order: int_cam01_img: left.mp4" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["cam01", "rec2_cam1", "walk"])
def test_the_only_video_is_that_of_the_only_camera(tmp_path, name):
    projects.film(tmp_path / f"{name}.mp4")
    assert recordings_by_camera(tmp_path, ["cam01"], print) == {"cam01": tmp_path / f"{name}.mp4"}


def test_a_camera_without_a_video_is_left_out(tmp_path, capsys):
    folder = projects.pose2sim(tmp_path / "demo")
    (folder / "videos/cam02.mp4").unlink()
    assert load_rig(imported(folder, tmp_path / "mine") / "rig.yaml").names == ("int_cam01_img", "int_cam03_img")
    assert "camera int_cam02_img has no video" in capsys.readouterr().out


def remove(pattern):
    return lambda folder: [path.unlink() for path in folder.glob(pattern)]


def write(name, content):
    return lambda folder: (folder / name).write_bytes(content)


@pytest.mark.parametrize(
    ("make", "change", "arguments", "said"),
    [
        (projects.pose2sim, lambda folder: None, ["--trial", "run"], "unknown trial 'run'; valid: trial"),
        (projects.pose2sim, lambda folder: None, ["--stature", "178"], "'--stature': expected 0.4 to 3 meters"),
        (projects.pose2sim, lambda folder: None, ["--stature", "1.7", "--model", "x.yaml"], "'--stature': expected no --model"),
        (projects.pose2sim, lambda folder: None, ["--model", "none.yaml"], "none.yaml"),
        (projects.pose2sim, remove("calibration/*"), [], "one for these videos; --calibration says which, got 'none'"),
        (projects.pose2sim, write("calibration/Calib_b.toml", b""), [], "Calib_b.toml"),
        (projects.pose2sim, remove("videos/*"), [], "calibration/, or videos/ and Config.toml; or videos/ with"),
        (projects.pose2sim, remove("videos/*"), ["--calibration", "{folder}/Config.toml"], "Config.toml; or videos/)"),
        (projects.pose2sim, remove("videos/*1.mp4"), ["--calibration", "{folder}/Config.toml"], "expected one table per camera"),
        (projects.pose2sim, write("videos/cam01.mp4", b"no video"), [], "cannot be opened as a video"),
        (projects.pose2sim, write("Config.toml", b"[project"), [], "Config.toml: field '(file)': expected a TOML file"),
        (projects.anipose, write("config.toml", b"triangulation.cam_regex = '('"), [], "expected a regular expression"),
        (projects.freemocap, remove("*.toml"), [], "expected one for these videos"),
        (projects.opencap, write(f"Videos/Cam1/{FILE_NAME}", b"\x80\x04"), [], f"Cam1/{FILE_NAME}"),
        (projects.opencap, remove("*.yaml"), ["--unit", "mm"], "'--unit': expected none with opencap files"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(tmp_path, capsys, make, change, arguments, said):
    folder = make(tmp_path / "all" / "session" / "project")  # calibrations are looked for around it: not in other tests' folders
    change(folder)
    arguments = [argument.format(folder=folder) for argument in arguments]
    assert main(["import", str(folder), "-o", str(tmp_path / "mine"), *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error


def test_videos_alone_are_enough_beside_a_calibration(tmp_path, capsys):
    folder = projects.pose2sim(tmp_path / "all" / "session" / "project")
    (folder / "Config.toml").unlink()
    calibration = next((folder / "calibration").glob("*.toml")).rename(tmp_path / "own.toml")
    (folder / "calibration").rmdir()
    assert main(["import", str(folder), "-o", str(tmp_path / "refused")]) == 2
    assert "or videos/ with --calibration" in capsys.readouterr().err
    rig = load_rig(imported(folder, tmp_path / "mine", "--calibration", str(calibration)) / "rig.yaml")
    assert [Path(camera.source).name for camera in rig] == ["cam01.mp4", "cam02.mp4", "cam03.mp4"]
    assert "1 trial of videos" in capsys.readouterr().out


def test_folders_that_are_none_and_output_that_is_there(tmp_path, capsys):
    assert main(["import", str(tmp_path / "nowhere"), "-o", str(tmp_path / "mine")]) == 2
    assert "expected the folder of a project, got 'no such folder'" in capsys.readouterr().err
    (tmp_path / "photos").mkdir()
    assert main(["import", str(tmp_path), "-o", str(tmp_path / "mine")]) == 2
    assert "got 'photos'" in capsys.readouterr().err
    folder = projects.freemocap(tmp_path / "session")
    imported(folder, tmp_path / "mine")
    assert main(["import", str(folder), "-o", str(tmp_path / "mine")]) == 2
    assert "is there already" in capsys.readouterr().err
    imported(folder, tmp_path / "mine", "--force")
