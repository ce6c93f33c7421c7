"""The studio's command: what it prints, refuses, and how it ends."""

import os
import signal
import socket
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from helpers.studio.studio_process import running_studio
from tracker_node.cli.main import main

# A browser that says what it was asked to open, and with what rights that lies there
BROWSER = """#!{python}
import os, stat, sys, pathlib
url = sys.argv[1]
path = pathlib.Path(url.removeprefix("file://"))
pathlib.Path("{said}").write_text(url + "\\n" + oct(stat.S_IMODE(path.parent.stat().st_mode)) + "\\n" + path.read_text())
"""


def test_mistakes_are_one_line(tmp_path, capsys):
    for arguments, said in (
        (["--port", "70000"], "--port"),
        (["--rig", str(tmp_path / "none.yaml")], "none.yaml"),
        (["--initial-state", str(tmp_path / "start.yaml")], "--model"),
    ):
        assert main(["studio", "--no-browser", *arguments]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1


@pytest.mark.parametrize("package", ["starlette", "uvicorn", "websockets"])
def test_without_the_packages_of_its_extra_it_says_what_installs_them(package, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["studio", "--no-browser"]) == 2
    error = capsys.readouterr().err
    assert f"{package} is not installed; pip install 'tracker_node[studio]'" in error and error.count("\n") == 1


def test_a_port_that_is_taken_is_named(capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["studio", "--no-browser", "--port", str(port)]) == 2
    assert f"port {port}" in capsys.readouterr().err


def test_it_listens_on_the_loopback_only():
    with running_studio() as studio:
        port = int(studio.origin.rsplit(":", 1)[1])
        lines = Path(f"/proc/{studio.pid}/net/tcp").read_text().splitlines()[1:]
        bound = {line.split()[1] for line in lines if int(line.split()[1].split(":")[1], 16) == port and line.split()[3] == "0A"}
        assert bound == {f"0100007F:{port:04X}"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_cleanly(number):
    command = [sys.executable, "-m", "tracker_node.cli.main", "studio", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert "http://127.0.0.1:" in process.stdout.readline()
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0 and said == ""


def test_the_browser_is_not_told_the_token_on_its_command_line(tmp_path):
    browser, said = tmp_path / "browser", tmp_path / "said"
    browser.write_text(BROWSER.format(python=sys.executable, said=said))
    browser.chmod(0o755)
    command = [sys.executable, "-m", "tracker_node.cli.main", "studio"]
    environment = {**os.environ, "BROWSER": str(browser)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        url = process.stdout.readline().split()[-1]
        end = time.monotonic() + 60
        while not said.exists() or not said.read_text().endswith("</title>"):
            assert time.monotonic() < end, "no browser was opened"
            time.sleep(0.05)
        opened, mode, page = said.read_text().split("\n", 2)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert opened.startswith("file://") and "token" not in opened and url in page.replace("&amp;", "&")
    assert not int(mode, 8) & (stat.S_IRWXG | stat.S_IRWXO)
    assert not Path(opened.removeprefix("file://")).exists()  # it does not outlive the studio
