"""Trials shared out over workers: what is done already is left, what fails stops nothing, and what is left goes on next time."""

from __future__ import annotations

import json
import os
import shutil
import time
import uuid
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from ..errors import TrackerError, UnknownNameError
from ..loaders.owned_folder import OwnedFolder
from ..loaders.trials_yaml import Trial, Trials
from ..loaders.whole_file import write_whole
from .executors import Processes, WorkerDied, dask_executor
from .work import (
    DRAFTS,
    FAILED,
    FAILED_STATE,
    OWN,
    PROGRESS,
    TOKEN,
    Job,
    Outcome,
    check_ours,
    inputs_of,
    put_back,
    read_outcome,
    run_trial,
)

SUMMARY = "batch.json"
_POLL_S = 0.5
_TRIES = 2  # of a trial whose process has died: another program may have taken the memory


@dataclass(frozen=True)
class BatchOptions:
    """How a batch is worked on.

    Parameters
    ----------
    workers : processes on this machine; None: as many as it has processors, at most one a trial.
    scheduler : address of a Dask scheduler, whose workers are taken instead.
    threads : of each tracker, 1 also decodes its images; None: one where there is a process for each processor of this machine,
        else as the parameters of the trials say.
    again : track what is done already, too.
    only : names of the trials that are tracked; empty: all. Of the others what they have come to already counts.
    """

    workers: int | None = None
    scheduler: str | None = None
    threads: int | None = None
    again: bool = False
    only: tuple[str, ...] = ()


@dataclass(frozen=True)
class Progress:
    """How far a batch is.

    Attributes
    ----------
    done, failed, working, trials : numbers of trials; ``done`` counts those of earlier calls and those that failed.
    sets, expected_sets : of the trials at work, as far as they say.
    left_s : seconds until the end, by what has been done since the beginning; None: not known yet.
    """

    done: int
    failed: int
    working: int
    trials: int
    sets: int
    expected_sets: int
    left_s: float | None


def run_batch(
    trials: Trials,
    options: BatchOptions | None = None,
    tell: Callable[[str], None] = lambda sentence: None,
    progress: Callable[[Progress], None] = lambda now: None,
) -> list[Outcome]:
    """Track all trials that are not done.

    A trial is done when its folder holds results of the same inputs. Results of other inputs are replaced when the new ones
    are there. Whatever ends this call, the next one goes on from there.

    Parameters
    ----------
    trials : what to track.
    options : on how many processes, or where.
    tell : called with a sentence for each trial that fails, or is tracked again.
    progress : called a few times a second.

    Returns
    -------
    An outcome for each trial, in their order; none of a trial that is not to be tracked and never was.

    Raises
    ------
    UnknownNameError : a trial that is to be tracked and is not there.
    TrackerError : another batch works in the folder, or no worker can be had.
    """
    options = options or BatchOptions()
    names = [trial.name for trial in trials.trials]
    for name in options.only:
        if name not in names:
            raise UnknownNameError("trial", name, names)
    with OwnedFolder(trials.output).claimed():
        token = _prepared(trials.output)
        outcomes: dict[str, Outcome] = {}
        jobs: list[Job] = []
        for trial in trials.trials:
            if options.only and trial.name not in options.only:
                found: Job | Outcome | None = _left_from_before(trial, trials.output)
            else:
                found = _job_or_outcome(trial, trials.output, token, options, tell)
            if isinstance(found, Job):
                jobs.append(found)
            elif found is not None:
                outcomes[trial.name] = found

        def taken(outcome: Outcome) -> None:
            outcomes[outcome.name] = outcome
            _note_failure(trials.output, outcome)
            if outcome.state == FAILED_STATE:
                tell(f"{outcome.name} failed: {outcome.reason}")

        def settled(outcome: Outcome) -> None:
            taken(outcome)
            _write_summary(trials, outcomes)

        for outcome in list(outcomes.values()):
            taken(outcome)
        _write_summary(trials, outcomes)
        if jobs:
            with ExitStack() as stack:
                executor, at_once = _executor(options, len(jobs), stack)
                try:
                    _share_out(jobs, executor, at_once, len(trials.trials), outcomes, settled, progress)
                except BaseException:
                    executor.shutdown(wait=False)  # of both kinds, with what waits
                    raise
        shutil.rmtree(trials.output / DRAFTS, ignore_errors=True)
        return [outcomes[name] for name in names if name in outcomes]


def _prepared(output: Path) -> str:
    """The folder of the batch with what workers look for; returns its token."""
    put_back(output)
    shutil.rmtree(output / OWN, ignore_errors=True)
    for name in (DRAFTS, PROGRESS):
        (output / name).mkdir(parents=True, exist_ok=True)  # what a worker of before still writes may not go
    token = uuid.uuid4().hex
    write_whole(output / TOKEN, token + "\n")
    return token


