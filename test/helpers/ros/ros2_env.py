"""The real ros2 command and launch, in an environment of their own that TRACKER_ROS2_ENV names, with this package installed."""

import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

VARIABLE = "TRACKER_ROS2_ENV"
OURS = ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "PYTHONPATH", "AMENT_PREFIX_PATH", "VIRTUAL_ENV", "PYTHONHOME")


def missing() -> str:
    """Why it is not there; empty if it is."""
    folder = os.environ.get(VARIABLE)
    if not folder:
        return f"{VARIABLE} does not name the folder of an installation of the ros2 command"
    return "" if (Path(folder) / "env.sh").is_file() else f"{VARIABLE}: no env.sh in {folder}"


@cache
def environment() -> dict[str, str]:
    """Its environment variables; nothing of those that lead to the packages of this Python."""
    bare = {key: value for key, value in os.environ.items() if key not in OURS}
    command = ["bash", "-c", 'source "$0/env.sh" && env -0', os.environ[VARIABLE]]
    said = subprocess.run(command, env=bare, check=True, capture_output=True, text=True).stdout
    return dict(item.split("=", 1) for item in said.split("\0") if "=" in item)


def now(**changes: str) -> dict[str, str]:
    """The same with the graph of this test."""
    graph = {key: value for key, value in os.environ.items() if key.startswith("ROS_")}
    return {**environment(), **graph, **changes}


def python() -> Path:
    """Its interpreter."""
    return Path(str(shutil.which("python3", path=environment()["PATH"])))
