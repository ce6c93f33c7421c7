"""Several bodies of one recording.yaml: each has a run of its own, and knows of the others."""

import json
from pathlib import Path

import pytest

import tracker_node
from helpers.cameras.two_people import MODELS, mean_error_m, write_recording
from tracker_node.cli.main import main
from tracker_node.model.configuration import State

N = 4


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    return write_recording(tmp_path_factory.mktemp("two"), N)


@pytest.fixture(scope="module")
def output(recording) -> Path:
    folder = recording.parent / "run"
    assert main(["track", str(recording), "--output", str(folder), "--quiet"]) == 0
    return folder


def test_each_body_has_a_run_in_a_folder_of_its_name(output):
    for name, model in MODELS.items():
        info = json.loads((output / name / "run.json").read_text())
        assert info["bodies"] == list(MODELS) and info["image_sets"] == N
        run = tracker_node.load_run(output / name)
        assert run.model.name == model.name and len(run) == N
        states = [State.from_values(values) for values in run.motion.values]
        assert max(mean_error_m(name, state, i) for i, state in enumerate(states)) < 0.02
        assert (output / name / "bag").is_dir() and (output / name / "joints.csv").exists()


def test_python_tracks_them_as_the_command_does(recording, output):
    runs = tracker_node.track_bodies(recording, recording.parent / "python")
    for name in MODELS:
        assert (recording.parent / "python" / name / "states.csv").read_text() == (output / name / "states.csv").read_text()
        assert len(runs[name]) == N


def test_what_is_of_one_body_is_refused_beside_several(recording, tmp_path, capsys):
    model = str(recording.parent / "one.yaml")
    for options, said in [
        (["--model", model], "--model: expected nothing beside several bodies (one, other)"),
        (["--person", "0", "0", "1"], "--person: expected nothing beside several bodies"),
        (["--from-run-bag", "bag"], "--from-run-bag: expected a run of one body, got a recording of several"),
    ]:
        assert main(["track", str(recording), "--output", str(tmp_path / "out"), *options]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_one_recording_is_not_several(recording):
    with pytest.raises(tracker_node.TrackerError, match="one body, got several: one, other"):
        tracker_node.open_recording(recording)
    assert set(tracker_node.open_bodies(recording)) == set(MODELS)
