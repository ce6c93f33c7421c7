"""``tracker_node migrate``: files, bags and runs of version 0.1."""

import json
from pathlib import Path

import numpy as np
import pytest

from helpers.ros.samples import tracked_arm
from helpers.sources.old_bag import write_old_bag
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.message_types import TRACKED_STATE, message_type
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.rig_yaml import read_rig_file
from tracker_node.runs.config_file import load_config
from tracker_node.runs.load import load_run
from tracker_node.tracking.estimate import LimbStatus

OLD = """# by hand
/**:
  ros__parameters:
    engine: color
    color: {representation: affine, search_radius: 0.45}
    evidence: {canny_high: 90.0}
    start: {keep: 3}
"""


def test_a_file_is_rewritten_and_the_old_one_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "tracker.yaml"
    file.write_text(OLD)
    assert main(["migrate", str(file)]) == 0
    config = load_config(file)
    assert (config.modalities, config.texture.search_radius, config.initialization.candidates) == (("texture",), 0.45, 3)
    assert (tmp_path / "tracker.yaml.old").read_text() == OLD
    said = capsys.readouterr()
    assert "tracker.yaml.old" in said.out and "left out: chamfer.canny_high" in said.err
    file.write_text(OLD)
    assert main(["migrate", str(file)]) == 2 and "tracker.yaml.old" in capsys.readouterr().err
    assert file.read_text() == OLD


def test_another_place_and_what_no_version_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, other = tmp_path / "tracker.yaml", tmp_path / "new.yaml"
    file.write_text("region: {clamp: 3.0}\n")
    assert main(["migrate", str(file), "-o", str(other)]) == 0
    assert load_config(other).region.max_log_ratio == 3.0 and file.read_text() == "region: {clamp: 3.0}\n"
    file.write_text("region: {clam: 3.0}\n")
    assert main(["migrate", str(file), "-o", str(other)]) == 2
    assert "region.clam" in capsys.readouterr().err


def test_a_rig_keeps_its_comments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entry = "image_size: [64, 48], K: [[50, 0, 32], [0, 50, 24], [0, 0, 1]], T_world_cam: {}".format(
        "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
    )
    file = tmp_path / "rig.yaml"
    file.write_text(f"# my room\ncameras:\n  a: {{{entry}, plate: a.png}}\n  b: {{{entry}}}\n")
    with pytest.raises(FileFormatError, match=r"background \(`tracker_node migrate`") as caught:
        read_rig_file(file)
    assert caught.value.field == "cameras.a.plate"
    assert main(["migrate", str(file)]) == 0
    assert read_rig_file(file).cameras["a"].background == "a.png" and file.read_text().startswith("# my room")


def test_a_recording_keeps_its_comments(tmp_path: Path) -> None:
    file = tmp_path / "recording.yaml"
    file.write_text("# walk\nrig: rig.yaml\nmodel: person.yaml\noutput: run\nrecord: {masks: true, through_masks: true}\n")
    for name in ("rig.yaml", "person.yaml"):
        (tmp_path / name).touch()
    with pytest.raises(FileFormatError, match=r"masked_images \(`tracker_node migrate`") as caught:
        load_recording(file)
    assert caught.value.field == "record.through_masks"
    assert main(["migrate", str(file)]) == 0
    assert load_recording(file).record.masked_images and file.read_text().startswith("# walk\n")


DOFS = ("root_x", "root_y", "root_z", "root_rx", "root_ry", "root_rz")
STAMPS_NS = [10**9 + i * 40_000_000 for i in range(3)]


