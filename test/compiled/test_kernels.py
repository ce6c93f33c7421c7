"""Machine code is made anew where anything that it rests on has changed, and only there."""

import gc
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tracker_node.compiled.ahead import listed
from tracker_node.compiled.kernels import compiled, content_of

CALLER = """
from tracker_node.compiled.kernels import compiled
from . import constants as c
from .callee import inner

@compiled
def outer(x):
    return inner(x) + c.OFFSET
"""
CALLEE = """
from tracker_node.compiled.kernels import compiled

@compiled
def inner(x):
    return x * {factor}
"""


def written(folder: Path, factor: int = 2, offset: int = 100, unused: int = 0) -> None:
    package = folder / "tracker_node_scratch"
    package.mkdir(exist_ok=True)
    files = {"__init__": "", "caller": CALLER, "callee": CALLEE.format(factor=factor)}
    for name, text in {**files, "constants": f"OFFSET, UNUSED = {offset}, {unused}\n"}.items():
        file = package / f"{name}.py"
        if not file.exists() or file.read_text() != text:
            file.write_text(text)


def answer(folder: Path) -> list[str]:
    """What ``outer(1)`` is, and whether it was compiled or kept."""
    code = "from tracker_node_scratch.caller import outer; print(outer(1), len(outer.stats.cache_hits))"
    environment = {**os.environ, "PYTHONPATH": f"{folder}:{Path(__file__).parents[2]}", "NUMBA_CACHE_DIR": str(folder / "kept")}
    return subprocess.run(
        [sys.executable, "-B", "-c", code], capture_output=True, text=True, check=True, env=environment
    ).stdout.split()


def test_a_callee_or_a_constant_that_has_changed_is_noticed(tmp_path):
    written(tmp_path)
    assert answer(tmp_path) == ["102", "0"]
    assert answer(tmp_path) == ["102", "1"]
    written(tmp_path, factor=3)
    assert answer(tmp_path) == ["103", "0"]
    written(tmp_path, factor=3, offset=200)
    assert answer(tmp_path) == ["203", "0"]
    written(tmp_path, factor=3, offset=200, unused=5)
    assert answer(tmp_path) == ["203", "1"]


TWO_OF_ONE_FACTORY = """
def make(number):
    @compiled
    def f(x):
        return x + number
    return f
f = make(1), make(2)
"""


def test_processes_that_keep_at_once_do_not_mix_up_what_they_keep(function, monkeypatch):
    """Whatever the other does while a file is written, and the other way round."""
    for first, second in [(0, 1), (1, 0)]:
        both = function(TWO_OF_ONE_FACTORY)
        file = both[first]._cache._cache_file
        write = file._open_for_write

        @contextmanager
        def meanwhile(path, write=write, other=both[second]):
            other(10)
            with write(path) as opened:
                yield opened

        monkeypatch.setattr(file, "_open_for_write", meanwhile)
        assert [f(10) for f in both] == [11, 12]
        again = [compiled(f.py_func) for f in both]
        assert [f(10) for f in again] == [11, 12]
        assert all(f.stats.cache_hits for f in again)


def test_what_is_older_than_its_source_is_removed(function):
    f, g = function(TWO_OF_ONE_FACTORY)
    f(10), f(10.0)
    kept = list(Path(f._cache.cache_path).glob("*.nbc"))
    os.utime(kept[0], (0, 0))
    g(10)
    assert len(kept) == 2 and not kept[0].exists() and kept[1].exists()


@pytest.fixture
def function(tmp_path):
    """Makes the function ``f`` of a text, in a file of its own, as a module of the package."""

    def make(text: str):
        file = tmp_path / f"{len(list(tmp_path.iterdir()))}.py"
        file.write_text(text)
        names = {"np": np, "compiled": compiled, "__name__": "tracker_node.scratch"}
        exec(compile(text, file, "exec"), names)
        return names["f"]

    return make


@pytest.mark.parametrize(
    "other",
    [
        "K = 2\ndef f(x): return x - K",
        "K = 3\ndef f(x): return x + K",
        "K = 2.0\ndef f(x): return x + K",
        "K = np.array([2, 2])\ndef f(x): return x + K",
        "K = (2, 3)\ndef f(x): return x + K",
        "K = {2}\ndef f(x): return x + K",
        "def K(): return 2\ndef f(x): return x + K",
        "@compiled\ndef K(): return 2\ndef f(x): return x + K",
        "@compiled(fastmath={'nnan'})\ndef K(): return 2\ndef f(x): return x + K",
        "def outer(K):\n    def f(x): return x + K\n    return f\nf = outer(2)",
        "def outer(K):\n    def f(x): return x + K\n    return f\nf = outer(3)",
    ],
)
def test_content_tells_functions_apart(other, function):
    base = "K = 2\ndef f(x): return x + K"
    assert content_of(function(base)) == content_of(function(base + "\nL = 5"))
    assert content_of(function(other)) == content_of(function(other))
    assert content_of(function(other)) != content_of(function(base))


def test_contents_are_the_same_in_every_process():
    """Sets have another order in each."""
    code = "from tracker_node.compiled.ahead import listed; from tracker_node.compiled.kernels import content_of\n"
    code += "print(*(content_of(kernel.dispatcher.py_func) for kernel in listed()))"
    found = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": seed}
        ).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1 and len(found.pop().split()) == len(listed())


def test_garbage_is_collected_again_once_code_is_compiled(function):
    f = function("@compiled\ndef g(x): return x + 1\n@compiled\ndef f(x): return g(x)")
    assert gc.isenabled() and f(3) == 4 and gc.isenabled()
