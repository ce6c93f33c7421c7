"""What ``run.json`` says of how a run was asked for."""

import argparse
import math
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest

from tracker_node.cli.arguments.runs import end_of_live_run, named_options, start_of_live_run
from tracker_node.runs.config_file import dump_config
from tracker_node.tracking.config import TrackerConfig, flatten
from tracker_node.tracking.estimate import Status


def asked(**options):
    files = dict.fromkeys(("rig", "model", "initial_state", "occluders", "config"))
    return argparse.Namespace(**{**files, "ros_args": [], **options})


def test_files_and_sources_have_their_whole_paths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    args = asked(rig="rig.yaml", config=Path("sub/../t.yaml"), source=[("cam01", "a.mp4"), ("cam02", "rtsp://me:secret@host/b")])
    options = named_options(args)
    assert options["rig"] == str(tmp_path / "rig.yaml") and options["config"] == str(tmp_path / "t.yaml")
    assert options["model"] is None and options["occluders"] is None
    assert options["source"][0] == ["cam01", str(tmp_path / "a.mp4")]
    assert options["source"][1][0] == "cam02" and "secret" not in options["source"][1][1] and "host/b" in options["source"][1][1]


def test_values_are_those_that_json_can_hold():
    options = named_options(asked(loop=math.inf, rate=25.0, resize=(64, 48), bag=Path("/a/../b"), _private=1, _also=None))
    assert options["loop"] == "all" and options["rate"] == 25.0 and options["resize"] == [64, 48] and options["bag"] == "/b"
    assert not any(name.startswith("_") for name in options) and "source" not in options
    assert named_options(asked(source=None))["source"] is None
    assert named_options(asked(source=[]))["source"] == []
    assert named_options(asked(loop=-math.inf))["loop"] == -math.inf


def test_a_live_run_begins_with_options_and_parameters(tmp_path):
    start = start_of_live_run(asked(bag="out/bag", start=3), 12)
    assert start["expected_image_sets"] == 12 and start["options"]["start"] == 3 and "bag" not in start["options"]
    assert start["parameters"] == flatten(TrackerConfig())
    assert {"versions", "cpu", "command"} <= set(start) and start["versions"] and start["command"]
    some = next(name for name, value in flatten(TrackerConfig()).items() if isinstance(value, bool))
    from tracker_node.tracking.config import from_dict

    other = from_dict({some: not flatten(TrackerConfig())[some]}, "test")
    dump_config(other, tmp_path / "t.yaml")
    start = start_of_live_run(asked(config=tmp_path / "t.yaml"), None)
    assert start["expected_image_sets"] is None and start["parameters"] == flatten(other)


def test_parameters_that_the_nodes_are_given_otherwise_are_not_told():
    assert "parameters" not in start_of_live_run(asked(ros_args=["--ros-args", "-p", "a:=1"]), None)


@pytest.mark.parametrize("lost", [0, 2])
def test_a_live_run_ends_with_its_counts(lost):
    statuses = Counter({Status.TRACKING: 5, Status.LOST: lost, Status.DEGRADED: 1})
    found = end_of_live_run({"expected_image_sets": 9, "cpu": "x"}, SimpleNamespace(sets=8, statuses=statuses))
    assert found["image_sets"] == 8 and found["lost_sets"] == lost
    assert found["expected_image_sets"] == 9 and found["cpu"] == "x"
    assert set(found["status_counts"]) == {status.name for status in Status}
    assert found["status_counts"]["TRACKING"] == 5 and found["status_counts"]["LOST"] == lost
    assert found["status_counts"]["DEGRADED"] == 1 and found["status_counts"]["INITIALIZING"] == 0
