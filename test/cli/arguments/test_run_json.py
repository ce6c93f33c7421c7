"""What ``run.json`` says of how a run was asked for."""

import argparse
import math
from pathlib import Path

from tracker_node.cli.arguments.run_images import named_options, whole_name


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


def test_a_body_of_the_package_is_its_name_unless_there_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert named_options(asked(model="human"))["model"] == "human" and whole_name("gait_human") == "gait_human"
    (tmp_path / "human").touch()
    assert named_options(asked(model="human"))["model"] == whole_name("human") == str(tmp_path / "human")


def test_values_are_those_that_json_can_hold():
    options = named_options(asked(loop=math.inf, rate=25.0, resize=(64, 48), bag=Path("/a/../b"), _private=1, _also=None))
    assert options["loop"] == "all" and options["rate"] == 25.0 and options["resize"] == [64, 48] and options["bag"] == "/b"
    assert not any(name.startswith("_") for name in options) and "source" not in options
    assert named_options(asked(source=None))["source"] is None
    assert named_options(asked(source=[]))["source"] == []
    assert named_options(asked(loop=-math.inf))["loop"] == -math.inf
