"""Verbs as child processes run what is installed, wherever they are called."""

import pytest

from helpers.ros.processes import wait_until
from tracker_node.ros.child_process import Child


@pytest.mark.long
def test_a_folder_of_the_same_name_here_is_not_run(tmp_path, monkeypatch):
    (tmp_path / "tracker_node").mkdir()
    (tmp_path / "tracker_node/__init__.py").write_text("raise SystemExit('the wrong package')\n")
    monkeypatch.chdir(tmp_path)
    lines: list[str] = []
    child = Child(["--help"], lines.append)
    wait_until(lambda: child.returncode is not None)
    assert child.end(0.0) == 0
    assert lines[0].startswith("usage: tracker_node")
