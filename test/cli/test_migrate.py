"""``tracker_node migrate``: files, bags and runs of version 0.1."""

from pathlib import Path

import pytest

from helpers.ros.samples import tracked_arm
from helpers.sources.old_bag import write_old_bag
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.rig_yaml import read_rig_file
from tracker_node.runs.config_file import load_config
from tracker_node.runs.load import load_run

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


def test_bags_and_runs_are_refused(tmp_path: Path) -> None:
    bag = write_old_bag(tmp_path / "bag", DOFS, STAMPS_NS)
    with pytest.raises(FileFormatError, match=r"/tracker/state.*version 0\.1 reads its own runs"):
        load_run(bag)
    columns = ",".join((*(f"{name}_{unit}" for name, unit in zip(DOFS, ["m"] * 3 + ["rad"] * 3, strict=True)), "score"))
    (tmp_path / "run").mkdir()
    (tmp_path / "run/states.csv").write_text(f"stamp_ns,status,reason,{columns},residual_px,iterations,evaluations\n")
    with pytest.raises(FileFormatError, match=r"states\.csv.*version 0\.1 reads its own runs"):
        load_run(tmp_path / "run")
    assert main(["migrate", str(bag)]) == 2


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