def _left_from_before(trial: Trial, output: Path) -> Outcome | None:
    """What became of a trial in earlier calls; None of one that was never tracked."""
    failure = output / FAILED / f"{trial.name}.txt"
    if failure.is_file():
        reason, _, details = failure.read_text(encoding="utf-8").partition("\n")
        return Outcome(trial.name, trial.subject, FAILED_STATE, reason, details)
    before = read_outcome(output / trial.name)
    return None if before is None else replace(before, subject=trial.subject)


def _job_or_outcome(trial: Trial, output: Path, token: str, options: BatchOptions, tell: Callable[[str], None]) -> Job | Outcome:
    """What is to be done for a trial, or what it has come to already."""
    if trial.recording is None:
        return Outcome(trial.name, trial.subject, FAILED_STATE, trial.problem)
    place = output / trial.name
    try:
        check_ours(place)
        inputs = inputs_of(trial.recording)
    except (TrackerError, OSError) as error:
        return Outcome(trial.name, trial.subject, FAILED_STATE, str(error))
    before = read_outcome(place)
    if before is not None and before.inputs == inputs and not options.again:
        return replace(before, subject=trial.subject)
    if before is not None:
        tell(f"{trial.name} is tracked again{'' if options.again else ': what it is made from has changed'}")
    processors = len(os.sched_getaffinity(0))
    idle = bool(options.scheduler) or (options.workers or processors) < processors
    threads = options.threads or (None if idle else 1)
    return Job(trial.name, trial.subject, trial.recording, inputs, str(output), token, threads)


def _executor(options: BatchOptions, n_jobs: int, stack: ExitStack) -> tuple[Executor, int]:
    """Who works, and on how many trials at once."""
    if options.scheduler:
        cluster: AbstractContextManager[tuple[Executor, int]] = dask_executor(options.scheduler)
        return stack.enter_context(cluster)
    number = min(options.workers or len(os.sched_getaffinity(0)), n_jobs)
    return stack.enter_context(Processes(number)), number


def _share_out(
    jobs: Sequence[Job], executor: Executor, at_once: int, n_trials: int, outcomes: dict[str, Outcome],
    settled: Callable[[Outcome], None], progress: Callable[[Progress], None],
) -> None:  # fmt: skip
    """Give all jobs to the executor and take in what comes of them."""
    began, tries = time.monotonic(), dict.fromkeys((job.name for job in jobs), 1)
    running: dict[Future[Outcome], Job] = {executor.submit(run_trial, job): job for job in jobs}
    parts = dict.fromkeys((job.name for job in jobs), 0.0)
    while running:
        ended, _ = wait(running, timeout=_POLL_S, return_when="FIRST_COMPLETED")
        for future in ended:
            job = running.pop(future)
            try:
                outcome = future.result()
            except WorkerDied as error:  # of processes; Dask itself gives the trial to another worker
                if tries[job.name] < _TRIES:
                    tries[job.name] += 1
                    running[executor.submit(run_trial, job)] = job
                    continue
                outcome = Outcome(job.name, job.subject, FAILED_STATE, f"{error}, {tries[job.name]} times")
            except CancelledError:
                outcome = Outcome(job.name, job.subject, FAILED_STATE, "its worker was canceled")
            except Exception as error:  # of Dask: a worker without this package, or one trial that has killed several workers
                outcome = Outcome(job.name, job.subject, FAILED_STATE, f"{type(error).__name__}: {error}")
            parts[job.name] = 1.0
            settled(outcome)
        progress(_progress(running.values(), at_once, n_trials, outcomes, parts, time.monotonic() - began))


def _progress(
    running: Iterable[Job], at_once: int, n_trials: int, outcomes: dict[str, Outcome], parts: dict[str, float],
    since_s: float,
) -> Progress:  # fmt: skip
    """How far it is; ``parts``: of each job, what fraction is done."""
    sets, expected_sets, working = 0, 0, 0
    for job in running:
        try:
            done, expected = map(int, (Path(job.output) / PROGRESS / job.name).read_text(encoding="utf-8").split())
        except (OSError, ValueError):
            continue
        sets, expected_sets, working = sets + done, expected_sets + expected, working + 1
        parts[job.name] = min(done / expected, 1.0) if expected else 0.0
    share = sum(parts.values()) / len(parts)
    failed = sum(outcome.state == FAILED_STATE for outcome in outcomes.values())
    left_s = since_s * (1.0 - share) / share if share > 0.0 else None
    return Progress(len(outcomes), failed, min(working, at_once), n_trials, sets, expected_sets, left_s)


def _note_failure(output: Path, outcome: Outcome) -> None:
    """A file for each trial that has failed, which goes when it succeeds."""
    place = output / FAILED / f"{outcome.name}.txt"
    if outcome.state == FAILED_STATE:
        place.parent.mkdir(exist_ok=True)
        write_whole(place, f"{outcome.reason}\n{outcome.details}")
    else:
        place.unlink(missing_ok=True)


def _write_summary(trials: Trials, outcomes: dict[str, Outcome]) -> None:
    known = [asdict(outcomes[trial.name]) for trial in trials.trials if trial.name in outcomes]
    write_whole(trials.output / SUMMARY, json.dumps({"trials": known}, indent=1) + "\n")
