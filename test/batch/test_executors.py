"""Processes that work for a batch: one that dies takes nothing else with it."""

import os
import re
import signal
import time
from concurrent.futures import CancelledError

import pytest

from tracker_node.batch.executors import Processes, WorkerDied, dask_executor
from tracker_node.errors import MissingExtraError, TrackerError


def test_what_is_called_returns_and_raises_as_it_would_here():
    with Processes(2) as executor:
        futures = [executor.submit(divmod, n, 2) for n in (5, 6, 7)]
        assert [future.result() for future in futures] == [(2, 1), (3, 0), (3, 1)]
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result()
        assert executor.submit(abs, -1).result() == 1


def test_calls_run_in_other_processes():
    with Processes(2) as executor:
        pids = {future.result() for future in [executor.submit(os.getpid) for _ in range(2)]}
        assert len(pids) == 2 and os.getpid() not in pids


def test_a_process_that_dies_says_how_and_another_takes_its_place():
    with Processes(1) as executor:
        with pytest.raises(WorkerDied, match="ended with signal SIGKILL"):
            executor.submit(signal.raise_signal, signal.SIGKILL).result()
        with pytest.raises(WorkerDied, match="ended with exit status 3"):
            executor.submit(os._exit, 3).result()
        assert executor.submit(abs, -1).result() == 1


def test_what_is_at_work_ends_when_it_is_not_waited_for():
    executor = Processes(1)
    pid = executor.submit(os.getpid).result()
    nap, never = executor.submit(time.sleep, 1000.0), executor.submit(abs, -1)
    while not nap.running():
        time.sleep(0.01)
    executor.shutdown(wait=False)
    assert isinstance(nap.exception(), WorkerDied)
    with pytest.raises(CancelledError):
        never.result()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("tracker_node.batch.executors.CONNECT_S", 0.5)
    said = re.escape("no Dask scheduler answers at tcp://127.0.0.1:9")
    with pytest.raises(TrackerError, match=said), dask_executor("tcp://127.0.0.1:9"):
        pass


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(MissingExtraError, match="cluster"), dask_executor("tcp://127.0.0.1:9"):
        pass
