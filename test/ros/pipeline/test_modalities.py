"""What a pipeline has its tracker compare, and whether it starts a detector for that."""

import pytest

from helpers.cameras.two_people import write_recording
from tracker_node.api.recording import recording_of
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders import fetched_files
from tracker_node.loaders.keypoints.table import dump_keypoint_table
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.model.humans.keypoints import COCO_17
from tracker_node.ros import pipeline
from tracker_node.runs import config_file

BOTH = ("region", "keypoints")


@pytest.fixture
def options(tmp_path, monkeypatch):
    """The options with which a pipeline of a person would be run, by its command line."""
    write_recording(tmp_path, 2)

    def of(*arguments: str) -> pipeline.PipelineOptions:
        taken = []

        def take(options):
            taken.append(options)
            raise TrackerError("taken")

        monkeypatch.setattr(pipeline, "run_pipeline", take)
        person = ["--rig", str(tmp_path / "rig.yaml"), "--model", str(tmp_path / "one.yaml")]
        assert main(["pipeline", *person, "--rate", "30", *arguments]) != 0
        return taken[0]

    return of


def found(*_):
    """Weights are there."""


def missing(*_):
    raise TrackerError("no weights here")


@pytest.mark.parametrize(("arguments", "modalities", "detects"), [
    ((), BOTH, True),
    (("--keypoints", "off"), ("region",), False),
    (("--ros-args", "-p", "threads:=1"), BOTH, True),
    (("--ros-args", "-p", "modalities:=[chamfer]"), (), False),  # those of the ROS arguments
    (("--ros-args", "--params-file", "any.yaml"), (), False),
])  # fmt: skip
def test_people_are_compared_by_points_unless_something_else_is_said(options, monkeypatch, arguments, modalities, detects):
    for module in (config_file, fetched_files):
        monkeypatch.setattr(module, "usable_weights", found)
    taken = options(*arguments)
    assert tuple(taken.modalities) == modalities and (taken.detector is not None) == detects


def test_without_a_detector_outlines_are_compared_and_the_reason_is_said(options, monkeypatch, capsys):
    monkeypatch.setattr(config_file, "usable_weights", missing)
    taken = options()
    assert tuple(taken.modalities) == ("region",) and taken.detector is None
    assert "pipeline: outlines alone, without points of people: no weights here" in capsys.readouterr().err


@pytest.mark.parametrize("by_recording", [False, True])
def test_an_own_detector_that_runs_is_compared_by_its_table(options, monkeypatch, tmp_path, capsys, by_recording):
    """Ours is not started, the graph has its points recorded, and offline they are missing."""
    monkeypatch.setattr(config_file, "usable_weights", missing)
    table, recording = tmp_path / "keypoints.yaml", tmp_path / "recording.yaml"
    dump_keypoint_table(COCO_17, table)
    recording.write_text("rig: rig.yaml\nmodel: one.yaml\noutput: run\nkeypoints: {table: keypoints.yaml}\n")
    taken = options(*([str(recording)] if by_recording else ["--keypoints-table", str(table)]))
    assert tuple(taken.modalities) == BOTH and taken.detector is None
    assert taken.body[taken.body.index("--keypoints-table") + 1] == str(table)
    assert "cam1/keypoints:tracker_msgs/msg/Keypoints" in taken.recorded_topics()
    assert main(["track", str(recording), "--output", str(tmp_path / "out")]) == 2
    assert "live, a detector may publish the points" in capsys.readouterr().err
    with pytest.raises(FileFormatError, match=r"keypoints\.table': expected files beside it"):
        recording_of(load_recording(recording))
