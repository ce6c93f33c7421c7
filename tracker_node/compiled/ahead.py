"""Compiles the functions of a usual tracker on all processors, before they are called one after the other on one.

`kernels.json` lists them, callees first, as `tools/list_kernels.py` has found them. Each is compiled once its callees are, by
this process or one of its helpers, which find each other's machine code on disk. Others are compiled when they are called.
"""

from __future__ import annotations

import ast
import heapq
import importlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

from numba import types as numba_types
from numba.core.errors import NumbaError

from .kernels import is_kept

LIST = Path(__file__).with_name("kernels.json")
_PACKAGE = __package__.partition(".")[0]
_MOST_PROCESSES = 4
_PATIENCE_S = 120.0  # for a helper to end, once there is nothing more to do

Progress = Callable[[int, int], None]
"""Called with how many functions are compiled, and how many there are to compile."""


def _read(node: ast.expr) -> Any:
    """What a node of a numba type, written as Python, stands for: ``UniTuple(float64, 3)``, ``Literal[int](3)``."""
    match node:
        case ast.Constant():
            return node.value
        case ast.Name(id="bool"):
            return numba_types.boolean
        case ast.Name():
            return getattr(numba_types, node.id)
        case ast.Tuple():
            return tuple(_read(each) for each in node.elts)
        case ast.Call(func=ast.Subscript()):
            return numba_types.literal(_read(node.args[0]))
        case ast.Call(func=ast.Name(id="omitted")):
            return numba_types.Omitted(_read(node.keywords[0].value))
        case ast.Call():
            named = {str(each.arg): _read(each.value) for each in node.keywords}
            return _read(node.func)(*(_read(each) for each in node.args), **named)
    raise ValueError(f"expected a numba type, got {ast.unparse(node)}")


@dataclass(frozen=True)
class Kernel:
    """One function for arguments of some types.

    Attributes
    ----------
    name : module within the package, a colon, and what it is called there.
    arguments : numba types, as Python writes them.
    after : places in the list of those that it calls.
    ms : that compiling it alone took.
    """

    name: str
    arguments: str
    after: tuple[int, ...]
    ms: int

    @property
    def types(self) -> tuple:
        """The numba types of its arguments."""
        return _read(ast.parse(self.arguments, mode="eval").body)

    @property
    def dispatcher(self) -> Any:
        """The function; its module is imported."""
        module, _, name = self.name.partition(":")
        return getattr(importlib.import_module(f"{_PACKAGE}.{module}"), name)

    def is_kept(self) -> bool:
        """Whether there is nothing to compile: there is machine code of it, or it is not any more as it was listed."""
        try:
            dispatcher, types = self.dispatcher, self.types
            return len(types) != dispatcher.py_func.__code__.co_argcount or is_kept(dispatcher, types)
        except (AttributeError, ImportError):  # also with NUMBA_DISABLE_JIT
            return True

    def compile(self) -> None:
        """Compile it, or load what has been compiled; one that takes other arguments by now is left for when it is called."""
        with suppress(NumbaError):
            self.dispatcher.compile(self.types)


@cache
def listed() -> tuple[Kernel, ...]:
    """All that `kernels.json` lists."""
    return tuple(Kernel(k["name"], k["arguments"], tuple(k["after"]), k["ms"]) for k in json.loads(LIST.read_text()))


def show_progress(done: int, total: int) -> None:
    """Say how far it is, on stderr, where somebody may be watching.

    Parameters
    ----------
    done, total : functions.
    """
    if sys.stderr.isatty():
        print(f"\rcompiling, once: {done} of {total}", end="\n" if done == total else "", file=sys.stderr, flush=True)


def compile_ahead(progress: Progress | None = None, processes: int | None = None) -> int:
    """Compile what is not kept on disk yet.

    Parameters
    ----------
    progress : tells how far it is.
    processes : that compile, this one among them; None: one a processor, up to four, of half a gigabyte each.

    Returns
    -------
    How many functions there were to compile.
    """
    n = min(len(os.sched_getaffinity(0)), _MOST_PROCESSES) if processes is None else processes
    kernels = listed()
    missing = [i for i, kernel in enumerate(kernels) if not kernel.is_kept()]
    if missing:
        _together(_Work(kernels, missing, progress), n)
    return len(missing)


