"""Commands of the program, run one after the other in a process of their own each: with progress, and to be canceled."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ...errors import TrackerError

COMMAND = ("-P", "-m", "tracker_node.cli.main")  # -P: what is installed, not a folder of that name in the current one
_MOST_LINES = 300
_PATIENCE_S = 15.0  # with a command that is to end
_OPTIONAL = ["calibrate", "background"]  # without which a step is done: the tracker learns backgrounds by itself
_NOTE = re.compile(r"^(?:tracker_node [\w -]+: )?(.*: )?note: (.*)")
_SAID = re.compile(r"^tracker_node [\w -]+: (error: )?(.*)")  # what commands say beside their results
_PROGRESS = (re.compile(r": +(\d+)/(\d+) "), re.compile(r", (\d+) of (\d+), "))


class Jobs:
    """One job at a time.

    Parameters
    ----------
    folder : that commands run in.
    ended : called, in a thread, when a job is over.
    """

    def __init__(self, folder: Path, ended: Callable[[], object] = lambda: None):
        self._folder, self._ended = folder, ended
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen[str] | None = None
        self._step, self._command, self._error, self._canceled = "", "", "", False
        self._notes: list[str] = []
        self._lines: deque[str] = deque(maxlen=_MOST_LINES)

    @property
    def running(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def start(self, step: str, commands: Sequence[Sequence[str]], shown: Sequence[str]) -> None:
        """Begin.

        Parameters
        ----------
        step : whose commands they are.
        commands : verb and arguments of each.
        shown : as a user would type them.

        Raises
        ------
        TrackerError : another job is running.
        """
        with self._lock:
            if self.running:
                raise TrackerError(f"'{self._step}' is running: wait for it, or cancel it")
            self._step, self._command, self._error, self._canceled = step, shown[0], "", False
            self._lines.clear()
            self._notes = []
            self._thread = threading.Thread(target=self._run, args=(commands, shown), daemon=True)
            self._thread.start()

    def cancel(self) -> None:
        """End what runs, as Ctrl-C does; what it has written whole stays."""
        with self._lock:  # a command begins before, and is ended, or never
            self._canceled, process, thread = True, self._process, self._thread
        if process is not None and process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(_PATIENCE_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
        if thread is not None:
            thread.join(_PATIENCE_S)

    def facts(self) -> dict[str, Any]:
        """What a page shows of it."""
        lines = list(self._lines)
        progress = next((found for line in reversed(lines) if (found := _progress(line))), None)
        return {
            "step": self._step,
            "running": self.running,
            "command": self._command,
            "lines": lines,
            "progress": progress if self.running else None,
            "error": self._error,
            "notes": list(self._notes),
            "canceled": self._canceled and not self.running,
        }

    def _run(self, commands: Sequence[Sequence[str]], shown: Sequence[str]) -> None:
        for command, text in zip(commands, shown, strict=True):
            self._command = text
            self._lines.append(f"$ {text}")
            if not self._do(command):
                break
        self._ended()

    def _do(self, command: Sequence[str]) -> bool:
        """Whether the command ends well."""
        with self._lock:
            if self._canceled:
                return False
            self._process = subprocess.Popen(
                [sys.executable, *COMMAND, *command],
                cwd=self._folder,
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                start_new_session=True,
            )
        assert self._process.stdout is not None
        said, last = [], ""
        with self._process.stdout as lines:
            for line in map(str.rstrip, lines):
                self._lines.append(line)
                last = line or last
                if note := _NOTE.match(line):
                    self._notes.append((note[1] or "") + note[2])
                elif found := _SAID.match(line):
                    said.append(found)
        status = self._process.wait()
        if status and not self._canceled:
            why = "; ".join([each[2] for each in said if each[1]] or [each[2] for each in said]) or last
            why = why or f"ended with status {status}"
            if list(command[:2]) == _OPTIONAL:
                self._notes.append(why)
            else:
                self._error = why
        return status == 0


def _progress(line: str) -> tuple[int, int] | None:
    for pattern in _PROGRESS:
        if (found := pattern.search(line)) and int(found[2]) > 0:
            return int(found[1]), int(found[2])
    return None
