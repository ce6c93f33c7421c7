"""People who join and leave a recording: each has a run of its own, from where it came to where it left."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import tracker_node
from helpers.bodies.detected_people import HUMAN, off_m, seen_by, standing
from helpers.cameras.camera_rigs import circle_rig
from helpers.sources.point_files import write_mediapipe_json
from tracker_node.camera.rig import CameraRig
from tracker_node.cli.main import main
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.configuration import State
from tracker_node.runs.images import first_image_of

N, RIG = 40, circle_rig(3)
HERE = {"left": range(3, 14), "right": range(8, N)}  # image sets
X = {"left": -0.9, "right": 0.9}


def write_recording(folder: Path, people=HERE, more="") -> Path:
    """Images that show nothing, and points of people."""
    for camera in RIG:
        (folder / camera.name).mkdir(parents=True)
        size = camera.model
        for i in range(N):
            cv2.imwrite(str(folder / camera.name / f"{i:03d}.png"), np.full((size.height, size.width, 3), 90, np.uint8))
    seen = {name: seen_by(RIG, standing(X[name]), np.random.default_rng(3), 0.5) for name in people}
    for k, camera in enumerate(RIG):
        images = []
        for i in range(N):
            here = [seen[name][k] for name, rows in people.items() if i in rows]
            images.append(np.array([np.column_stack([person.pixels, person.scores]) for person in here]).reshape(-1, 33, 3))
        (folder / "points").mkdir(exist_ok=True)
        write_mediapipe_json(folder / "points" / f"{camera.name}.json", images, camera.model.width, camera.model.height)
    cameras = tuple(replace(camera, source=f"{camera.name}/*.png") for camera in RIG)
    write_rig_file(rig_file_of(CameraRig(cameras)), folder / "rig.yaml")
    dump_model(HUMAN, folder / "human.yaml")
    (folder / "config.yaml").write_text("modalities: [keypoints]\n")
    path = folder / "recording.yaml"
    path.write_text(
        "rig: rig.yaml\noutput: out\nconfig: config.yaml\nimages: {rate_hz: 30}\nkeypoints: {files: points}\n"
        f"joining: {{model: human.yaml, gone_s: 0.5, name: guest}}\n{more}"
    )
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    return write_recording(tmp_path_factory.mktemp("joining"))


def test_each_who_comes_has_a_run_until_he_has_left(recording, capsys):
    assert main(["track", str(recording), "--quiet"]) == 0
    output = recording.parent / "out"
    assert sorted(path.name for path in output.iterdir()) == ["guest_1", "guest_2"]
    for name, who in (("guest_1", "left"), ("guest_2", "right")):
        run, info = tracker_node.load_run(output / name), json.loads((output / name / "run.json").read_text())
        assert info["bodies"] == ["guest_1", "guest_2"]
        first, last = HERE[who][0], HERE[who][-1]
        stamps = np.round(run.data.stamps_ns * 3e-8).astype(int)
        assert first + 3 <= stamps[0] <= first + 6  # two looks 0.1 s apart
        assert first_image_of(info) == stamps[0] and info["expected_image_sets"] == len(run)
        tracking = [i for i, status in zip(stamps, run.data.status, strict=True) if status == 1]
        assert tracking == list(range(stamps[0], last + 1))
        assert stamps[-1] <= min(last + 2 + 15, N - 1)
        places = [off_m(State.from_values(values), standing(X[who])).mean() for values in run.data.values[: len(tracking)]]
        assert max(places) < 0.05
        assert run.model.name == HUMAN.name and (output / name / "model.yaml").exists()
    assert main(["track", str(recording), "--quiet"]) == 2
    assert "guest_1" in capsys.readouterr().err and (output / "guest_2" / "states.csv").exists()


def test_who_comes_when_all_names_are_used_is_told_of(tmp_path, capsys):
    path = write_recording(tmp_path)
    path.write_text(path.read_text().replace("name: guest", "name: guest, most: 1"))
    assert main(["track", str(path), "--quiet"]) == 0
    said = "somebody has come for whom no name is left: joining.most is 1"
    assert said in capsys.readouterr().err
    assert said in json.loads((tmp_path / "out" / "guest_1" / "run.json").read_text())["notes"]


def test_python_tracks_them_as_the_command_does(recording, tmp_path, monkeypatch):
    monkeypatch.chdir(recording.parent)
    runs = tracker_node.track_bodies("recording.yaml", tmp_path / "python")
    assert all(Path(source).is_absolute() for _, source in runs["guest_2"].data.info["options"]["source"])
    assert main(["track", str(recording), "--output", str(tmp_path / "command"), "--quiet"]) == 0
    assert list(runs) == ["guest_1", "guest_2"]
    for name in runs:
        assert (tmp_path / "python" / name / "states.csv").read_text() == (tmp_path / "command" / name / "states.csv").read_text()


def test_who_is_named_is_there_beside_those_who_join(tmp_path):
    recording = write_recording(tmp_path / "more", more="bodies: {anna: {model: human.yaml}}\n")
    assert main(["track", str(recording), "--quiet"]) == 0
    output = tmp_path / "more/out"
    assert sorted(path.name for path in output.iterdir()) == ["anna", "guest_1"]
    anna = tracker_node.load_run(output / "anna")
    assert anna.data.status.tolist() == [0] * 3 + [1] * 11 + [3] * 26  # she is the first who comes, and stays herself


def test_that_nobody_has_come_is_said(tmp_path, capsys):
    recording = write_recording(tmp_path / "empty", people={})
    for camera in RIG:  # a file without anybody is no file of points
        (tmp_path / "empty/points" / f"{camera.name}.json").unlink()
    images = [np.zeros((0, 33, 3))] * (N - 1) + [np.full((1, 33, 3), 9.0)]
    for camera in RIG:
        write_mediapipe_json(tmp_path / "empty/points" / f"{camera.name}.json", images, 640, 480)
    assert main(["track", str(recording), "--quiet"]) == 1
    assert "nobody has come" in capsys.readouterr().err


def test_mistakes_are_said(recording, tmp_path, capsys):
    (recording.parent / "lines.yaml").write_text("modalities: [region]\n")
    options = ["--config", str(recording.parent / "lines.yaml"), "--output", str(tmp_path / "lines")]
    assert main(["track", str(recording), *options]) == 2
    assert "people who join are found by points: expected keypoints among the modalities, got region" in capsys.readouterr().err
    trials = recording.parent / "trials.yaml"
    trials.write_text("output: all\ntrials: {one: {recording: recording.yaml}}\n")
    assert main(["batch", str(trials)]) == 2
    assert "'trials.one.recording': expected bodies with names, and nobody who is joining" in capsys.readouterr().err
