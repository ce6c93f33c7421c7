"""The page of the seven steps: where each stands, its commands, and the job that runs.

Commands are run one after the other, in a process of their own each: with progress, and to be canceled.
"""

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

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import BaseRoute, Route

from ...errors import TrackerError
from ...loaders.file_model import FileModel
from ..endpoints import get, post
from ..session import StudioSession
from .steps import PERSON, RECORDING, START, Steps

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


# A report has its scripts and styles within: it may run them, apart from the studio and its cookie.
_REPORT_POLICY = (
    "sandbox allow-scripts allow-popups; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline';"
    " img-src data: blob:; font-src data:; frame-ancestors 'none'"
)


class AskedStep(FileModel):
    """A step, how it is to be done, and what its fields say."""

    step: str
    way: str
    values: dict[str, str] = Field(default_factory=dict)


class Nothing(FileModel):
    """No more than that it is asked for."""


class WizardPage:
    """What the page asks for, each answer as plain values.

    Parameters
    ----------
    session : that names the folder.
    reopen : called when files have changed that other pages show, or, with False, may have.
    """

    def __init__(self, session: StudioSession, reopen: Callable[[bool], object]):
        self._folder, self._reopen = session.files.new, reopen
        self._jobs = None if self._folder is None else Jobs(self._folder, lambda: reopen(True))
        if self._jobs is not None:
            session.closing.callback(self._jobs.cancel)

    def _needed(self) -> tuple[Path, Jobs]:
        if self._folder is None or self._jobs is None:
            raise TrackerError("this page needs the folder of a recording: start with --new FOLDER")
        return self._folder, self._jobs

    def steps(self) -> dict[str, Any]:
        """All steps, and the job; somebody may have put files into the folder since."""
        folder, jobs = self._needed()
        self._reopen(False)
        return {"folder": str(folder), "steps": [step.facts() for step in Steps(folder).all()], "job": jobs.facts()}

    def job(self) -> dict[str, Any]:
        """The job, for a page that waits."""
        return self._needed()[1].facts()

    def plan(self, asked: AskedStep) -> dict[str, Any]:
        """The command lines of a step, or what is missing: a page asks while its fields are being filled in."""
        steps = Steps(self._needed()[0])
        try:
            return {"commands": steps.shown(steps.commands(asked.step, asked.way, asked.values)), "missing": ""}
        except TrackerError as error:
            return {"commands": [], "missing": str(error)}

    def start(self, asked: AskedStep) -> dict[str, Any]:
        """Begin a step."""
        folder, jobs = self._needed()
        steps = Steps(folder)
        commands = steps.commands(asked.step, asked.way, asked.values)
        jobs.start(asked.step, commands, steps.shown(commands))
        return jobs.facts()

    def cancel(self, asked: Nothing) -> dict[str, Any]:
        """End what runs."""
        jobs = self._needed()[1]
        jobs.cancel()
        return jobs.facts()

    def file(self, name: str) -> Path:
        """A file that a step has written, to be looked at."""
        folder, _ = self._needed()
        known = [file for step in Steps(folder).all() for file in step.files]
        path = folder / name
        if name not in known or not path.resolve().is_relative_to(folder.resolve()):
            raise TrackerError(f"{name}: expected a file of a step, one of {', '.join(known) or 'none yet'}")
        return path


def routes(session: StudioSession, reopen: Callable[[bool], object]) -> Sequence[BaseRoute]:
    """Below ``/api/wizard/``.

    Parameters
    ----------
    session, reopen : see `WizardPage`.

    Returns
    -------
    Of the page.
    """
    page = WizardPage(session, reopen)

    async def file(request: Request) -> Response:
        path = await run_in_threadpool(page.file, request.path_params["name"])
        headers = {"Content-Security-Policy": _REPORT_POLICY} if path.suffix == ".html" else {}
        return FileResponse(path, headers={**headers, "Cache-Control": "no-store"})

    return [
        get("/api/wizard/steps", page.steps),
        get("/api/wizard/job", page.job),
        post("/api/wizard/plan", AskedStep, page.plan),
        post("/api/wizard/start", AskedStep, page.start),
        post("/api/wizard/cancel", Nothing, page.cancel),
        Route("/api/wizard/file/{name:path}", file),
    ]


def files_of(folder: Path) -> dict[str, Path]:
    """What the other pages show of a recording's folder, by the names of `StudioFiles`; only what is there."""
    steps = Steps(folder)
    rig = steps.current_rig()
    found = {"rig": rig, "model": PERSON, "config": "tracker.yaml", "initial_state": START, "run": steps.current_run(),
             "control_points": steps.known_places()}  # fmt: skip
    there = {name: folder / file for name, file in found.items() if file is not None and (folder / file).exists()}
    if "model" not in there:
        there.pop("initial_state", None)
    if not (folder / RECORDING).exists():
        there.pop("config", None)
    if not (folder / steps.current_run() / "run.json").exists():
        there.pop("run", None)
    return there
