"""Compile the functions that tracking people and boxes takes, on all processors; what is kept from before is not compiled again.

    .venv/bin/python tools/compile_ahead.py
"""

import time

import tracker_node  # noqa: F401 - settles for which processor
from tracker_node.compiled.ahead import compile_ahead, show_progress

if __name__ == "__main__":
    began = time.perf_counter()
    n = compile_ahead(show_progress)
    print(f"{n} functions in {time.perf_counter() - began:.0f} s")
