"""Files gone wrong in every way: each is answered by a message that names file and field, or says the same again."""

import json

import pytest
import yaml

from helpers.fuzz.mutations import bomb, bomb_within
from helpers.fuzz.runs import Answers, child, run
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.rig.rig_yaml import load_rig

CORE = ("rig", "rig_file", "model", "slides", "part", "config", "plain_config", "recording", "state", "urdf")
OTHERS = ("opencv_yaml", "opencv_xml", "opencv_json", "mesh", "clicks", "control_points", "places", "stamps", "markers", "table")

POINTS = (
    "points_mmpose", "points_coco", "points_mediapipe", "points_mediapipe_csv", "points_deeplabcut", "points_deeplabcut_h5",
    "points_sleap", "points_sleap_h5", "points_openpose", "keypoints",
)  # fmt: skip


@pytest.mark.parametrize(
    ("kinds", "count", "least_refused"),
    [
        (CORE, 50, 0.4),
        (OTHERS, 30, 0.3),
        (POINTS, 30, 0.3),
        pytest.param(CORE, 450, 0.6, marks=pytest.mark.long),
        pytest.param(OTHERS, 250, 0.5, marks=pytest.mark.long),
        pytest.param(POINTS, 450, 0.5, marks=pytest.mark.long),
    ],
)
def test_fuzzed_files_are_answered(kinds, count, least_refused, tmp_path):
    answers = Answers()
    run(tmp_path, 2026, kinds, count, answers)
    assert answers.bad == []
    assert answers.answered == answers.total == count
    assert answers.refused > least_refused * count


def test_the_same_seed_makes_the_same_files(tmp_path, capsys):
    for _ in range(2):
        child(tmp_path, 7, ["state"], 0, 5, memory_limit=None)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) == 20
    assert lines[:10] == lines[10:]


def test_a_reader_that_hangs_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("helpers.fuzz.runs.START_LIMIT_S", 0.001)
    answers = Answers()
    run(tmp_path, 1, ["clicks"], 1, answers)
    assert answers.answered == 0
    assert answers.total == 1
    assert "no answer within" in answers.bad[0]


@pytest.mark.parametrize("text", [bomb("cameras", merge=False), bomb("cameras", merge=True), bomb_within("cameras")])
def test_aliases_that_stand_for_more_than_a_machine_holds(text, tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=r"rig\.yaml"):
        load_rig(path)


def test_an_uncalibrated_camera_of_a_file_is_named_with_file_and_field(tmp_path):
    path = tmp_path / "rig.yaml"
    entry = {"image_size": [4, 3], "K": [[0, 0, 0], [0, 0, 0], [0, 0, 1]], "T_world_cam": [[1, 0, 0, 0], [0, 1, 0, 0]]}
    entry["T_world_cam"] += [[0, 0, 1, 0], [0, 0, 0, 1]]
    path.write_text(yaml.safe_dump({"cameras": {"left": entry}}))
    with pytest.raises(CalibrationError, match=r"rig\.yaml: field 'cameras\.left\.K'"):
        load_rig(path)
