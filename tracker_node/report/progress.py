"""Progress on the terminal: lines, and one line that rewrites itself, or a line every tenth when the output is a file."""

from __future__ import annotations

import sys
from typing import TextIO


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


class ByteProgress:
    """Shows how far a download is; call it with (what, bytes done, bytes in all)."""

    def __init__(self, output: TextIO | None = None):
        self._output = output or sys.stderr
        self._what, self._shown = "", -1

    def __call__(self, what: str, done: int, total: int) -> None:
        percent = 100 * done // max(total, 1)
        if what != self._what:
            self._what, self._shown = what, -1
        line = f"  {what}: {done / 1e6:5.1f} of {total / 1e6:.1f} MB ({percent:3d} %)"
        if self._output.isatty():
            self._output.write(f"\r{line}{chr(10) if done >= total and self._shown < 100 else ''}")
            self._shown = percent
        elif percent // 10 > self._shown // 10 or self._shown < 0:
            self._output.write(f"{line}\n")
            self._shown = percent
        self._output.flush()
