"""What a pipeline has its tracker compare, and whether it starts a detector for that."""

import pytest

from helpers.cameras.two_people import write_recording
from tracker_node.cli.main import main
from tracker_node.errors import TrackerError
from tracker_node.loaders import fetched_files
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
