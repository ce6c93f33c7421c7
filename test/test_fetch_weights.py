"""Setting up goes on without the weights of the network, and says what is missing."""

import os
import subprocess
import sys
from pathlib import Path


def test_without_network_it_says_where_the_weights_belong_and_fails_nothing(repository: Path, tmp_path: Path) -> None:
    nowhere = {"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": "/dev/null", "PIP_FIND_LINKS": "", "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, str(repository / "tools/fetch_weights.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env={**os.environ, **nowhere})
    assert done.returncode == 0 and "Traceback" not in done.stderr
    assert done.stdout.startswith("Not set up: points of people") and done.stdout.count("\n") == 1
    assert "mediapipe==0.10.9" in done.stdout and f"{tmp_path}/tracker_node" in done.stdout
