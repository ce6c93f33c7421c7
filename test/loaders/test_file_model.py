"""Who gives the wrong file is told which one it is; who misspells a key, which one is meant."""

import json

import pytest

from helpers.cameras.small_clip import make_clip
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError, WrongKindOfFileError
from tracker_node.loaders.file_model import check_kind, kind_of
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.runs.config_file import dump_config, load_config
from tracker_node.tracking.config import TrackerConfig

KINDS = {
    "rig": ("rig.yaml", "a rig", load_rig),
    "body": ("model.yaml", "a body", load_model),
    "state": ("start.yaml", "a state", None),
    "recording": ("recording.yaml", "a recording", load_recording),
    "parameters": ("config.yaml", "a file of parameters", load_config),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    clip = make_clip(tmp_path_factory.mktemp("kinds") / "clip", 1)
    (clip.folder / "recording.yaml").write_text("rig: rig.yaml\nmodel: model.yaml\noutput: out\n")
    return clip.folder


@pytest.mark.parametrize("given", KINDS)
@pytest.mark.parametrize("wanted", KINDS)
def test_each_kind_is_known_in_the_place_of_each_other(folder, given, wanted):
    file, found, _ = KINDS[given]
    _, name, load = KINDS[wanted]
    load = load or (lambda path: load_state(path, load_model(folder / "model.yaml")))
    if given == wanted:
        load(folder / file)
        return
    with pytest.raises(WrongKindOfFileError) as told:
        load(folder / file)
    assert str(told.value) == f"{folder / file}: this is {found}, not {name}"


OTHERS = {
    "a file of reference masks": {"cameras": {"cam1": {"image_size": [9, 9], "polygons": {}}}},
    "a file of metrics": {"metrics": {"a": 1.0}, "command": ""},
    "the summary of a run": {"image_sets": 3, "status_counts": {}},
    "the metadata of a bag": {"rosbag2_bagfile_information": {}},
    "a ROS camera_info file (rig import reads it)": {"image_width": 3, "camera_matrix": {}},
}


@pytest.mark.parametrize("found", OTHERS)
def test_other_files_of_ours_and_of_ros_are_known(tmp_path, found):
    path = tmp_path / "given.yaml"
    path.write_text(json.dumps(OTHERS[found]))
    for load, wanted in ((load_rig, "a rig"), (load_model, "a body"), (load_config, "a file of parameters")):
        with pytest.raises(WrongKindOfFileError) as told:
            load(path)
        assert str(told.value) == f"{path}: this is {found}, not {wanted}"


def test_all_parameters_are_known_as_parameters(tmp_path):
    dump_config(TrackerConfig(), tmp_path / "all.yaml")
    load_config(tmp_path / "all.yaml")


def test_the_command_says_so_in_one_line(folder, capsys):
    arguments = ["--rig", str(folder / "model.yaml"), "--model", str(folder / "model.yaml"), "--output", str(folder / "out")]
    assert main(["track", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("model.yaml: this is a body, not a rig")


def changed(folder, tmp_path, *changes):
    text = (folder / "rig.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    return path


def test_a_misspelt_key_comes_first_with_the_one_that_is_meant(folder, tmp_path):
    path = changed(folder, tmp_path, ("image_size: [160, 120]", "image_size: 7"), ("background: cam02", "backgroun: cam02"))
    with pytest.raises(FileFormatError) as told:
        load_rig(path)
    first, _, rest = str(told.value).partition("; ")
    assert "field 'cameras.cam02.backgroun': expected 'background', or another of ['K', " in first and "got 'backgroun'" in first
    assert "field 'cameras.cam01.image_size': expected" in rest and "more problems" not in rest


def test_all_problems_are_told_up_to_a_handful(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text("cameras:\n" + "".join(f"  cam{i}: {{unknown_{i}: 1}}\n" for i in range(9)))
    with pytest.raises(FileFormatError) as told:
        load_rig(path)
    assert [f"unknown_{i}" in str(told.value) for i in range(9)] == [True] * 5 + [False] * 4
    assert str(told.value).endswith("; and 4 more problems in this file")


def test_a_key_that_is_unknown_in_each_camera_is_told_once(tmp_path):
    path = tmp_path / "rig.yaml"
    lens = "image_size: [64, 48], K: [[50, 0, 32], [0, 50, 24], [0, 0, 1]]"
    path.write_text("cameras:\n" + "".join(f"  cam{i}: {{{lens}, T_wrold_cam: 1}}\n" for i in range(8)))
    with pytest.raises(FileFormatError) as told:
        load_rig(path)
    text = str(told.value)
    assert told.value.field == "cameras.cam0.T_wrold_cam" and text.count("'T_world_cam', or another of") == 1
    assert "; the same in 'cameras.cam1.T_wrold_cam', " in text and text.endswith("'cameras.cam5.T_wrold_cam', 2 more")


def test_the_end_of_a_long_reason_is_kept():
    reason = "while reading " + "x" * 2000 + ": no space left"
    assert str(FileFormatError("f", "x", "a file", reason)).endswith(": no space left'")
    assert len(str(FileFormatError("f", "x", "a file", reason))) < 400
    assert len(str(FileFormatError("f", "x", "a file", [1] * 1000))) < 200


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({}, ""),
        ({"anything": 1}, ""),
        ({"metrics": {}}, "a file of metrics"),
        ({"metrics": 1}, ""),
        ({"image_sets": 1, "status_counts": 1}, "the summary of a run"),
        ({"image_sets": 1}, ""),
        ({"status_counts": 1}, ""),
        ({"rosbag2_bagfile_information": 1}, "the metadata of a bag"),
        ({"image_width": 1, "camera_matrix": 1}, "a ROS camera_info file (rig import reads it)"),
        ({"image_width": 1, "camera_name": 1}, "a ROS camera_info file (rig import reads it)"),
        ({"image_width": 1}, ""),
        ({"camera_matrix": 1, "camera_name": 1}, ""),
        ({"cameras": {"a": {"still": 1}, "b": {}}}, "a file of reference masks"),
        ({"cameras": {"a": {}, "b": {"polygons": 1}}}, "a file of reference masks"),
        ({"cameras": {"a": {"K": 1}, "b": "polygons"}}, "a rig"),
        ({"cameras": {"a": {"K": 1}}, "rig": "rig.yaml", "model": 1}, "a recording"),
        ({"cameras": 3}, ""),
        ({"links": []}, "a body"),
        ({"links": {}}, ""),
        ({"rig": "rig.yaml"}, ""),
        ({"rig": {}, "model": 1}, ""),
        ({"root": {}}, "a state"),
        ({"root": 1}, ""),
        ({"/**": {"ros__parameters": {}}}, "a file of parameters"),
        ({"/**": {"other": {}}}, ""),
        ({"motion": {}}, "a file of parameters"),
        ({"motion": 1, "other": {}}, ""),
    ],
)
def test_keys_tell_the_kind(values, kind):
    assert kind_of(values) == kind


def test_what_is_not_known_is_not_refused():
    check_kind({"anything": 1}, "a rig", "x.yaml")
    check_kind({"links": []}, "a body", "x.yaml")
    with pytest.raises(WrongKindOfFileError, match="this is a body, not a rig"):
        check_kind({"links": []}, "a rig", "x.yaml")


def test_a_line_break_in_a_name_stays_out_of_the_message(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text('cameras: {"": 1, "a\\nb": 2}\n')
    with pytest.raises(FileFormatError) as told:
        load_rig(path)
    assert "\n" not in str(told.value) and "a\\nb" in str(told.value)
