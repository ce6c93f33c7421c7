"""``benchmark/ros/demo.py``: what counts as an alarm, and none in a run where all is well."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmark.ros.demo import alarms
from helpers.sources.sample import sample_or_skip

BENCHMARK = Path(__file__).resolve().parents[3] / "benchmark"

ALARMS = (
    "[WARN] [1795445293.578718029] [camera_ingest]: quality of service of cam04/camera_info: nothing passes",
    "[ERROR] [1795445293.578718029] [recorder]: /x is not recorded",
    "/lib/numba/core.py:12: NumbaPerformanceWarning: slow",
    "Traceback (most recent call last):",
    "tracker_node pipeline: error: no such file",
)


def test_alarms_are_told_from_what_is_said_by_the_way() -> None:
    quiet = ["[INFO] [1.0] [tracker]: status: TRACKING", "pipeline: 90/100 image sets, 8.8 a second", "wrote out/warning.html"]
    assert alarms([*quiet, *ALARMS]) == list(ALARMS)


@pytest.mark.long
@pytest.mark.parametrize("quick", [True, False])
def test_a_healthy_run_warns_nobody(tmp_path: Path, quick: bool, fresh_domain_id: int) -> None:
    """A rendered clip, and `make demo` itself."""
    if not quick:
        sample_or_skip()
    figures, only = tmp_path / "demo.json", ["--quick"] * quick
    command = [sys.executable, str(BENCHMARK / "ros/demo.py"), *only, "--cache", str(tmp_path), "--json", str(figures)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, env=os.environ)
    assert done.returncode == 0, done.stderr
    assert json.loads(figures.read_text())["metrics"]["demo.warnings"] == 0, done.stderr
