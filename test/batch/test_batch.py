"""Many trials: each as if it were alone, whatever the others come to, and whenever the batch was ended."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from helpers.cameras.two_people import write_recording
from tracker_node.api.functions import track
from tracker_node.api.recording import recording_of
from tracker_node.batch import batch
from tracker_node.batch.batch import BatchOptions, run_batch
from tracker_node.batch.executors import Processes, WorkerDied
from tracker_node.batch.work import FAILED_STATE, TRACKED, Job, read_outcome, run_trial
from tracker_node.cli.main import main
from tracker_node.errors import TrackerError, UnknownNameError
from tracker_node.evaluation.report.kinematics import range_tables
from tracker_node.evaluation.run_review import RunFiles, review_run
from tracker_node.loaders.owned_folder import OwnedFolder
from tracker_node.loaders.trials_yaml import load_trials
from tracker_node.version import __version__

TWO = BatchOptions(workers=2)


def written(folder: Path) -> dict[str, int]:
    """When the results of each trial were written."""
    return {place.parent.name: place.stat().st_mtime_ns for place in folder.glob("*/trial.json")}


def test_trials_have_the_states_that_they_have_one_by_one(trials_file, tmp_path):
    trials = load_trials(trials_file)
    outcomes = run_batch(trials, TWO)
    assert [(o.name, o.subject, o.state, o.image_sets) for o in outcomes] == [
        ("first", "anna", TRACKED, 8), ("second", "anna", TRACKED, 6), ("third", "", TRACKED, 7),
    ]  # fmt: skip
    for trial in trials.trials:
        track(recording_of(trial.recording), tmp_path / "alone" / trial.name)
        names = ("states.csv", "joints.csv", "poses.csv")
        for mine, theirs in ((tmp_path / "out" / trial.name / n, tmp_path / "alone" / trial.name / n) for n in names):
            assert mine.read_bytes() == theirs.read_bytes()
    first = outcomes[0]
    assert first.status_counts["TRACKING"] == 8 and first.metrics["residual_px"] < 2.0
    low, high = first.ranges["elbow_flexion"]
    assert -140.0 < low < high < 6.0
    tables = range_tables(review_run(RunFiles(str(tmp_path / "out/first"), pictures=0), str))
    shown = {str(row[0]).replace(" ", "_"): row[1:3] for table in tables if "speeds" not in table.key for row in table.rows}
    assert {name: list(ends) for name, ends in first.ranges.items()} == shown
    assert not list((tmp_path / "out/.batch").glob("*/*"))


def test_a_trial_of_several_bodies(tmp_path):
    write_recording(tmp_path / "two", 3)
    far = re.sub(r"xyz: \[[^,]*", "xyz: [40.0", (tmp_path / "two/other_start.yaml").read_text())
    (tmp_path / "two/far.yaml").write_text(far)
    bodies = (
        "{one: {model: two/one.yaml, initial_state: two/one_start.yaml}, gone: {model: two/other.yaml},"
        " lost: {model: two/other.yaml, initial_state: two/far.yaml}}"
    )
    file = tmp_path / "trials.yaml"
    common = "{rig: two/rig.yaml, config: two/tracker.yaml, images: {rate_hz: 30}}"
    text = f"output: out\ncommon: {common}\ntrials:\n  pair: {{bodies: BODIES}}\n"
    file.write_text(text.replace("BODIES", bodies))
    (outcome,) = run_batch(load_trials(file), BatchOptions(1))
    assert outcome.state == TRACKED and outcome.image_sets == 3 and outcome.status_counts["INITIALIZING"] == 3
    assert any("gone was not found in 3 image sets" in problem for problem in outcome.problems)
    assert list(outcome.by_body) == ["one", "gone", "lost"] and outcome.by_body["gone"]["INITIALIZING"] == 3
    assert outcome.metrics["one.residual_px"] < 2.0 and not any(key.startswith("gone") for key in outcome.metrics)
    assert outcome.by_body["lost"]["LOST"] == 3 and any("lost is LOST throughout" in told for told in outcome.problems)
    assert set(outcome.ranges) and all(name.startswith("one.") for name in outcome.ranges)
    assert (tmp_path / "out/pair/one/states.csv").exists() and (tmp_path / "out/pair/gone/run.json").exists()
    told: list[str] = []
    (again,) = run_batch(load_trials(file), BatchOptions(1), told.append)
    assert (again.inputs, again.wall_s) == (outcome.inputs, outcome.wall_s) and not told
    (tmp_path / "two/one_start.yaml").write_text((tmp_path / "two/one_start.yaml").read_text() + "# \n")
    run_batch(load_trials(file), BatchOptions(1), told.append)
    assert told


def test_what_is_done_is_left_and_what_has_changed_is_tracked_again(trials_file, tmp_path):
    run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    before, told = written(tmp_path / "out"), []
    assert list(before) == ["first"]
    assert [o.name for o in run_batch(load_trials(trials_file), TWO, told.append)] == ["first", "second", "third"]
    after = written(tmp_path / "out")
    assert after["first"] == before["first"] and len(after) == 3 and not told
    trials_file.write_text(trials_file.read_text().replace("end: 6", "end: 5"))
    outcomes = run_batch(load_trials(trials_file), TWO, told.append)
    assert outcomes[1].image_sets == 5 and told == ["second is tracked again: what it is made from has changed"]
    changed = written(tmp_path / "out")
    assert {name for name in after if changed[name] != after[name]} == {"second"}
    run_batch(load_trials(trials_file), BatchOptions(1, again=True, only=("third",)), told.append)
    again = written(tmp_path / "out")
    assert {name for name in after if again[name] != changed[name]} == {"third"}
    assert run_batch(load_trials(trials_file), TWO)[2].inputs == outcomes[2].inputs  # and not once more
    assert written(tmp_path / "out") == again


def test_a_file_that_changes_counts_as_a_change(trials_file, clip, tmp_path):
    config = tmp_path / "own.yaml"
    shutil.copy(clip.config_file, config)
    trials_file.write_text(trials_file.read_text().replace(str(clip.config_file), str(config)))
    (first,) = run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    config.write_text(config.read_text() + "# another thought\n")
    (second,) = run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    assert first.inputs != second.inputs and first.batch != second.batch


def test_a_trial_that_fails_stops_nothing(trials_file, tmp_path, capsys):
    text = trials_file.read_text()
    text += "  no_model: {model: nobody.yaml}\n  other_cameras: {cameras: [left, right]}\n"
    text += "  no_images: {sources: 'no/{name}.mp4'}\n"
    trials_file.write_text(text)
    assert main(["batch", str(trials_file), "--workers", "2", "--no-pdf"]) == 1
    out, err = capsys.readouterr()
    assert "3 of 6 trials tracked; failed: no_model, other_cameras, no_images" in out
    assert "batch: no_model failed:" in err and "unknown camera 'left'; valid: cam01, cam02, cam03" in err
    assert set(written(tmp_path / "out")) == {"first", "second", "third"}
    assert "nobody.yaml" in (tmp_path / "out/failed/no_model.txt").read_text()
    known = {entry["name"]: entry["state"] for entry in json.loads((tmp_path / "out/batch.json").read_text())["trials"]}
    assert known["third"] == TRACKED and known["no_images"] == FAILED_STATE
    trials_file.write_text(text.replace("  no_images: {sources: 'no/{name}.mp4'}\n", "  no_images: {}\n"))
    assert main(["batch", str(trials_file), "--only", "no_images", "--no-pdf", "--quiet"]) == 1  # for the others' sake
    assert "4 of 6 trials tracked; failed: no_model, other_cameras" in capsys.readouterr().out
    assert not (tmp_path / "out/failed/no_images.txt").exists()


def test_a_camera_that_is_missing_is_said_once_and_the_trial_marked(trials_file, tmp_path, capsys):
    trials_file.write_text(trials_file.read_text() + "  gone: {sources: {cam03: nowhere}}\n")
    assert main(["batch", str(trials_file), "--only", "first", "gone", "--workers", "1", "--no-pdf", "--quiet"]) == 0
    assert "2 of 2 trials tracked\nwith warnings or LOST sets: gone\n" in capsys.readouterr().out
    gone, first = (read_outcome(tmp_path / "out" / name) for name in ("gone", "first"))
    missing = f"image source '{tmp_path / 'nowhere'}': no such file or folder"
    assert list(gone.problems) == [f"camera 'cam03': {missing}; this camera is left out"]
    assert not first.problems and first.notes == gone.notes and "no rate in image folders" in first.notes[0]
    page = (tmp_path / "out/report.html").read_text()
    shown = re.findall(r'<p class="problem">(\w+(?:, \w+)?): ([\w ]+)', page)
    assert shown == [("gone", "camera "), ("first, gone", "no rate in image folders")]
    assert re.findall(r'<span class="light (\w+)"[^>]*></span><a href="(\w+)', page) == [("good", "first"), ("warn", "gone")]


def test_what_a_trial_is_compared_with_is_checked_before_it_is_tracked(trials_file, tmp_path, monkeypatch):
    trials_file.write_text(trials_file.read_text() + "  goals: {evaluate: {targets: [mpjpe_mm]}}\n")
    monkeypatch.setattr("tracker_node.batch.work.run_together", lambda *_: pytest.fail("it was tracked"))
    job = next(trial for trial in load_trials(trials_file).trials if trial.name == "goals")
    (tmp_path / "out/.batch").mkdir(parents=True)
    (tmp_path / "out/.batch/token").write_text("t")
    outcome = run_trial(Job("goals", "", job.recording, "", str(tmp_path / "out"), "t"))
    assert outcome.state == FAILED_STATE and not outcome.details
    assert "'evaluate.targets': expected KEY<=NUMBER or KEY>=NUMBER, got 'mpjpe_mm'" in outcome.reason


def test_image_sets_are_counted_as_the_recording_says_also_of_a_part(trials_file, tmp_path):
    trials_file.write_text(trials_file.read_text() + "  part: {images: {end: 6}, evaluate: {image_sets: 9}}\n")
    (outcome,) = run_batch(load_trials(trials_file), BatchOptions(workers=1, only=("part",)))
    assert outcome.metrics["image_sets"] == 9
    for page in (tmp_path / "out/part").glob("report.*"):
        assert "drafts" not in page.read_text("latin-1")
    assert f"<dt>run</dt><dd><code>{tmp_path / 'out/part'}</code>" in (tmp_path / "out/part/report.html").read_text()


def test_a_trial_whose_process_dies_is_tried_once_more(trials_file, monkeypatch):
    died = []

    def dies_once(self, function, args, kwargs):
        if args and isinstance(args[0], Job) and args[0].name == "second" and not died:
            died.append(args[0].name)
            raise WorkerDied("the process that worked on it ended with signal SIGKILL")
        return call(self, function, args, kwargs)

    call = Processes._call
    monkeypatch.setattr(Processes, "_call", dies_once)
    assert [o.state for o in run_batch(load_trials(trials_file), TWO)] == [TRACKED] * 3 and died == ["second"]

    def dies(self, function, args, kwargs):
        raise WorkerDied("the process that worked on it ended with signal SIGKILL")

    monkeypatch.setattr(Processes, "_call", dies)
    outcomes = run_batch(load_trials(trials_file), BatchOptions(1, again=True))
    assert [o.reason for o in outcomes] == ["the process that worked on it ended with signal SIGKILL, 2 times"] * 3


def test_a_body_that_is_never_seen_is_a_failure(trials_file, clip, tmp_path):
    import cv2

    for camera in ("cam01", "cam02", "cam03"):
        (tmp_path / camera).mkdir()
        plate = cv2.imread(str(clip.folder / f"{camera}_plate.png"))
        for i in range(4):
            cv2.imwrite(str(tmp_path / camera / f"{i:04d}.png"), plate)
    text = trials_file.read_text().replace(f"  initial_state: {clip.state_file}\n", "")
    trials_file.write_text(text + "  empty: {sources: '{name}'}\n")
    (empty,) = run_batch(load_trials(trials_file), BatchOptions(1, only=("empty",)))
    assert empty.state == FAILED_STATE and "the body was not found in 4 image sets" in empty.reason


def test_a_worker_without_the_folder_says_so(trials_file, tmp_path):
    trial = load_trials(trials_file).trials[0]
    job = Job(trial.name, "", trial.recording, "", str(tmp_path / "elsewhere"), "token")
    assert "does not see" in run_trial(job).reason and "share this folder" in run_trial(job).reason
    (tmp_path / "elsewhere/.batch").mkdir(parents=True)
    (tmp_path / "elsewhere/.batch/token").write_text("another\n")
    assert "sees another folder" in run_trial(job).reason
    other = Job(trial.name, "", trial.recording, "", str(tmp_path / "elsewhere"), "another", version="0.0.1")
    assert f"has version {__version__} of tracker_node, expected 0.0.1" in run_trial(other).reason


def test_what_no_batch_has_made_is_left_alone(trials_file, tmp_path):
    (tmp_path / "out/first").mkdir(parents=True)
    (tmp_path / "out/first/notes.txt").write_text("mine")
    first, *_ = run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    assert first.state == FAILED_STATE and "is there already, and no result of a batch" in first.reason
    assert (tmp_path / "out/first/notes.txt").read_text() == "mine" and read_outcome(tmp_path / "out/first") is None


def test_two_batches_do_not_work_in_one_folder(trials_file, tmp_path):
    with OwnedFolder(tmp_path / "out").claimed(), pytest.raises(TrackerError, match="works in this folder"):
        run_batch(load_trials(trials_file), TWO)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--only", "fourth"], "unknown trial 'fourth'; valid: first, second, third"),
        (["--workers", "0"], "field '--workers': expected a whole number, 1 or more, got 0"),
        (["--threads", "-1"], "field '--threads': expected a whole number, 1 or more, got -1"),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(trials_file, capsys, arguments, said):
    assert main(["batch", str(trials_file), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_only_names_trials_of_the_file(trials_file):
    with pytest.raises(UnknownNameError):
        run_batch(load_trials(trials_file), BatchOptions(only=("fourth",)))


def test_progress_comes_to_an_end_with_an_estimate(trials_file, monkeypatch):
    monkeypatch.setattr(batch, "_POLL_S", 0.02)
    seen = []
    run_batch(load_trials(trials_file), TWO, progress=seen.append)
    assert seen[-1].done == seen[-1].trials == 3 and seen[-1].left_s == 0.0
    assert any(now.left_s is not None and now.left_s > 0.0 for now in seen)
    assert max(now.expected_sets for now in seen) in range(6, 16) and all(now.failed == 0 for now in seen)


def test_ctrl_c_ends_it_and_the_next_call_goes_on(trials_file, tmp_path):
    command = [sys.executable, "-m", "tracker_node.cli.main", "batch", str(trials_file), "--workers", "1", "--no-pdf"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": os.getcwd()})
    while not written(tmp_path / "out"):
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    err = process.communicate(timeout=60)[1]
    assert process.returncode == 130 and "Traceback" not in err, err
    done = written(tmp_path / "out")
    assert 1 <= len(done) < 3
    run_batch(load_trials(trials_file), TWO)
    assert {name: stamp for name, stamp in written(tmp_path / "out").items() if name in done} == done


def test_a_failure_of_before_goes_when_the_results_are_good(trials_file, tmp_path):
    run_batch(load_trials(trials_file), TWO)
    failed = tmp_path / "out/failed"
    failed.mkdir()
    (failed / "second.txt").write_text("the share was gone\n")
    others = run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    assert [(o.name, o.state) for o in others] == [("first", TRACKED), ("second", FAILED_STATE), ("third", TRACKED)]
    assert others[1].reason == "the share was gone" and others[0].subject == "anna"
    assert all(o.state == TRACKED for o in run_batch(load_trials(trials_file), TWO)) and not list(failed.iterdir())


def test_results_that_were_to_be_replaced_come_back_after_a_crash(trials_file, tmp_path):
    run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    before = written(tmp_path / "out")
    drafts = tmp_path / "out/.batch/drafts"
    drafts.mkdir(parents=True, exist_ok=True)
    (tmp_path / "out/first").rename(drafts / "first.0123abcd.old")
    run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    assert written(tmp_path / "out") == before


def test_the_place_that_it_is_called_from_is_no_matter(trials_file, tmp_path, monkeypatch):
    run_batch(load_trials(trials_file), BatchOptions(1, only=("first",)))
    before = written(tmp_path / "out")
    monkeypatch.chdir(tmp_path / "out")
    run_batch(load_trials("../trials.yaml", "."), BatchOptions(1, only=("first",)))
    assert written(tmp_path / "out") == before
