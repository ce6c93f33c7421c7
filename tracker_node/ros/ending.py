"""The end of a node's process on a signal: soon, whatever it is doing, with exit status 0.

SIGINT and SIGTERM ask for an orderly end: `Ending.stop` is set, and the event loop, which looks at it, closes what it has. The
compiler, and a search for the body, cannot be interrupted, though, and the event loop may have to wait for them. So after
`GRACE_S` a thread of its own finishes the bags, leaves the ROS graph and ends the process; before there is anything to close, it
ends it at once. SIGUSR1 asks to finish the work first, however long it takes: so the pipeline ends its children when the sources
have ended.

This needs nothing but the standard library: it is in force before the imports that take seconds.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

GRACE_S = 0.7  # for an orderly end
LEAVE_S = 0.3  # then for leaving the graph
FINISH = signal.SIGUSR1
PARENT_VARIABLE = "TRACKER_NODE_PARENT_PID"  # set by the pipeline for its children: end when it is gone

_STOP = (signal.SIGINT, signal.SIGTERM)
_AGAIN_S = 0.5  # a terminal and `ros2 launch` may both send the first one
_LOOK_S = 0.25  # how long the end of the parent may go unnoticed

_current: Ending | None = None


def hurried() -> bool:
    """Whether a signal asks this process to end soon; what is asked to finish its work has time."""
    return _current is not None and _current.hurried.is_set()


def asked_again() -> bool:
    """Whether a second signal has come: now what is not written yet may be lost."""
    return _current is not None and _current.again.is_set()


def current() -> Ending | None:
    """What ends this process; None in one that is not a node's alone."""
    return _current


class Ending:
    """Ends the process on signals, from `__enter__` on; for the main thread of a process that is a node.

    Parameters
    ----------
    last : nothing comes after it but the end of the interpreter, which signals must not disturb any more.

    Attributes
    ----------
    stop : set when the process is to end.
    hurried : set when it is to end soon.
    again : set when that has been asked for a second time.
    """

    def __init__(self, last: bool = False) -> None:
        self._last = last
        self.stop, self.hurried, self.again = threading.Event(), threading.Event(), threading.Event()
        self._closers: list[Callable[[], None]] = []  # bags to be finished, whoever does it
        self._abandoners: list[Callable[[], None]] = []
        self._leave: Callable[[], None] | None = None
        self._forced = True
        self._lock = threading.Lock()

    def __enter__(self) -> Ending:
        global _current
        _current = self
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        # The bytes are written by the signal itself: a main thread that is deep in compiled code need not take notice.
        self._previous_fd = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        numbers = (*_STOP, FINISH)
        self._previous = {number: signal.signal(number, _noted) for number in numbers}
        signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)  # a pipeline blocks them until its child is here
        threading.Thread(target=self._watch, name="end on signals", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        global _current
        _current = None
        if self.stop.is_set():
            return  # the process is about to end, and a second signal must not disturb it
        for number, handler in self._previous.items():
            signal.signal(number, signal.SIG_IGN if self._last else handler)
        signal.set_wakeup_fd(self._previous_fd)
        os.close(self._writer)  # the thread ends

    @contextmanager
    def orderly(self, leave: Callable[[], None], forced: bool = True) -> Iterator[None]:
        """While within, a signal leaves `GRACE_S` for an orderly end.

        Parameters
        ----------
        leave : leaves the ROS graph, when the orderly end has not come; called in another thread.
        forced : end the process then; False for one that sees to its end itself.
        """
        with self._lock:
            self._leave, self._forced = leave, forced
        try:
            yield
        finally:
            with self._lock:
                self._leave, self._forced = None, True

    @contextmanager
    def closing(self, close: Callable[[], None], abandon: Callable[[], None]) -> Iterator[None]:
        """While within, the process does not end without ``close``, which may take its time and be called twice.

        Parameters
        ----------
        close : finishes what must not be lost; may take its time and is called twice at most.
        abandon : lets ``close`` be quick after a second signal, at the price of what is not written yet.
        """
        self._closers.append(close)
        self._abandoners.append(abandon)
        try:
            yield
        finally:
            self._closers.remove(close)
            self._abandoners.remove(abandon)

    def _watch(self) -> None:
        parent, asked_s = int(os.environ.get(PARENT_VARIABLE, "0")), 0.0
        while True:
            ready, _, _ = select.select([self._reader], [], [], _LOOK_S)
            came = os.read(self._reader, 64) if ready else b""
            if ready and not came:
                os.close(self._reader)
                return
            if FINISH in came:
                self.stop.set()
            now_s = time.monotonic()
            orphan = bool(parent) and os.getppid() != parent
            if not asked_s and (orphan or any(number in came for number in _STOP)):
                asked_s = now_s
                threading.Thread(target=self._end, name="end", daemon=True).start()
            elif came and asked_s and now_s - asked_s > _AGAIN_S:
                self.again.set()
                for abandon in self._abandoners:
                    abandon()

    def _end(self) -> None:
        with self._lock:
            waits = self._leave is not None or bool(self._closers)
            self.hurried.set()
            self.stop.set()
        while not self._forced:
            time.sleep(_LOOK_S)
        if waits:
            time.sleep(GRACE_S)  # the process ends meanwhile, if all goes well
        for close in list(self._closers):
            with suppress(Exception):  # the bag itself says what is wrong with it
                close()
        within(LEAVE_S, self._leave or _nothing)
        _remove_own_segments()
        end_now(0)


def _noted(*_: object) -> None:
    """The byte in the pipe has said it already."""


def _nothing() -> None: ...


def end_now(status: int) -> NoReturn:
    """End the process without the interpreter's own end, which waits for threads and takes part of a second."""

    def flush() -> None:
        sys.stdout.flush()
        sys.stderr.flush()

    within(LEAVE_S, flush)
    os._exit(status)


def within(seconds: float, action: Callable[[], None]) -> None:
    """Do something in a thread, and wait for a limited time.

    Parameters
    ----------
    seconds : longest wait.
    action : what is done; what it raises is ignored.
    """

    def quietly() -> None:
        with suppress(Exception):
            action()

    thread = threading.Thread(target=quietly, daemon=True)
    thread.start()
    thread.join(seconds)


def _remove_own_segments() -> None:
    """The shared memory in which others read what this process has sent: Fast DDS keeps its lock file open while it lives."""
    held = Path("/proc/self/fd")
    for link in held.iterdir() if held.is_dir() else ():
        with suppress(OSError):
            lock = os.readlink(link)
            if lock.startswith("/dev/shm/fastrtps_") and lock.endswith("_el") and "port" not in lock:
                Path(lock).unlink(missing_ok=True)
                Path(lock.removesuffix("_el")).unlink(missing_ok=True)
