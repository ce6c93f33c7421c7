"""One trial tracked and reviewed, by whichever process is told to; results appear whole or not at all."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import socket
import time
import traceback
import uuid
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from glob import glob
from pathlib import Path
from typing import Any

import numpy as np

from ..api.recording import recording_of
from ..errors import FileFormatError, TrackerError
from ..evaluation.evaluate import EvaluationOptions
from ..evaluation.masks.reference import load_reference_masks
from ..evaluation.report.builder import ReportOptions, write_report
from ..evaluation.report.kinematics import ranges_of
from ..evaluation.report.summary import parse_target
from ..evaluation.review import Review
from ..evaluation.run_review import RunFiles, check_evaluation, review_run, unobservable_text
from ..loaders.json_values import finite, read_json
from ..loaders.recording_yaml import FILES, RecordingFile
from ..loaders.whole_file import write_whole
from ..runs.offline import OfflineRun, Recording, run_together
from ..tracking.estimate import TrackEstimate, known_sets
from ..version import __version__

OUTCOME = "trial.json"
OWN = ".batch"  # folder of what the batch needs itself
TOKEN, PROGRESS, DRAFTS, FAILED = f"{OWN}/token", f"{OWN}/progress", f"{OWN}/drafts", "failed"
TRACKED, FAILED_STATE = "tracked", "failed"
_PROGRESS_S = 0.5
_PICTURES = 4
_OLD = ".old"


@dataclass(frozen=True)
class Job:
    """What a worker needs to track a trial.

    Attributes
    ----------
    name, subject, recording : of the trial.
    inputs : digest of all that the trial is made from.
    output : folder of the batch, seen from every worker at the same path.
    token : content of its `TOKEN`, by which a worker knows that it sees the same folder.
    threads : of the tracker; None: as its parameters say.
    version : of this package, the same on all workers.
    """

    name: str
    subject: str
    recording: RecordingFile
    inputs: str
    output: str
    token: str
    threads: int | None = None
    version: str = __version__


@dataclass(frozen=True)
class Outcome:
    """What became of a trial.

    Attributes
    ----------
    state : `TRACKED` or `FAILED_STATE`.
    reason, details : why it failed, in a sentence, and for whoever looks closer.
    problems : sentences on what may have made figures worse: cameras that are missing, break off or contradict others.
    notes : sentences on what is usual and worth knowing.
    by_body : of several bodies, name -> its part of ``status_counts``.
    metrics : of `Review.metrics`, without the run's name; of several bodies with the body's, ``anna.mpjpe_mm``.
    ranges : name of a joint's angle, as in the trial's own report -> lowest and highest value, degrees or meters.
    """

    name: str
    subject: str
    state: str
    reason: str = ""
    details: str = ""
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    image_sets: int = 0
    status_counts: Mapping[str, int] = field(default_factory=dict)
    by_body: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    metrics: Mapping[str, float | int | None] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    wall_s: float = 0.0
    inputs: str = ""
    batch: str = ""  # token of the call that has made it
    version: str = ""
    host: str = ""

    @property
    def is_doubtful(self) -> bool:
        """Whether it was tracked, and somebody should look at it: it has problems, or its body was LOST."""
        return self.state == TRACKED and bool(self.problems or self.status_counts.get("LOST"))


def run_trial(job: Job) -> Outcome:
    """Track a trial, review it, and put its results into place.

    Parameters
    ----------
    job : the trial.

    Returns
    -------
    What became of it; whatever goes wrong is said there and raises nothing.
    """
    began = time.monotonic()
    made_by: dict[str, Any] = {"inputs": job.inputs, "batch": job.token, "version": __version__, "host": socket.gethostname()}
    try:
        _check_place(job)
        draft = Path(job.output) / DRAFTS / f"{job.name}.{uuid.uuid4().hex}"
        try:
            outcome = replace(_tracked(job, draft), wall_s=time.monotonic() - began, **made_by)
            write_whole(draft / OUTCOME, json.dumps(asdict(outcome), indent=1, default=str) + "\n")
            _put(draft, Path(job.output) / job.name, job.token)
            return outcome
        finally:
            shutil.rmtree(draft, ignore_errors=True)
            (Path(job.output) / PROGRESS / job.name).unlink(missing_ok=True)
    except TrackerError as error:
        reason, details = str(error), ""
    except Exception as error:  # of one trial; the others go on
        reason, details = f"unexpected {type(error).__name__}: {error}", traceback.format_exc()
    return Outcome(job.name, job.subject, FAILED_STATE, reason, details, wall_s=time.monotonic() - began, **made_by)


def read_outcome(folder: Path) -> Outcome | None:
    """What an earlier call has left in a trial's folder; None where there is nothing of a batch."""
    if not (folder / OUTCOME).is_file():
        return None
    try:
        values = read_json(folder / OUTCOME)
        known = {entry.name for entry in fields(Outcome)}
        return Outcome(**{name: value for name, value in values.items() if name in known})
    except (FileFormatError, AttributeError, TypeError):
        return None


