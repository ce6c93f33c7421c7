"""Errors that nobody has foreseen: one line, the details in a file, a status of its own; and verbs that cannot begin."""

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tracker_node.cli._last_resort import ROS_PACKAGES
from tracker_node.cli.main import NODES, main
from tracker_node.cli.nodes import layouts

ADDRESS = "rtsp://user:secret@host/stream"
UNFORESEEN = {
    "value": (lambda: [].index(3), "an error inside tracker_node (ValueError: "),
    "recursion": (lambda: recursive(), "an error inside tracker_node (RecursionError: "),
    "memory": (lambda: bytearray(1 << 62), "out of memory"),
    "module": (lambda: __import__("tracker_node.no_such_module"), "an error inside tracker_node (ModuleNotFoundError: "),
    "library": (lambda: raised(ImportError("libGL.so.1: cannot open")), "an error inside tracker_node (ImportError: libGL"),
    "long": (lambda: raised(ValueError("\n".join(["begin", *["x" * 900], "end"]))), "begin"),
}


def recursive():
    return recursive()


def raised(error: Exception):
    raise error


@pytest.fixture
def said(capsys, monkeypatch, tmp_path):
    """Runs a verb that does what is given in place of its work: status, its one line, and the file that the line names."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def run(work) -> tuple[int, str, str]:
        monkeypatch.setattr(layouts, "run", lambda args: work())
        monkeypatch.setattr(layouts, "add_arguments", lambda parser: parser.add_argument("source"))
        status = main(["layouts", ADDRESS])
        (line,) = capsys.readouterr().err.splitlines()
        named = re.search(r"report it with (\S+)$", line)
        return status, line, Path(named[1]).read_text() if named else ""

    return run


@pytest.mark.parametrize("kind", UNFORESEEN)
def test_an_error_nobody_has_foreseen_is_one_line_a_file_and_status_70(said, kind):
    work, words = UNFORESEEN[kind]
    status, line, details = said(work)
    assert status == 70
    assert line.startswith("tracker_node layouts: error: ") and words in line and len(line) < 600
    assert "Traceback (most recent call last)" in details and "python: " in details and "numpy: " in details
    assert "user:***@host" in details or "//***@host" in details
    assert "secret" not in details and "secret" not in line


def test_without_a_place_for_the_details_the_line_still_comes(said, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "not there"))
    status, line, details = said(lambda: [].index(3))
    assert (status, details) == (70, "")
    assert "its details cannot be written (FileNotFoundError" in line


def test_an_error_in_a_thread_is_one_line_too(said):
    def work() -> int:
        thread = threading.Thread(target=lambda: [].index(3))
        thread.start()
        thread.join()
        return 0

    status, line, details = said(work)
    assert status == 0 and "(ValueError: " in line and "Traceback" in details


def test_a_missing_requirement_is_named_with_the_remedy(said, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    status, line, _ = said(lambda: __import__("trimesh"))
    assert status == 2
    assert "has no package 'trimesh'" in line and "requirements/runtime.txt" in line and sys.executable in line


WITHOUT_ROS = """
import sys
sys.modules.update(dict.fromkeys({packages}))
from tracker_node.cli.main import main
arguments = {{"player": ["bag"], "recorder": ["--all", "--output", "out"], "rectify": ["--cameras", "cam1"]}}
with_model = ("tracker", "compose", "pipeline", "rerun_bridge")
arguments |= {{verb: ["--rig", "rig.yaml", "--model", "model.yaml"] for verb in with_model}}
arguments |= {{verb: ["--rig", "rig.yaml"] for verb in ("camera_ingest", "keypoints")}}
for verb in {verbs}:
    print(verb, main([verb, *arguments[verb]]), flush=True)
"""


def test_verbs_that_need_ros_say_so_where_there_is_none(tmp_path):
    (tmp_path / "rig.yaml").write_text("cameras: {}\n")
    code = WITHOUT_ROS.format(packages=sorted(ROS_PACKAGES), verbs=NODES)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"{verb} 2" for verb in NODES]
    lines = done.stderr.splitlines()
    assert [line.split(":")[0].split()[-1] for line in lines] == list(NODES), done.stderr
    assert all("needs ROS 2" in line and "make setup" in line for line in lines), done.stderr


@pytest.mark.parametrize(("arguments", "own"), [(("--help",), 141), (("export", "--help"), 0), (("layouts", "nonsense"), 2)])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_leaves_is_no_error(arguments, own, unbuffered):
    """`| head` with one that has gone already; unbuffered, argparse ends with its own status."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "tracker_node.cli.main", *arguments]
    errors = subprocess.PIPE if own != 2 else writing  # as by 2>&1
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(command, stdout=writing, stderr=errors, env=environment, timeout=120)
    os.close(writing)
    assert done.returncode in (own, 141)
    assert not done.stderr