class _Work:
    """Who compiles what next; asked from several threads. Those go first behind which most is waiting."""

    def __init__(self, kernels: Sequence[Kernel], missing: Sequence[int], progress: Progress | None):
        self._progress, self._n, self._done = progress, len(missing), 0
        wanted = set(missing)
        self._waits = {i: {j for j in kernels[i].after if j in wanted} for i in missing}
        self._behind = {i: kernels[i].ms for i in missing}
        for i in reversed(missing):  # callers come after those that they call
            for j in self._waits[i]:
                self._behind[j] = max(self._behind[j], kernels[j].ms + self._behind[i])
        self._ready = [(-self._behind[i], i) for i in missing if not self._waits[i]]
        heapq.heapify(self._ready)
        self._changed = threading.Condition()
        self._at_work, self._stopped = 0, False

    def stop(self) -> None:
        """Nothing more is to be compiled."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def end(self) -> None:
        """The same from a signal's handler: the thread that it interrupts may hold the lock."""
        self._stopped = True

    def __iter__(self) -> Iterator[int]:
        """Places in the list, as they may be compiled; one is done when the next is asked for."""
        i: int | None = None
        while True:
            with self._changed:
                if i is not None:
                    self._finish(i)
                while not self._ready and self._at_work and not self._stopped:
                    self._changed.wait()
                if not self._ready or self._stopped:
                    return
                i = heapq.heappop(self._ready)[1]
                self._at_work += 1
            try:
                yield i
            except GeneratorExit:  # whoever has it could not: others are not to wait for it
                with self._changed:
                    self._finish(i)
                raise

    def _finish(self, i: int) -> None:
        self._at_work -= 1
        self._done += 1
        for other, waits in self._waits.items():
            if i in waits:
                waits.remove(i)
                if not waits:
                    heapq.heappush(self._ready, (-self._behind[other], other))
        self._changed.notify_all()
        if self._progress is not None:
            self._progress(self._done, self._n)


@contextmanager
def _interruptible(end: Callable[[], None]) -> Iterator[None]:
    """An interruption calls ``end`` and ends the block even where compiling has swallowed it, as callbacks from C do.

    What compiling then stumbles over is the interruption's, not an error of its own.
    """
    interrupted = False

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        end()
        signal.default_int_handler(number, frame)

    in_main = threading.current_thread() is threading.main_thread()
    if not in_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, handle)
    try:
        yield
    except Exception:
        if not interrupted:
            raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if interrupted:
        raise KeyboardInterrupt


def _together(work: _Work, processes: int) -> None:
    helpers = [threading.Thread(target=_by_helper, args=(work,)) for _ in range(processes - 1)]
    for helper in helpers:
        helper.start()
    try:
        with _interruptible(work.end):
            for i in work:
                listed()[i].compile()
    finally:  # also when interrupted
        work.stop()
        for helper in helpers:
            helper.join()


def _by_helper(work: _Work) -> None:
    """Have a process compile until nothing is left; one that ends before that leaves the rest to others."""
    command = [sys.executable, "-m", f"{__package__}.ahead"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        with suppress(OSError):
            for i in work:
                process.stdin.write(f"{i}\n")
                process.stdin.flush()
                if not process.stdout.readline():
                    return
        with suppress(OSError):
            process.stdin.close()
        process.wait(_PATIENCE_S)


def main() -> int:
    """Compile the functions whose places in the list come by standard input; each is answered by its place."""
    with suppress(KeyboardInterrupt, BrokenPipeError), _interruptible(lambda: None):  # who asks is interrupted as well, or gone
        for line in sys.stdin:
            listed()[int(line)].compile()
            os.write(sys.stdout.fileno(), f"{line.strip()}\n".encode())  # not buffered: nothing is left to be written at the end
    return 0


if __name__ == "__main__":
    sys.exit(main())
