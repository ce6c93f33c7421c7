"""One verb of the console command as a child process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from . import ending

COMMAND = ("-P", "-m", "tracker_node.cli.main")  # -P: what is installed, not a folder of that name in the current one


class Child:
    """A running ``tracker_node <verb>``, or another program.

    It is in a session of its own, so that Ctrl-C reaches only us and the children are ended in the right order; should this
    process vanish, it ends by itself.

    Parameters
    ----------
    arguments : the verb and its options.
    on_line : called (in a thread) with each line that the child prints; None leaves its output alone.
    program : what Python runs instead of the console command.
    environment : further variables of its environment.
    """

    def __init__(
        self,
        arguments: list[str],
        on_line: Callable[[str], None] | None = None,
        program: Sequence[str] = COMMAND,
        environment: Mapping[str, str] = MappingProxyType({}),
    ):
        # A signal that comes before the child can heed it waits until it can: the child unblocks them (`ending`).
        blocked = (signal.SIGINT, signal.SIGTERM, ending.FINISH) if tuple(program) == COMMAND else ()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
        try:
            self._process = subprocess.Popen(
                [sys.executable, *program, *arguments],
                env={**os.environ, **environment, ending.PARENT_VARIABLE: str(os.getpid())},
                stdin=subprocess.DEVNULL,
                stdout=None if on_line is None else subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        self._reader: threading.Thread | None = None
        if on_line is not None:
            self._reader = threading.Thread(target=self._read, args=(on_line,), daemon=True)
            self._reader.start()

    def _read(self, on_line: Callable[[str], None]) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            on_line(line.rstrip("\n"))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Exit status, None while it runs."""
        return self._process.poll()

    def interrupt(self) -> None:
        """Ask it to end soon, as Ctrl-C does."""
        if self.returncode is None:
            self._process.send_signal(signal.SIGINT)

    def finish(self) -> None:
        """Ask a node to do what it has begun, however long that takes, and end."""
        if self.returncode is None:
            self._process.send_signal(ending.FINISH)

    def end(self, timeout_s: float) -> int:
        """Ask it to end, insist if it does not; returns the exit status."""
        for number, patience_s in ((signal.SIGINT, timeout_s), (signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
            if self.returncode is not None:
                break
            self._process.send_signal(number)
            try:
                self._process.wait(timeout=patience_s)
            except subprocess.TimeoutExpired:
                continue
        if self._reader is not None:
            self._reader.join(timeout=2.0)
        return self._process.wait()
