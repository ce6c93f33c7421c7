"""The page of the seven steps: where each stands, its commands, and the job that runs."""

from __future__ import annotations

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
from .jobs import Jobs
from .steps import PERSON, RECORDING, START, Steps

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
