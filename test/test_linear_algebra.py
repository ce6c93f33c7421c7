"""Small matrices are worked on by the thread that asks for it."""

import os
import subprocess
import sys

import pytest

THREADS = "import threadpoolctl; print(max(i['num_threads'] for i in threadpoolctl.threadpool_info() if i['user_api'] == 'blas'))"


def threads_after(imports: str, **environment: str) -> int:
    inherited = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", f"{imports}; {THREADS}"]
    return int(subprocess.run(command, env={**inherited, **environment}, capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize("imports", ["import numpy, tracker_node", "import tracker_node, numpy"])
def test_one_thread_whether_numpy_was_there_before_or_comes_later(imports):
    assert threads_after(imports) == 1


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core: there is nothing to choose")
def test_who_asks_for_more_gets_more():
    assert threads_after("import numpy, tracker_node", OPENBLAS_NUM_THREADS="2") == 2
