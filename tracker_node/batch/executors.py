"""Where trials are worked on: processes of this machine, or workers of a Dask cluster.

Both are executors as those of `concurrent.futures`.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection, Pipe
from typing import Any

from ..errors import TrackerError, extra_module

CONNECT_S = 10.0
_AGAIN_S = 0.5


class WorkerDied(TrackerError):
    """The process that worked on something has ended before it was done."""


class Processes(Executor):
    """Processes that each do one thing after the other; one that dies takes only what it was at with it.

    Parameters
    ----------
    number : of processes; they begin when they are needed.
    """

    def __init__(self, number: int):
        self._lanes = ThreadPoolExecutor(number)
        self._lane = threading.local()
        self._all: list[_Process] = []
        self._closed = threading.Event()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a function called in one of the processes.

        Parameters
        ----------
        fn, *args, **kwargs : importable function, and what it is given; all of it can be pickled.

        Returns
        -------
        Its result, or `WorkerDied`, when it is there.
        """
        return self._lanes.submit(self._call, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes.

        Parameters
        ----------
        wait : for what is at work; else it is ended.
        cancel_futures : leave out what waits.
        """
        if not wait:
            self._closed.set()
            self._lanes.shutdown(wait=False, cancel_futures=True)  # before what is at work ends and the next one would begin
            for process in self._all:
                process.end()
        self._lanes.shutdown(wait=True, cancel_futures=cancel_futures)
        for process in self._all:
            process.end()

    def _call(self, function: Callable[..., Any], args: tuple, kwargs: dict[str, Any]) -> Any:
        if self._closed.is_set():
            raise WorkerDied("the batch was ended before")
        process = getattr(self._lane, "process", None)
        if process is None or not process.lives:
            process = self._lane.process = _Process()
            self._all.append(process)
        return process.call(function, args, kwargs)


class _Process:
    """A process that waits for what it is to call."""

    def __init__(self) -> None:
        self._ours, theirs = Pipe()
        # Not by `multiprocessing`: it would run the script again that called. In a session of its own, since Ctrl-C is for
        # the one who shares the work out.
        begin = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; serve({theirs.fileno()})"
        self._process = subprocess.Popen(
            [sys.executable, "-c", begin], pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, start_new_session=True
        )
        theirs.close()

    @property
    def lives(self) -> bool:
        return self._process.poll() is None

    def call(self, function: Callable[..., Any], args: tuple, kwargs: dict[str, Any]) -> Any:
        try:
            self._ours.send((function, args, kwargs))
            result, error = self._ours.recv()
        except (EOFError, OSError):
            code = self._process.wait()
            how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
            raise WorkerDied(f"the process that worked on it ended with {how}") from None
        if error is not None:
            raise error
        return result

    def end(self) -> None:
        self._process.terminate()
        self._process.wait()
        self._ours.close()


def serve(handle: int) -> None:
    """Call what comes over a pipe, until its other end is closed, as that of a process that has died is."""
    connection = Connection(handle)
    while True:
        try:
            function, args, kwargs = connection.recv()
        except EOFError:
            return
        try:
            answer: tuple[Any, BaseException | None] = (function(*args, **kwargs), None)
        except Exception as error:
            answer = (None, error)
        connection.send(answer)


def _client(address: str) -> Any:
    distributed = extra_module("distributed", "cluster")
    tries_left = 3
    while True:
        tries_left -= 1
        try:
            return distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except AssertionError:  # its own: a scheduler that still clears up after another client may greet with two messages
            if not tries_left:
                raise
            time.sleep(_AGAIN_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise TrackerError(f"no Dask scheduler answers at {address}: {error}") from None


@contextmanager
def dask_executor(address: str) -> Iterator[tuple[Executor, int]]:
    """The workers of a Dask scheduler; a trial whose worker is lost is given to another one.

    Parameters
    ----------
    address : such as ``tcp://127.0.0.1:8786``.

    Yields
    ------
    Executor, and how many things its workers do at once.

    Raises
    ------
    TrackerError : no scheduler answers, or it has no workers.
    MissingExtraError : Dask is not installed.
    """
    with _client(address) as client:
        threads = sum(worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values())
        if not threads:
            raise TrackerError(f"the Dask scheduler at {address} has no workers; start some: dask worker {address} --nthreads 1")
        executor = client.get_executor(pure=False)
        try:
            yield executor, threads
        finally:
            executor.shutdown(wait=False)
