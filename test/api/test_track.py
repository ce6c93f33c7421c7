"""`track`, `open_recording` and `load_run` give what the command line gives, to the bit."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tracker_node import Recording, Tracker, TrackerError, load_model, load_rig, load_run, load_state, open_recording, track
from tracker_node.errors import FileFormatError
from tracker_node.runs.image_sets import resampled_rig


def test_states_and_covariances_are_those_of_the_command_line(folder, tmp_path):
    by_command = load_run(folder / "by_command")
    recording = open_recording(folder / "recording.yaml")
    assert recording.output == folder / "described"
    for run in (track(recording), track(folder / "recording.yaml", tmp_path / "run")):
        assert np.array_equal(run.stamps_ns, by_command.stamps_ns) and len(run) == 6
        assert np.array_equal(run.data.values, by_command.data.values) and run.status == by_command.status
        assert np.array_equal(run.data.details.covariances, by_command.data.details.covariances)
        assert np.array_equal(run.data.residual, by_command.data.residual)
    for file in ("states.csv", "joints.csv", "poses.csv"):
        assert (tmp_path / "run" / file).read_bytes() == (folder / "by_command" / file).read_bytes()


def test_parts_are_as_good_as_a_file(folder):
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "model.yaml")
    run = track(Recording(rig, model, initial_state=load_state(folder / "start.yaml", model)))
    assert np.array_equal(run.data.values, load_run(folder / "run").data.values)
    assert run.path is None and run.data.bag is None and run.info["options"]["cameras"] == list(rig.names)


def test_parts_of_another_kind_are_refused_with_how_to_make_them(folder):
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "model.yaml")
    with pytest.raises(TypeError, match=r"rig: expected a CameraRig \(load_rig reads one\), got 'rig.yaml'"):
        Recording("rig.yaml", model)
    for state in ("start.yaml", {"root": 1}):
        with pytest.raises(TypeError, match=r"initial_state: expected a State \(load_state\(path, model\) reads one\), got"):
            Recording(rig, model, initial_state=state)
    for person in ([1, 2], "left", [[0, 0, 1]], [0, 0, float("nan")], ["a", 0, 1], {"x": 1}):
        with pytest.raises(TypeError, match="person: expected three numbers, the place in meters in world axes, got"):
            Recording(rig, model, person=person)
    assert Recording(rig, model, person=(1, 2, 0.5)).person.tolist() == [1.0, 2.0, 0.5]


def test_image_sets_of_a_recording_are_what_the_tracker_takes(folder):
    recording = open_recording(folder / "recording.yaml")
    tracker = Tracker(
        resampled_rig(recording.rig, recording.images), recording.model, recording.config, {}, recording.initial_state
    )
    estimates = [tracker.step(image_set) for image_set in recording.image_sets()]
    assert [estimate.stamp_ns for estimate in estimates] == load_run(folder / "by_command").stamps_ns.tolist()


def test_progress_is_told_of_every_image_set(folder):
    told = []
    track(folder / "recording.yaml", progress=lambda done, expected, estimate: told.append((done, expected, estimate.stamp_ns)))
    assert [done for done, *_ in told] == [1, 2, 3, 4, 5, 6] and {expected for _, expected, _ in told} == {6}


def test_a_run_names_its_model_or_asks_for_it(folder, tmp_path):
    written = track(open_recording(folder / "recording.yaml"), tmp_path / "named")
    again = load_run(tmp_path / "named")
    assert again.model.chain.dof_names == written.model.chain.dof_names and again.path == tmp_path / "named"
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "model.yaml")
    track(Recording(rig, model, initial_state=load_state(folder / "start.yaml", model)), tmp_path / "parts")
    with pytest.raises(FileFormatError, match=r"load_run\(path, model\)"):
        load_run(tmp_path / "parts")
    assert len(load_run(tmp_path / "parts", model)) == len(load_run(tmp_path / "parts", folder / "model.yaml")) == 10


def test_what_breaks_on_the_way_is_a_warning_and_the_rest_is_tracked(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "clip")
    shutil.rmtree(tmp_path / "clip" / "cam03")
    with pytest.warns(UserWarning, match="cam03"):
        run = track(tmp_path / "clip" / "recording.yaml")
    assert len(run) == 6 and any("cam03" in sentence for sentence in run.info["errors"])


def test_nothing_to_track_is_an_error(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "clip")
    for name in ("cam01", "cam02", "cam03"):
        shutil.rmtree(tmp_path / "clip" / name)
    with pytest.raises(TrackerError, match="no camera has a source"):
        track(tmp_path / "clip" / "recording.yaml")


def test_a_run_that_is_there_is_not_overwritten(folder):
    states = (folder / "by_command" / "states.csv").read_bytes()
    with pytest.raises(TrackerError, match="by_command"):
        track(folder / "recording.yaml", folder / "by_command")
    assert (folder / "by_command" / "states.csv").read_bytes() == states


def test_sources_and_cameras_of_a_recording_replace_those_of_its_rig(folder):
    text = (folder / "recording.yaml").read_text()
    path = folder / "fewer.yaml"
    path.write_text(text + "cameras: [cam01, cam03]\nsources: './{name}'\n")
    recording = open_recording(path)
    assert recording.rig.names == ("cam01", "cam03")
    assert [Path(camera.source) for camera in recording.rig] == [folder / "cam01", folder / "cam03"]


def test_where_points_come_from_and_whose_they_are_is_read_from_a_file(folder, tmp_path):
    text = (folder / "recording.yaml").read_text()
    for name in ("own.tflite", "table.yaml"):
        (tmp_path / name).write_text("")
    for part in ("rig.yaml", "model.yaml", "start.yaml"):
        shutil.copy(folder / part, tmp_path)
    file = tmp_path / "other.yaml"
    file.write_text(f"{text}\nkeypoints: {{weights: own.tflite, every_sets: 2}}\nperson: [1, 2, 0.5]\n")
    recording = open_recording(file)
    assert (recording.detection.weights, recording.detection.every_sets) == (tmp_path / "own.tflite", 2)
    assert recording.points is None and recording.person.tolist() == [1.0, 2.0, 0.5]
    assert recording.named_options()["person"] == [1.0, 2.0, 0.5]
    file.write_text(f"{text}\nkeypoints: {{files: own.tflite, table: table.yaml, first: 4}}\n")
    points = open_recording(file).points
    assert (points.path, points.table, points.first) == (tmp_path / "own.tflite", tmp_path / "table.yaml", 4)
