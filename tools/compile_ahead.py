"""Compile the functions that tracking people and boxes takes, on all processors; what is kept from before is not compiled again.

    .venv/bin/python tools/compile_ahead.py
"""

import sys
import time

import tracker_node  # noqa: F401 - settles for which processor
from tracker_node.compiled.ahead import compile_ahead

WIDTH = 40


def show(done: int, total: int) -> None:
    """A bar, where somebody may be watching."""
    if sys.stderr.isatty() or done == total:
        filled = WIDTH * done // total
        print(f"\r  [{'#' * filled}{'.' * (WIDTH - filled)}] {done} of {total}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    began = time.perf_counter()
    if compile_ahead(show):
        print(f", {time.perf_counter() - began:.0f} s", file=sys.stderr)
