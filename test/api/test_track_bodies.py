"""Several bodies of one recording.yaml: each has a run of its own, and knows of the others."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

import tracker_node
from helpers.cameras.two_people import MODELS, mean_error_m, write_recording
from tracker_node.cli.main import main
from tracker_node.cli.track import _report
from tracker_node.model.configuration import State
from tracker_node.runs.joint_states import JointStateFile

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


def with_configs(recording, folder, first, second):
    """The same with a file of parameters for each body."""
    text = recording.read_text()
    for name, said in (("one", first), ("other", second)):
        (recording.parent / f"{name}_config.yaml").write_text(f"{said}\n")
        text = text.replace(f"model: {name}.yaml,", f"model: {name}.yaml, config: {name}_config.yaml,")
    path = recording.parent / f"{folder}.yaml"
    path.write_text(text)
    return path


def test_the_command_line_goes_before_what_a_body_says(recording, tmp_path):
    path = with_configs(recording, "own", "threads: 1", "threads: 1")
    given = tmp_path / "given.yaml"
    given.write_text("threads: 2\n")
    for options, threads in ([], 1), (["--config", str(given)], 2):
        output = tmp_path / str(threads)
        assert main(["track", str(path), "--output", str(output), "--max-sets", "1", "--quiet", *options]) == 0
        parameters = [json.loads((output / name / "run.json").read_text())["parameters"] for name in MODELS]
        assert [each.get("threads") for each in parameters] == [threads, threads]


def test_bodies_form_image_sets_alike_and_have_no_joint_states(recording, tmp_path, capsys):
    path = with_configs(recording, "unlike", "synchronizer: {queue_s: 0.5}", "synchronizer: {queue_s: 0.6}")
    assert main(["track", str(path), "--output", str(tmp_path / "out"), "--quiet"]) == 2
    assert "the same synchronizer.* for all, got others for other than for one" in capsys.readouterr().err
    people = tracker_node.open_bodies(recording)
    robots = {name: replace(each, joint_states=JointStateFile(path)) for name, each in people.items()}
    with pytest.raises(tracker_node.TrackerError, match="no joint states beside several bodies, got some for one"):
        tracker_node.track_bodies(robots, tmp_path / "out")


def test_one_recording_is_not_several(recording):
    with pytest.raises(tracker_node.TrackerError, match="one body, got several: one, other"):
        tracker_node.open_recording(recording)
    assert set(tracker_node.open_bodies(recording)) == set(MODELS)


def test_a_camera_is_told_with_the_body_that_says_so(tmp_path, capsys):
    def summary(degrees: float) -> dict:
        turned = {"said": f"cam2 is turned by {degrees} degrees", "kind": "turned", "sets": 3}
        bumped = {"said": "cam1 was bumped", "kind": "bumped", "sets": 2}
        return {"errors": [], "notes": [], "contradicted_cameras": [turned, bumped]}

    told: list[str] = []
    for body, degrees in (("man", 0.5), ("woman", 0.7)):
        _report(summary(degrees), tmp_path, True, told, body)
    hint = " (tracker_node rig check RIG)"
    assert capsys.readouterr().err.splitlines() == [
        f"track: man: cam2 is turned by 0.5 degrees, in 3 image sets{hint}",
        "track: cam1 was bumped, in 2 image sets",
        f"track: woman: cam2 is turned by 0.7 degrees, in 3 image sets{hint}",
    ]
