"""A thread that works in turns, and between them does what other threads ask of it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class CommandThread(Generic[T]):
    """Runs between `start` and `stop`, as often as these are called.

    Parameters
    ----------
    wait : waits for something to do, not for long. wake : lets that return at once.
    work : does it. at_end : called in the thread when it is to end.
    on_error : called with the reason why the thread has ended by itself.

    Attributes
    ----------
    stopping : the thread is to end.
    busy : at work, or getting ready to.
    fatal : why the thread has ended by itself.
    """

    def __init__(
        self,
        wait: Callable[[], T],
        wake: Callable[[], None],
        work: Callable[[T], None],
        at_end: Callable[[], None],
        on_error: Callable[[Exception], None],
    ):
        self._wait, self._wake, self._work, self._at_end, self._on_error = wait, wake, work, at_end, on_error
        self._thread: threading.Thread | None = None
        self._commands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self.stopping = threading.Event()
        self.busy = True
        self.fatal: Exception | None = None

    def start(self, name: str) -> None:
        """Begin."""
        self.stopping.clear()
        self._thread = threading.Thread(target=self.run, name=name, daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float) -> bool:
        """End; whether that has come about within the timeout. If not, the thread goes on."""
        self.stopping.set()
        self._wake()
        if self._thread is not None:
            self._thread.join(timeout=timeout_s)
            if self._thread.is_alive():
                self.stopping.clear()
                return False
        self._thread = None
        return True

    @property
    def started(self) -> bool:
        """Whether it has been started, and not stopped since."""
        return self._thread is not None

    def command(self, action: Callable[[], None]) -> None:
        """Have something done in the thread, soon."""
        self._commands.put(action)
        self._wake()

    def obey(self) -> None:
        """In the thread: do what has been commanded."""
        while True:
            try:
                action = self._commands.get_nowait()
            except queue.Empty:
                return
            action()

    def run(self) -> None:
        """What the thread does."""
        try:
            while not self.stopping.is_set():
                self.busy = False
                found = self._wait()
                self.busy = True
                self.obey()
                self._work(found)
            self._at_end()
        except Exception as error:  # who has started it must know, or would wait for ever
            self.fatal = error
            self._on_error(error)
