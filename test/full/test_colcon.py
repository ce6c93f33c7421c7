"""What colcon installs runs in the environment in use, whatever Python colcon has."""

import shutil
import subprocess
from pathlib import Path

import pytest

from helpers.ros import ros2_env
from helpers.ros.colcon_place import bare_python_with

pytestmark = [pytest.mark.ros, pytest.mark.skipif(bool(ros2_env.missing()), reason=ros2_env.missing())]
ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("tracker_node", "config", "launch", "resource", "setup.py", "setup.cfg", "package.xml", "README.md")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    """A copy of the sources and, in ``bare``, a Python that has colcon and nothing else."""
    folder = tmp_path_factory.mktemp("colcon")
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    (source,) = ros2_env.python().parents[1].glob("lib/python*/site-packages")
    bare = bare_python_with(["colcon-common-extensions", "setuptools"], folder / "bare", source)
    if not list(folder.glob("bare/lib/python*/site-packages/colcon_core")):
        pytest.skip("colcon is not installed beside the ros2 command")
    assert subprocess.run([bare, "-c", "import numpy"], capture_output=True, check=False).returncode != 0
    return folder


@pytest.mark.parametrize("option", ["--merge-install", "--symlink-install"])
def test_executables_have_the_python_of_the_environment(workspace, option):
    python, install = workspace / "bare" / "bin" / "python3", workspace / f"install{option}"
    command = [python, "-m", "colcon", "build", option, "--base-paths", ".", "--packages-select", "tracker_node"]
    command += ["--build-base", f"build{option}", "--install-base", install]
    bare = {"PATH": f"{python.parent}:/usr/bin:/bin", "HOME": str(workspace)}
    done = subprocess.run(command, cwd=workspace, env=bare, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (folder,) = install.rglob("lib/tracker_node")
    names = {path.name for path in folder.iterdir()}
    assert {"tracker_node", "tracker", "keypoints", "camera_ingest", "recorder", "player", "pipeline", "rectify"} <= names
    for name in sorted(names):
        done = subprocess.run([folder / name, "--help"], env=ros2_env.now(), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    command = [folder / "tracker_node", "urdf", ROOT / "config/models/human.yaml"]
    done = subprocess.run(command, env=ros2_env.now(), capture_output=True, text=True, check=False)
    assert "<robot" in done.stdout, done.stderr
