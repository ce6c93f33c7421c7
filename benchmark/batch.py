#!/usr/bin/env python3
"""How much sooner two workers do what one does, and what a batch loses when a worker is killed.

Eight trials of a figure of ten cones in fast motion, seen by three cameras; start-up is counted. ``batch.speedup_2``: one process
with one thread against two with one thread each. Images are decoded beside that thread: ``batch.one_worker_processors`` and
``batch.two_workers_processors`` say how many processors are at work on the mean; the first bounds the speed-up on two.
``batch.killed_worker_lost_trials``: two workers of Dask on the loopback, without a nanny, one of which is killed in the middle;
trials that are then not there. ``batch.same_states``: whether the states of all of these are, to the last bit, those of trials
tracked one by one.
"""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour._runs import print_circumstances
from tracker_node.api.functions import track
from tracker_node.api.recording import recording_of
from tracker_node.batch.batch import BatchOptions, run_batch
from tracker_node.batch.work import TRACKED, Outcome
from tracker_node.cli.main import main as tracker_node
from tracker_node.errors import TrackerError
from tracker_node.loaders.trials_yaml import Trials, load_trials
from tracker_node.report.metrics_file import report_metrics

N_TRIALS = 8
IMAGES = {"quick": 60, "full": 300}
WAIT_S = 60.0


def write_trials(folder: Path, images: int, n_trials: int = N_TRIALS) -> Path:
    """A recording of the figure, and trials that each take it whole.

    Parameters
    ----------
    folder : where both go.
    images : per camera.
    n_trials : how many.

    Returns
    -------
    The file of the trials.
    """
    clip = folder / "clip"
    asked = ["--subject", "figure", "--cameras", "3", "--images", str(images), "--output", str(clip)]
    if tracker_node(["synthesize", *asked]) != 0:
        raise TrackerError(f"{clip}: no recording could be made")
    common = {"rig": "clip/rig.yaml", "model": "clip/person.yaml", "initial_state": "clip/state.yaml"}
    trials = {"output": "out", "common": common, "trials": {f"trial{i + 1}": None for i in range(n_trials)}}
    path = folder / "trials.yaml"
    path.write_text(yaml.safe_dump(trials))
    return path


@contextmanager
def dask_cluster(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """A scheduler and workers with one thread each, on the loopback.

    Parameters
    ----------
    folder : for their files.
    workers : how many.

    Yields
    ------
    The scheduler's address, and the processes of the workers.
    """
    file, place = folder / "scheduler.json", ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file"]
    with ExitStack() as stack:

        def start(*arguments: str) -> subprocess.Popen:
            log = stack.enter_context((folder / f"{arguments[0]}.log").open("a"))
            command = [sys.executable, "-m", "dask", *arguments]
            process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder)
            stack.callback(_end, process)
            return process

        start("scheduler", "--port", "0", *place, str(file))
        _wait_for(lambda: file.is_file() and file.read_text().strip(), "scheduler")
        address = json.loads(file.read_text())["address"]
        from distributed import Client

        begun = [start("worker", "--nthreads", "1", "--no-nanny", *place, str(file)) for _ in range(workers)]
        with Client(address, set_as_default=False) as client:
            _wait_for(lambda: len(client.scheduler_info(n_workers=-1)["workers"]) == workers, "workers")
        yield address, begun


def _end(process: subprocess.Popen) -> None:
    process.terminate()
    process.wait()


def _wait_for(condition, what: str) -> None:
    until = time.monotonic() + WAIT_S
    while not condition():
        if time.monotonic() > until:
            raise TrackerError(f"{what}: did not start within {WAIT_S:.0f} s")
        time.sleep(0.1)


def killed_in_the_middle(trials: Trials, address: str, workers: Sequence[subprocess.Popen]) -> list[Outcome]:
    """Track trials with two workers, the second of which is killed while it is at one of them.

    Parameters
    ----------
    trials, address, workers : see `dask_cluster`.

    Returns
    -------
    Outcomes.
    """

    def kill(now) -> None:
        # With two trials or more left each worker has one
        if now.working >= 1 and now.trials - now.done >= 2 and workers[1].poll() is None:
            workers[1].send_signal(signal.SIGKILL)

    outcomes = run_batch(trials, BatchOptions(scheduler=address), print, kill)
    if workers[1].poll() != -signal.SIGKILL:
        raise TrackerError("the worker was to be killed in the middle, and was not: the trials are too short")
    return outcomes


def same_states(trials: Trials, one_by_one: Path) -> bool:
    """Whether trials have the states, byte by byte, that they have one by one.

    Parameters
    ----------
    trials : that have been tracked.
    one_by_one : folder with those tracked one by one; each is tracked here if it is not there.
    """
    for trial in trials.trials:
        assert trial.recording is not None
        if not (one_by_one / trial.name).exists():
            track(recording_of(trial.recording), one_by_one / trial.name)
        both = [(folder / trial.name / "states.csv") for folder in (trials.output, one_by_one)]
        if not both[0].is_file() or both[0].read_bytes() != both[1].read_bytes():
            return False
    return True


def _processor_s() -> float:
    """Processor time of children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(folder: Path, images: int) -> dict[str, float | int]:
    """All figures."""
    file = write_trials(folder, images)
    run_batch(load_trials(file, folder / "warm"), BatchOptions(1, only=("trial1",)))  # compiles what is not yet
    seconds, processors, same = {}, {}, True
    for workers in (1, 2):
        trials, began, used = load_trials(file, folder / f"workers{workers}"), time.monotonic(), _processor_s()
        outcomes = run_batch(trials, BatchOptions(workers, threads=1), print)
        seconds[workers] = time.monotonic() - began
        processors[workers] = (_processor_s() - used) / seconds[workers]
        same &= all(outcome.state == TRACKED for outcome in outcomes) and same_states(trials, folder / "one_by_one")
    with dask_cluster(folder, 2) as (address, begun):
        trials = load_trials(file, folder / "dask")
        outcomes = killed_in_the_middle(trials, address, begun)
    lost = sum(outcome.state != TRACKED for outcome in outcomes)
    same &= same_states(trials, folder / "one_by_one")
    return {
        "batch.speedup_2": seconds[1] / seconds[2],
        "batch.one_worker_s": seconds[1],
        "batch.two_workers_s": seconds[2],
        "batch.one_worker_processors": processors[1],
        "batch.two_workers_processors": processors[2],
        "batch.trials": N_TRIALS,
        "batch.sets": N_TRIALS * images,
        "batch.killed_worker_lost_trials": lost,
        "batch.same_states": int(same),
    }


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/batch.py --quick --json out/benchmark/batch.json", "short trials: shows that it runs"
    )
    args = parser.parse_args(arguments)
    try:
        with tempfile.TemporaryDirectory(prefix="batch-") as folder:
            metrics = measure(Path(folder), IMAGES["quick" if args.quick else "full"])
    except TrackerError as error:
        print(f"batch: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
