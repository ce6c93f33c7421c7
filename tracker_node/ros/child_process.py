"""One verb of the console command as a child process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence

from .executor import PARENT_VARIABLE


class Child:
    """A running ``tracker_node <verb>``, or another program.

    It is in a session of its own, so that Ctrl-C reaches only us and the children are ended in the right order; should this
    process vanish, it ends by itself.

    Parameters
    ----------
    arguments : the verb and its options.
    on_line : called (in a thread) with each line that the child prints; None leaves its output alone.
    program : what Python runs instead of the console command.
    """

    def __init__(
        self,
        arguments: list[str],
        on_line: Callable[[str], None] | None = None,
        program: Sequence[str] = ("-m", "tracker_node.cli.main"),
    ):
        self._process = subprocess.Popen(
            [sys.executable, *program, *arguments],
            env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
            stdin=subprocess.DEVNULL,
            stdout=None if on_line is None else subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
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
        """Ask it to finish its work, as Ctrl-C does."""
        if self.returncode is None:
            self._process.send_signal(signal.SIGINT)

    def end(self, timeout_s: float) -> int:
        """Ask it to finish its work, insist if it does not; returns the exit status."""
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
