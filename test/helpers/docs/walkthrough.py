"""Runs the commands of a page of the documentation, one after the other, as they stand there."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from helpers.docs.commands import as_run, parsed, why_not_run
from helpers.docs.given import GIVEN
from helpers.docs.pages import ROOT, Block, Command, blocks_of
from helpers.docs.place import Place
from helpers.studio.studio_process import running_studio
from tracker_node.cli.main import NODES, main

TIMEOUT_S = 600.0
ENDS_BY_ITSELF = ("pipeline",)  # of the nodes


class Walkthrough:
    """Runs commands in a `Place`; what a block has started is ended with it."""

    def __init__(self, place: Place):
        self.place = place
        self.done: list[Command] = []
        self._running: dict[str, ExitStack] = {}
        self._background = ExitStack()
        self._probe = None

    def follow(
        self,
        page: str,
        after: Callable[[Block], None] = lambda block: None,
        of: Callable[[str], bool] = lambda section: True,
    ) -> None:
        """All commands of a page, and its blocks of Python, in the sections ``of`` it; ``after`` is called with every block."""
        section = None
        for block in blocks_of(page):
            if not of(block.section):
                continue
            if block.section != section:
                section = block.section
                self._begin(page, section)
            for command in block.commands:
                self.do(command)
            self._end_all()
            if block.language == "python":
                exec(compile(block.text, page, "exec"), {})
            after(block)

    def close(self) -> None:
        """End what is still running."""
        with self.place.closing, self._background:
            self._end_all()

    def do(self, command: Command) -> None:
        """Run a command, unless it is among those that are not run."""
        if why_not_run(command) is not None:
            return
        words = shlex.split(as_run(command, self.place.values))
        env = dict(self.place.env)
        while re.match(r"[A-Z_]+=", words[0]):
            name, _, value = words.pop(0).partition("=")
            env[name] = value
        program, *arguments = words
        run = {
            "cd": lambda: os.chdir(arguments[0]),
            "source": lambda: _activate(Path(arguments[0]), env),
            "python": lambda: _shell([sys.executable, str(ROOT / arguments[0]), *arguments[1:]], env),
            "ros2": lambda: self._ask(arguments),
            "tracker_node": lambda: self._run_verb(arguments, env),
        }.get(program)
        assert run is not None, f"{command}: neither run nor listed in test/helpers/docs/commands.py"
        run()
        self.done.append(command)

    def _begin(self, page: str, section: str) -> None:
        """Lay what a section begins with, in an empty folder; without an entry it goes on with what is there."""
        if (page, section) not in GIVEN:
            return
        self._background.close()
        self.place.empty()
        givens, background = GIVEN[page, section]
        for give in givens:
            give(self.place)
        for line in background:
            verb, *arguments = line.split()
            self._background.enter_context(self._node(verb, arguments, self.place.env))

    def _run_verb(self, arguments: list[str], env: dict[str, str]) -> None:
        verb, *rest = arguments
        if verb in NODES and verb not in ENDS_BY_ITSELF:
            from helpers.docs.graph import name_of

            self._end(name_of(verb, rest))
            written = _room_for(arguments)
            self._start(name_of(verb, rest), self._node(verb, rest, env))
        elif verb == "studio":
            self._end(verb)
            written = []
            studio = self._start(verb, running_studio(*rest, env=env))
            assert urllib.request.urlopen(studio.url, timeout=60.0).status == 200
        else:
            written = _room_for(arguments)
            if verb in NODES:
                _shell([sys.executable, "-m", "tracker_node.cli.main", *arguments], env)
            else:
                assert main(arguments) == 0, arguments
        assert all(path.exists() for path in written), (arguments, written)

    def _node(self, verb: str, arguments: list[str], env: dict[str, str]):
        from helpers.docs.graph import running_node

        return running_node(self._ros(), verb, arguments, env)

    def _ask(self, words: list[str]) -> None:
        from helpers.docs.graph import ask

        ask(self._ros(), words)

    def _ros(self):
        """A node of ours that watches and asks; made when the first is needed."""
        if self._probe is None:
            pytest.importorskip("rclpy", reason="ROS is not installed")
            pytest.importorskip("tracker_msgs", reason="the interface package is not installed")
            from helpers.ros.graph import Probe, remove_left_segments, ros_context, shared_memory_files

            self.place.closing.callback(remove_left_segments, shared_memory_files())
            self.place.closing.enter_context(ros_context())
            self._probe = Probe()
            self.place.closing.callback(self._probe.close)
        return self._probe

    def _start(self, name: str, context):
        self._running[name] = ExitStack()
        return self._running[name].enter_context(context)

    def _end(self, name: str) -> None:
        if name in self._running:
            self._running.pop(name).close()

    def _end_all(self) -> None:
        """Every one of them, the latest first, even if one does not end well."""
        with ExitStack() as ending:
            while self._running:
                ending.callback(self._running.pop(next(iter(self._running))).close)


def _activate(script: Path, env: dict[str, str]) -> None:
    """Tests may run in no environment at all, as those of colcon do; in one, the command is there once it is activated."""
    if script.exists():
        _shell(["bash", "-c", f"source {shlex.quote(str(script))} && command -v tracker_node"], env)


def _shell(command: list[str], env: dict[str, str]) -> None:
    """A process that has to end well."""
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False, env={**os.environ, **env}
    )  # fmt: skip
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}"


def _room_for(arguments: list[str]) -> list[Path]:
    """What a command says that it writes; what an example above has left there is taken away, unless it is read, too."""
    given = parsed(arguments)
    names = ["output", "record", *(["bag"] if arguments[0] == "pipeline" else [])]
    written = [Path(value) for name in names if (value := getattr(given, name, None)) is not None]
    for path in written:
        if sum(Path(word).is_relative_to(path) for word in arguments) > 1:
            continue
        if path.is_dir():
            shutil.rmtree(path)
        for beside in (path, path.with_suffix(".html"), path.with_suffix(".json")):
            beside.unlink(missing_ok=True)
    return written
