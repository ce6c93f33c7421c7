"""Tests run against copies of the source tree, in processes forked from one that has loaded the libraries.

Each worker has a copy of its own. numba keeps machine code beside the sources and makes it anew when their file has changed,
but not when a function of another file that was compiled into it has: the machine code of all that import a changed kernel is
set aside while its mutant is tried.
"""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

OPTIONS = ["-x", "-q", "-m", "not long and not ros", "--hypothesis-seed=0",
           "-o", "addopts=--strict-markers --import-mode=importlib"]  # fmt: skip
LIBRARIES = ("cv2", "hypothesis.extra.numpy", "numba", "pydantic", "pytest", "rclpy", "scipy.optimize", "scipy.spatial")
SURVIVED = (0, 5)  # exit statuses of pytest: all passed; no tests
INTERRUPTED, BROKEN = 2, 3  # no more time, or a file that cannot be loaded; pytest itself, or a plugin, has failed
COMPILING_S = 150.0  # of processor time, on top, where machine code is made anew


def brought_up_to_date(root: Path, copy: Path) -> None:
    """Make ``copy`` the tree as git sees it, ignored files left out; numba's machine code is brought once, and stays."""
    listed = subprocess.run(
        ["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"], capture_output=True, check=True
    )
    names = {name for name in listed.stdout.decode().split("\0") if name and (root / name).is_file()}
    if not copy.exists():
        names |= {p.relative_to(root).as_posix() for p in (root / "tracker_node").rglob("*.nb?")}
    for name in names:
        source, target = (root / name).stat(), copy / name
        if not target.exists() or (target.stat().st_mtime_ns, target.stat().st_size) != (source.st_mtime_ns, source.st_size):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, target)
    for old in (p for top in ("tracker_node", "test", "benchmark") for p in (copy / top).rglob("*.py")):
        if old.relative_to(copy).as_posix() not in names:
            old.unlink()


@dataclass(frozen=True)
class Outcome:
    """Exit status of pytest (negative: ended by a signal; None: by our limit), and the end of what it said."""

    status: int | None
    said: str


class Tree:
    """One worker's copy, and the tests run in it."""

    def __init__(self, root: Path):
        self.root = root
        self._aside = root / "out/aside"
        shutil.rmtree(self._aside, ignore_errors=True)
        os.chdir(root)
        sys.path[:0] = [str(root)]
        os.environ.update(PYTHONPATH=str(root), PYTHONDONTWRITEBYTECODE="1")
        sys.dont_write_bytecode = True
        _load_libraries()

    def plant(self, name: str, content: bytes, stale: Iterable[str]) -> None:
        """Write a file anew; ``stale``: other files whose machine code holds what it held."""
        for kept in self._machine_code({name, *stale}):
            aside = self._aside / kept.relative_to(self.root)
            aside.parent.mkdir(parents=True, exist_ok=True)
            kept.rename(aside)
        (self._aside / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(self.root / name, self._aside / name)
        (self.root / name).write_bytes(content)

    def restore(self, name: str, stale: Iterable[str]) -> None:
        """The file, and the machine code, as they were before `plant`."""
        for made in self._machine_code({name, *stale}):
            made.unlink()
        for kept in [p for p in self._aside.rglob("*") if p.is_file()]:
            kept.rename(self.root / kept.relative_to(self._aside))

    def _machine_code(self, names: Iterable[str]) -> list[Path]:
        sources = [self.root / name for name in names]
        return [kept for s in sources for kept in (s.parent / "__pycache__").glob(f"{s.stem}.*.nb?")]

    def compiled(self) -> dict[Path, int]:
        """The machine code that there is, and when it was made, ns."""
        return {kept: kept.stat().st_mtime_ns for kept in (self.root / "tracker_node").rglob("*.nb?")}

    def run(self, tests: list[str], limit_s: float, plugins: tuple[object, ...] = (), arguments: tuple[str, ...] = ()) -> Outcome:
        """Run these tests in a process of their own, until the first fails; ``limit_s`` of processor time."""
        log = self.root / "out/pytest_output.txt"
        log.parent.mkdir(exist_ok=True)
        pid = os.fork()
        if pid == 0:
            _become_pytest(self.root, log, tests, limit_s, list(plugins), arguments)
        status = _wait(pid, 30.0 + 20.0 * limit_s)
        return Outcome(status, log.read_text(errors="replace")[-1500:] if log.exists() else "")


def _load_libraries() -> None:
    """What nearly every test loads; the package itself only as far as it sets up these libraries."""
    for name in ("tracker_node", *LIBRARIES):
        importlib.import_module(name)


def _become_pytest(
    root: Path, log: Path, tests: list[str], limit_s: float, plugins: list[object], arguments: tuple[str, ...]
) -> None:
    """In the child: never returns."""
    code = 3
    try:
        os.setsid()
        signal.signal(signal.SIGXCPU, signal.default_int_handler)  # pytest ends as by Ctrl-C, and says what it has seen
        resource.setrlimit(resource.RLIMIT_CPU, (round(limit_s) + 1, round(limit_s) + 60))
        descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        import pytest

        options = [*OPTIONS, "--rootdir", str(root), "-c", str(root / "pyproject.toml"), *arguments]
        code = int(pytest.main([*options, *tests], plugins=plugins))
        sys.stdout.flush()
    finally:
        used = resource.getrusage(resource.RUSAGE_SELF)
        os._exit(INTERRUPTED if used.ru_utime + used.ru_stime > limit_s else code)


def _wait(pid: int, limit_s: float) -> int | None:
    """Exit status of the child, negative for a signal, None when it had to be ended."""
    until = time.monotonic() + limit_s
    pause = 0.01
    while time.monotonic() < until:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            _end_group(pid)
            code = os.waitstatus_to_exitcode(status)
            return None if code == INTERRUPTED else code
        time.sleep(pause)
        pause = min(pause * 1.5, 0.2)
    _end_group(pid)
    os.waitpid(pid, 0)
    return None


def _end_group(pid: int) -> None:
    """End the child, and what it has started and left behind."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)


_TREE: Tree | None = None


def tree() -> Tree:
    """This worker's copy."""
    assert _TREE is not None
    return _TREE


def _start_worker(folder: Path, counter: object) -> None:
    global _TREE
    with counter.get_lock():  # type: ignore[attr-defined]
        number = counter.value = counter.value + 1  # type: ignore[attr-defined]
    _TREE = Tree(folder / f"worker{number}")


def workers(folder: Path, jobs: int) -> multiprocessing.pool.Pool:  # type: ignore[name-defined]
    """Processes with a copy each, ``folder``/worker1 and so on, which must be there."""
    context = multiprocessing.get_context("fork")
    return context.Pool(jobs, _start_worker, (folder, context.Value("i", 0)))
