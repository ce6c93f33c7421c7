"""A recording in one YAML file: live and offline do the same with it, and evaluate it."""

import json
import shutil
from collections import Counter

import numpy as np
import pytest

from helpers.ros.samples import moving_state, tracked_arm
from tracker_node.cli.main import main
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.model.configuration import Configuration
from tracker_node.ros.pipeline import PipelineOptions, Progress, write_summaries
from tracker_node.tracking.estimate import Status

RECORDING = """
rig: rig.yaml
model: model.yaml
initial_state: state.yaml
output: run
sources: "{name}"
images: {start: 1, end: 9, resize: [120, 90]}
record: {masks: true, markers: true, split_mb: 0.05, compression: zstd}
evaluate: {truth: truth.csv, name: arm, image_sets: 8, align: stamp, targets: [lost_sets<=0]}
"""


PATIENCE_S = 300.0  # the evaluation draws its report


@pytest.fixture(scope="module")
def described(recording, tmp_path_factory):
    """The recording with a description, its true fingertip, and a rig that names no sources that are there."""
    folder = tmp_path_factory.mktemp("described") / "arm"
    shutil.copytree(recording, folder)
    rig = (folder / "rig.yaml").read_text()
    (folder / "rig.yaml").write_text(rig.replace(f"source: {recording}", "source: /nowhere"))
    model = tracked_arm()
    with (folder / "truth.csv").open("w") as file:
        file.write("stamp_ns,landmark,x,y,z\n")
        for i in range(12):
            x, y, z = Configuration(model, moving_state(model, i)).landmarks_world[0]
            file.write(f"{round(i * 1e9 / 30)},fingertip,{x},{y},{z}\n")
    (folder / "recording.yaml").write_text(RECORDING)
    return folder


def states_of(bag) -> list:
    """States with their covariances."""
    with BagReader(bag) as reader:
        topics = ("/tracker/state", "/tracker/state_covariance")
        return list(zip(*([message for _, message in reader.decoded(topic)] for topic in topics), strict=True))


def test_live_and_offline_give_the_same_states_of_it(launch, described, tmp_path):
    live = launch("pipeline", described / "recording.yaml")
    offline = launch("track", described / "recording.yaml", "--output", tmp_path / "offline")
    assert live.wait(PATIENCE_S) == 0, live.err
    assert offline.wait(PATIENCE_S) == 0, offline.err
    assert "8 image sets: 8 TRACKING" in live.out and "8 image sets: 8 TRACKING" in offline.out
    ours, theirs = states_of(described / "run" / "bag"), states_of(tmp_path / "offline" / "bag")
    assert len(ours) == len(theirs) == 8
    for (a, of_a), (b, of_b) in zip(ours, theirs, strict=True):
        assert (a.header.stamp.sec, a.header.stamp.nanosec) == (b.header.stamp.sec, b.header.stamp.nanosec)
        assert np.array_equal(a.values, b.values) and np.array_equal(of_a.covariance, of_b.covariance)
    with BagReader(described / "run" / "bag") as reader:
        topics = set(reader.topics)
    assert {"/tracker/cam1/mask", "/tracker/markers", "/diagnostics"} <= topics and "/cam1/image_raw" not in topics
    assert len(list((described / "run" / "bag").glob("*.mcap"))) > 1
    for folder in (described / "run", tmp_path / "offline"):
        figures = json.loads((folder / "report.json").read_text())["metrics"]
        assert figures["arm.image_sets"] == 8 and figures["arm.lost_sets"] == 0
        assert figures["arm.mpjpe_no_lag_correction_mm"] < 30.0
    told = json.loads((described / "run" / "report.json").read_text())["metrics"]
    info = json.loads((described / "run" / "run.json").read_text())
    assert info["options"]["model"] == str(described / "model.yaml") and info["options"]["start"] == 1
    assert (info["image_sets"], info["lost_sets"], info["status_counts"]["TRACKING"]) == (8, 0, 8)
    assert info["parameters"] == json.loads((tmp_path / "offline" / "run.json").read_text())["parameters"]
    again = ["evaluate", described / "run", "--truth", described / "truth.csv", "--align", "stamp", "--name", "arm", "--no-pdf"]
    assert main([*map(str, again), "--output", str(tmp_path / "again")]) == 0  # nobody names the body, or the rig
    assert json.loads((tmp_path / "again" / "report.json").read_text())["metrics"] == told


def test_the_command_line_goes_before_the_file(launch, described, tmp_path):
    run = launch("track", described / "recording.yaml", "--start", "0", "--end", "3", "--output", tmp_path / "out")
    assert run.wait() == 0, run.err
    assert "3 image sets" in run.out
    states = states_of(tmp_path / "out" / "bag")
    assert states[0][0].header.stamp.nanosec == 0
    options = json.loads((tmp_path / "out" / "run.json").read_text())["options"]
    assert (options["start"], options["end"], options["resize"]) == (0, 3, [120, 90])


def test_mistakes_are_one_line(launch, described, tmp_path):
    offline = tmp_path / "offline"
    offline.mkdir()
    (offline / "states.csv").write_text("of an offline run")
    live = tmp_path / "live"
    live.mkdir()
    (live / "run.json").write_text("{}")
    wrong = described / "wrong.yaml"
    wrong.write_text(RECORDING.replace("model.yaml", "nobody.yaml"))
    processes = {
        "model": launch("pipeline", wrong),
        "states.csv": launch("pipeline", described / "recording.yaml", "--output", offline),
        "live/run.json": launch("pipeline", described / "recording.yaml", "--bag", live / "bag"),
        "--rig and --model": launch("pipeline", "--bag", tmp_path / "bag"),
        "camera 'left'": launch("track", described / "recording.yaml", "--source", "left=x", "--output", tmp_path / "a"),
        "--output": launch("track", "--rig", described / "rig.yaml", "--model", described / "model.yaml"),
    }
    for said, process in processes.items():
        assert process.wait() == 2, said
        assert said in process.err and len(process.err.splitlines()) == 1, process.err
    assert [path.name for path in offline.iterdir()] == ["states.csv"]
    assert [path.read_text() for path in live.iterdir()] == ["{}"]


def test_of_several_bodies_the_one_that_is_worst_off_is_not_hidden(tmp_path):
    models = dict.fromkeys(("one", "other", "late_1", "late_2"), "/files/body.yaml")
    options = PipelineOptions([], [], (), models, joining=("late_1", "late_2"), summary={"options": {"model": None, "rig": "r"}})
    statuses = [{Status.TRACKING: 8}, {Status.LOST: 8}, {Status.INITIALIZING: 7, Status.TRACKING: 1}, {Status.INITIALIZING: 8}]
    for order in (1, -1):
        progress = {name: Progress(8, statuses=Counter(n)) for name, n in list(zip(models, statuses, strict=True))[::order]}
        folder = tmp_path / f"run{order}"
        write_summaries(options, folder, progress, {name: f"/tracker/{name}/state" for name in models})
        said = json.loads((folder / "run.json").read_text())
        assert (said["lost_sets"], said["status_counts"]["TRACKING"]) == (8, 0)
        assert {name: each["lost_sets"] for name, each in said["bodies"].items()} == {**dict.fromkeys(models, 0), "other": 8}
        own = json.loads((folder / "one/run.json").read_text())
        assert (own["lost_sets"], own["topic"]) == (0, "/tracker/one/state")
        assert own["options"] == {"model": "/files/body.yaml", "rig": "r"}
        assert sorted(path.name for path in folder.iterdir()) == ["late_1", "one", "other", "run.json"]