def inputs_of(file: RecordingFile) -> str:
    """Digest of all that a trial is made from: what it says, the content of small files, size and time of large ones.

    Raises
    ------
    TrackerError, OSError : of a file that is wrong or missing.
    """
    found = hashlib.sha256()
    for one in file.each().values():
        _add_inputs(one, recording_of(one), found)
    return found.hexdigest()


def _add_inputs(file: RecordingFile, recording: Recording, found: Any) -> None:
    found.update(file.model_dump_json(exclude={"output"}).encode())
    for name in FILES:
        if getattr(file, name):
            found.update(Path(getattr(file, name)).read_bytes())
    named = [(camera.source, camera.stamp_file, camera.background) for camera in recording.rig]
    large = [str(name) for names in named for name in names if name]
    large += [name for name in (file.keypoints.files, file.keypoints.table, file.keypoints.weights) if name]
    large += [file.joint_states.file] if file.joint_states else []
    large += [] if file.evaluate is None else [*file.evaluate.truth, *([file.evaluate.masks] if file.evaluate.masks else [])]
    for source in large:
        found.update(f"{source} {_stamp_of(Path(source))}\n".encode())


def _stamp_of(path: Path) -> str:
    """What changes when a file changes, or files are put into a folder or a pattern."""
    pattern = re.sub(r"%0?\d*d", "*", str(path))
    files = [path] if path.is_file() else sorted(path.glob("*")) if path.is_dir() else sorted(map(Path, glob(pattern)))
    return " ".join(f"{status.st_size}:{status.st_mtime_ns}" for status in (file.stat() for file in files if file.is_file()))


def _check_place(job: Job) -> None:
    """Raises TrackerError where this worker cannot do the batch's work."""
    host, token = socket.gethostname(), Path(job.output) / TOKEN
    if __version__ != job.version:
        raise TrackerError(f"worker {host} has version {__version__} of tracker_node, expected {job.version}")
    if not token.is_file():
        missing = f"worker {host} does not see {job.output}"
        raise TrackerError(f"{missing}: share this folder, and those of the images, at the same path")
    if token.read_text(encoding="utf-8").strip() != job.token:
        raise TrackerError(f"worker {host} sees another folder as {job.output} than the one that the batch writes to")


def _tracked(job: Job, draft: Path) -> Outcome:
    bodies, runs = job.recording.each(), {}
    for body, file in bodies.items():
        recording = recording_of(file)
        if file.evaluate is not None:
            check_evaluation(f"trial {job.name}", file.evaluate, recording.model)
        if job.threads is not None:
            recording = replace(recording, config=replace(recording.config, threads=job.threads))
        if job.threads == 1:  # there is a worker for each processor
            recording = replace(recording, images=replace(recording.images, threads=1, ahead=False))
        runs[body] = OfflineRun(**vars(recording), asked=recording.named_options())
    told: list[str] = []
    summaries = run_together(runs, {body: draft / body for body in bodies}, _progress(job), told.append)
    problems = [sentence for summary in summaries.values() for sentence in summary["errors"]]
    notes = [sentence for summary in summaries.values() for sentence in [*summary["notes"], *unobservable_text(summary)]]
    if not any(summary["image_sets"] for summary in summaries.values()):
        raise TrackerError("; ".join(dict.fromkeys([*told, *problems])) or "no image set was formed from the images")
    metrics: dict[str, float | int | None] = {}
    ranges: dict[str, tuple[float, float]] = {}
    counts: Counter[str] = Counter()
    for body, file in bodies.items():
        summary, of = summaries[body], f"{body}." if body else ""
        counts.update(summary["status_counts"])
        if not any(count for name, count in summary["status_counts"].items() if name != "INITIALIZING"):
            lacking = f"{body or 'the body'} was not found in {summary['image_sets']} image sets: {summary['reason']}"
            if all(name == "INITIALIZING" for each in summaries.values() for name, n in each["status_counts"].items() if n):
                raise TrackerError(lacking)
            problems.append(lacking)
            continue
        if not known_sets(summary["status_counts"]):
            problems.append(f"{body or 'the body'} is LOST throughout, mostly: {summary['reason']}")
        found = _reviewed(job, file, draft, body)
        metrics |= {of + key.removeprefix(f"{found.name}."): finite(value) for key, value in found.metrics().items()}
        ranges |= {of + name: ends for name, ends in _ranges(found).items()}
        new = [one for one in found.problems if one not in notes and not any(_core(one) in known for known in problems)]
        problems += [f"{body}: {sentence}" if body else sentence for sentence in new]
    by_body = {body: summaries[body]["status_counts"] for body in bodies if body}
    return Outcome(
        job.name, job.subject, TRACKED, problems=tuple(dict.fromkeys(problems)), notes=tuple(dict.fromkeys(notes)),
        image_sets=max(summary["image_sets"] for summary in summaries.values()),
        status_counts=dict(counts), by_body=by_body, metrics=metrics, ranges=ranges,
    )  # fmt: skip


