"""Parameters that a command's node has not are refused in one line, with status 2."""

import pytest

from tracker_node.cli.main import main


@pytest.mark.parametrize("verb", ["camera_ingest", "recorder", "rectify"])
def test_unknown_parameters_end_the_command(verb, recording, tmp_path, capsys):
    own = {
        "camera_ingest": ["--rig", str(recording / "rig.yaml")],
        "recorder": ["--output", str(tmp_path / "bag"), "--all"],
        "rectify": ["--cameras", "cam1"],
    }
    assert main([verb, *own[verb], "--ros-args", "-p", "rate:=3.0"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"tracker_node {verb}: error: unknown parameter 'rate'; valid: ") and error.count("\n") == 1
