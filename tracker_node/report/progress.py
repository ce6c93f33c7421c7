"""Progress on the terminal."""

from __future__ import annotations

import sys
import time


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


class StageProgress:
    """One line a stage that rewrites itself on a terminal, else a line for its beginning and end.

    Call it with what is done, how much of it is done, and how much there is.
    """

    def __init__(self, program: str):
        self._program, self._began, self._stage = program, time.monotonic(), ""

    def __call__(self, what: str, done: int, total: int) -> None:
        text = f"{self._program}: {what}, {done} of {total}, {time.monotonic() - self._began:.0f} s"
        if sys.stderr.isatty():
            print(f"\r{text:<70}", end="\n" if done == total else "", file=sys.stderr, flush=True)
        elif what != self._stage or done == total:
            print(text, file=sys.stderr, flush=True)
        self._stage = what