def _core(sentence: str) -> str:
    """An error without the words around it: the run, its review and the images say the same one."""
    return sentence.removeprefix("The run met an error: ").rstrip(".")


def _progress(job: Job) -> Callable[[int, int | None, TrackEstimate], None]:
    """Notes how far a trial is where the batch looks for it, now and then."""
    place, due = Path(job.output) / PROGRESS / job.name, [0.0]

    def note(done: int, expected: int | None, estimate: TrackEstimate) -> None:
        now = time.monotonic()
        if now >= due[0]:
            due[0] = now + _PROGRESS_S
            place.write_text(f"{done} {expected or 0}", encoding="utf-8")

    return note


def _reviewed(job: Job, recording: RecordingFile, folder: Path, body: str) -> Review:
    """The run against truth, where the trial names any, with a report of its own then."""
    entry, name, draft = recording.evaluate, job.name, folder / body
    if entry is None:
        return review_run(RunFiles(str(draft), pictures=0, options=EvaluationOptions(name)), _nothing)
    lag = None if entry.lag == "auto" else float(entry.lag)
    options = EvaluationOptions(name, lag, entry.align, entry.image_sets)
    masks = load_reference_masks(entry.masks) if entry.masks else {}
    files = RunFiles(
        str(draft), rig=recording.rig, truth=entry.truth, y_up=entry.y_up, masks=masks, pictures=_PICTURES, options=options
    )
    found = review_run(files, _nothing)
    found = replace(found, sources={**found.sources, "run": str(Path(job.output) / job.name / body)})  # where it will be
    write_report(draft, [found], ReportOptions(dict(map(parse_target, entry.targets))))
    return found


def _nothing(text: str) -> None:
    """For sentences that a worker has nobody to say to."""


def _ranges(found: Review) -> dict[str, tuple[float, float]]:
    """Of the angles that a trial's own report has: of somebody who walks means over strides."""
    ends = {name: (one.lowest, one.highest) for name, one in ranges_of(found).items() if np.isfinite(one.widths).any()}
    return {name: (float(np.nanmean(lowest)), float(np.nanmean(highest))) for name, (lowest, highest) in ends.items()}


def _put(draft: Path, place: Path, token: str) -> None:
    """The results to where they are looked for; those of an earlier batch that were there go, after these have come."""
    before = read_outcome(place)
    if before is not None and before.batch == token:
        return  # another worker, believed to be lost, has come to the end
    old = draft.with_name(f"{draft.name}{_OLD}")
    try:
        if place.exists():
            check_ours(place)
            place.rename(old)
        draft.rename(place)
    except OSError:
        after = read_outcome(place)
        if after is not None and after.batch == token:
            return  # it came to the end just now
        if old.exists() and not place.exists():
            old.rename(place)
        raise
    shutil.rmtree(old, ignore_errors=True)


def put_back(output: Path) -> None:
    """Results that were to be replaced, and the process died before the new ones were there, come back.

    Parameters
    ----------
    output : folder of a batch.
    """
    for old in (output / DRAFTS).glob(f"*{_OLD}"):
        place = output / old.name.removesuffix(_OLD).rpartition(".")[0]
        if not place.exists():
            old.rename(place)


def check_ours(place: Path) -> None:
    """Refuse a trial's folder that no batch has made.

    Raises
    ------
    TrackerError : it holds something else.
    """
    if place.exists() and read_outcome(place) is None:
        raise TrackerError(f"{place} is there already, and no result of a batch; move it away, or name another output")
