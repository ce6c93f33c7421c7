"""The articulated benchmark runs from end to end, without the captured clips too, and says what it has not measured."""

import json
import os
import subprocess
import sys

import cv2
import pytest


@pytest.mark.long
def test_the_procedural_motion_stands_in_for_the_clips(repository, tmp_path):
    command = [sys.executable, repository / "benchmark/color/articulated.py", "--quick", "--max-sets", "2"]
    command += ["--cache", tmp_path, "--pictures", tmp_path, "--json", tmp_path / "figures.json"]
    environment = {name: value for name, value in os.environ.items() if name != "TRACKER_SHARED_DATA"}
    run = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr
    assert "NOT MEASURED: walk." in run.stderr
    figures = json.loads((tmp_path / "figures.json").read_text())
    figures = figures.get("metrics", figures)
    assert figures["articulated.sets"] == 2 and figures["articulated.lost_limbs"] == 0
    assert 0.0 < figures["articulated.joint_error_mm"] < figures["articulated.joint_error_raw_mm"] < 80.0
    assert figures["articulated.swing.joint_error_mm"] == figures["articulated.joint_error_mm"]
    picture = cv2.imread(str(tmp_path / "articulated_swing.png"))
    assert picture.shape == (2 * 480, 4 * 640, 3)
    through = picture[480:]
    assert 0.005 < (through.max(axis=2) > 40).mean() < 0.2  # black but for the body
