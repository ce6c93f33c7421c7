"""With the ros2 command of TRACKER_ROS2_ENV, and what only a full installation has: ros2 bag, RViz, robot_state_publisher.

``make test-ros``; what is not installed is skipped by its name. The launch files are run in test_launch_files.py.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.ros import ros2_env

pytestmark = pytest.mark.ros
ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 120.0
COMPILING_S = 600.0  # the first run from an empty cache


def environment() -> dict[str, str]:
    return dict(os.environ) if ros2_env.missing() else ros2_env.now()


def needed(program: str) -> str:
    path = shutil.which(program, path=environment()["PATH"])
    if path is None:
        pytest.skip(f"{program} is not installed")
    return path


def ros2(*arguments: str | Path, timeout_s: float = TIMEOUT_S) -> str:
    """What a command of ros2 prints; it has to end well."""
    run = [needed("ros2"), *map(str, arguments)]
    done = subprocess.run(run, env=environment(), capture_output=True, text=True, timeout=timeout_s, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def needed_verb(verb: str) -> None:
    verbs = ros2("--help")
    if not re.search(rf"^\s+{verb} ", verbs, re.MULTILINE):
        pytest.skip(f"ros2 {verb} is not installed")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """A bag of a short run, made offline."""
    from helpers.cameras.small_clip import make_clip

    needed_verb("bag")
    folder = tmp_path_factory.mktemp("full")
    clip = make_clip(folder / "clip", n_images=6)
    run = [sys.executable, "-m", "tracker_node.cli.main", "track", *clip.arguments(), "--output", str(folder / "run")]
    subprocess.run(run, check=True, timeout=COMPILING_S)
    return folder


def test_executables_and_interfaces_are_found():
    names = set(ros2("pkg", "executables", "tracker_node").split())
    assert {"tracker", "camera_ingest", "compose", "recorder", "player", "pipeline"} <= names
    assert "float64[] covariance" in ros2("interface", "show", "tracker_msgs/msg/StateCovariance")
    assert "--initial-state" in ros2("run", "tracker_node", "tracker", "--help")


def test_the_standard_player_plays_our_bag(recorded):
    assert "/tracker/state" in ros2("bag", "info", recorded / "run" / "bag")
    ros2("bag", "play", recorded / "run" / "bag", "--rate", "10")


def test_robot_state_publisher_takes_the_description(tmp_path):
    """It ends with an error within a moment where it does not."""
    prefix = [needed("ros2"), "pkg", "prefix", "robot_state_publisher"]
    if subprocess.run(prefix, env=environment(), capture_output=True, check=False).returncode:
        pytest.skip("robot_state_publisher is not installed")
    from tracker_node.loaders.model.urdf_writer import urdf_of
    from tracker_node.model.humans.human import human_model

    parameters = tmp_path / "description.yaml"
    text = "\n".join(" " * 8 + line for line in urdf_of(human_model()).splitlines())
    parameters.write_text(f"/**:\n  ros__parameters:\n    robot_description: |\n{text}\n")
    run = [prefix[0], "run", "robot_state_publisher", "robot_state_publisher", "--ros-args", "--params-file", str(parameters)]
    with pytest.raises(subprocess.TimeoutExpired) as running:
        subprocess.run(run, env=environment(), capture_output=True, timeout=10.0, check=False)
    assert b"Error" not in (running.value.stderr or b"") + (running.value.stdout or b"")


def test_rviz_loads_the_layout():
    """RViz says which displays and fields it does not know; it runs until it is ended."""
    offscreen = {**environment(), "QT_QPA_PLATFORM": "offscreen"}
    run = [needed("rviz2"), "-d", str(ROOT / "config/rviz/tracker.rviz")]
    with pytest.raises(subprocess.TimeoutExpired) as running:
        subprocess.run(run, capture_output=True, timeout=20.0, env=offscreen, check=False)
    said = ((running.value.stderr or b"") + (running.value.stdout or b"")).decode()
    assert "could not be loaded" not in said and "does not exist" not in said, said


def test_images_of_a_kernel_camera(tmp_path):
    """A real device, or the kernel's own test camera: sudo modprobe vivid."""
    devices = sorted(Path("/dev").glob("video*"))
    if not devices:
        pytest.skip("no /dev/video*: sudo modprobe vivid makes one")
    needed_verb("bag")
    source, output = f"cam=v4l2:{devices[0]}", tmp_path / "bag"
    run = [sys.executable, "-m", "tracker_node.cli.main", "camera_ingest", "--source", source, "--record", str(output)]
    with subprocess.Popen(run) as ingest:
        with pytest.raises(subprocess.TimeoutExpired):
            ingest.wait(timeout=15.0)
        ingest.send_signal(signal.SIGINT)
        assert ingest.wait(timeout=30.0) == 0
    info = ros2("bag", "info", output)
    assert re.search(r"/cam/image_raw.*Count: [1-9]", info), info