def test_a_bag_has_its_covariances_apart_and_the_present_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_old_bag(tmp_path / "bag", DOFS, STAMPS_NS)
    with pytest.raises(FileFormatError, match=r"/tracker/state.*tracker_node migrate.*version 0\.1"):
        load_run(bag)
    assert main(["migrate", str(bag)]) == 0
    assert (tmp_path / "bag.old/metadata.yaml").exists() and "bag.old" in capsys.readouterr().out
    with BagReader(bag, scanned=True) as reader:
        pictures = {"/tracker/cam01/overlay/compressed", "/tracker/cam01/masked_image/compressed"}
        assert set(reader.topics) == {"/tracker/state", "/tracker/state_covariance"} | pictures
        assert reader.custom == {"model": "stick"} and {topic.message_count for topic in reader.topics.values()} == {3}
        found = reader.topic("/tracker/state")
        present = message_type(TRACKED_STATE)
        assert (found.definition, found.type_hash) == (present.definition, present.type_hash)
        sent_ns = [message.publish_ns for message in reader.messages(["/tracker/state"])]
        states = [message for _, message in reader.decoded("/tracker/state")]
        covariances = [message for _, message in reader.decoded("/tracker/state_covariance")]
    assert sent_ns == [stamp + 3 for stamp in STAMPS_NS]
    assert [message.header.stamp for message in states] == [message.header.stamp for message in covariances]
    for i, (state, covariance) in enumerate(zip(states, covariances, strict=True)):
        assert (state.residual, state.residual_unit, state.camera_residuals.tolist()) == (1.5 + i, "px", [2.5 + i])
        assert [LimbStatus(number).name for number in state.limb_status] == ["TRACKING", "UNSEEN", "LOST"]
        assert state.limb_reasons == ["", "hidden", "not found"] and state.root_pose.position.z == 3.0
        assert (covariance.dof_names, state.cameras, state.total_ms) == (list(DOFS), ["cam01"], 3.0)
        assert covariance.covariance.reshape(6, 6).tolist() == (i * np.eye(6)).tolist()
        assert covariance.velocity_covariance.reshape(6, 6).tolist() == (2.0 * i * np.eye(6)).tolist()
    run = load_run(bag)
    assert run.details is not None and run.details.covariances[:, 4, 4].tolist() == [0.0, 1.0, 2.0]
    assert main(["migrate", str(bag), "-o", str(tmp_path / "again")]) == 2
    assert "a bag of version 0.1" in capsys.readouterr().err and not (tmp_path / "again").exists()


def test_a_run_of_colors_is_rewritten_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "run"
    write_old_bag(run / "bag", DOFS, STAMPS_NS)
    columns = ",".join((*(f"{name}_{unit}" for name, unit in zip(DOFS, ["m"] * 3 + ["rad"] * 3, strict=True)), "score"))
    rows = [f"{stamp},TRACKING,,0,0,0,0,0,0,1,2.5,3,4" for stamp in STAMPS_NS]
    rows[0] = f"{STAMPS_NS[0]},INITIALISING,,,,,,,,0,0,0,0"
    old = "\n".join([f"stamp_ns,status,reason,{columns},residual_px,iterations,evaluations", *rows, ""])
    (run / "smoothed").mkdir()
    for name in ("states.csv", "smoothed/states.csv"):
        (run / name).write_text(old)
    counts = {"INITIALISING": 1, "TRACKING": 2}
    info = {"status_counts": counts, "residual_px": {"p50": 2.5}, "parameters": {"engine": "color"}, "note": "kept"}
    (run / "run.json").write_text(json.dumps(info))
    with pytest.raises(FileFormatError, match=r"states\.csv.*tracker_node migrate"):
        load_run(run)
    assert main(["migrate", str(run), "-o", str(tmp_path / "new")]) == 0
    assert (run / "states.csv").read_text() == old
    found = load_run(tmp_path / "new")
    assert found.residual_unit == "gray levels" and found.status_text == "1 INITIALIZING, 2 TRACKING"
    assert found.info["status_counts"] == {"INITIALIZING": 1, "TRACKING": 2} and found.info["note"] == "kept"
    assert found.info["residual"] == {"p50": 2.5} and "residual_px" not in found.info
    assert load_run(tmp_path / "new/smoothed").residual.tolist()[1:] == [2.5, 2.5]
    with BagReader(tmp_path / "new/bag") as reader:
        assert {message.residual_unit for _, message in reader.decoded("/tracker/state")} == {"gray levels"}
    assert main(["migrate", str(run), "-o", str(tmp_path / "new")]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_body_keeps_its_comments(tmp_path: Path) -> None:
    file = tmp_path / "model.yaml"
    dump_model(tracked_arm(), file)
    text = file.read_text()
    old = "# mine\n" + text.replace("- name: elbow_flexion\n", "- name: elbow_flexion\n      follows: {axis: shoulder_x}\n")
    file.write_text(old)
    with pytest.raises(FileFormatError, match=r"follows.*mimic \(`tracker_node migrate`"):
        load_model(file)
    assert main(["migrate", str(file)]) == 0
    assert file.read_text().startswith("# mine\n") and (tmp_path / "model.yaml.old").read_text() == old
    driven = next(axis for axis in load_model(file).chain.axes if axis.name == "elbow_flexion")
    assert driven.mimic is not None and driven.mimic.leader == "shoulder_x"
