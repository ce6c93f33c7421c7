"""Functions are compiled ahead: each after its callees, by several processes, and all that a tracker takes."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tracker_node.compiled import ahead
from tracker_node.compiled.ahead import Kernel, compile_ahead, listed

COMPILED = """
from numba.core import event
import tracker_node
from tracker_node.compiled.ahead import compile_ahead

class Listener(event.Listener):
    names = set()
    def on_start(self, event): pass
    def on_end(self, event):
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("tracker_node"):
            self.names.add(f"{function.__module__}.{function.__qualname__}")

event.register("numba:compile", Listener())
import sys
sys.path.insert(0, sys.argv[1])
import list_kernels
list_kernels._track()
print(*sorted(Listener.names))
"""


def test_the_list_names_functions_after_those_that_they_call():
    kernels = listed()
    assert len({(kernel.name, kernel.arguments) for kernel in kernels}) == len(kernels) > 100
    for place, kernel in enumerate(kernels):
        assert all(other < place for other in kernel.after)
        assert len(kernel.types) == kernel.dispatcher.py_func.__code__.co_argcount


@pytest.mark.long
def test_after_it_a_tracker_compiles_nothing(tmp_path):
    """Else the list is old: `tools/list_kernels.py` renews it."""
    tools, environment = Path(__file__).parents[2] / "tools", {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    made = subprocess.run(
        [sys.executable, str(tools / "compile_ahead.py")], env=environment, check=True, capture_output=True, text=True
    )
    assert made.stdout.startswith(f"{len(listed())} functions in ") and not made.stderr
    command = [sys.executable, "-c", COMPILED, str(tools)]
    assert subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.split() == []


def kernels(*after: tuple[int, ...], ms: int = 10) -> list[Kernel]:
    return [Kernel(f"module:f{i}", "()", each, ms) for i, each in enumerate(after)]


def test_callees_come_first_and_those_before_that_most_waits_for():
    told = []
    work = ahead._Work(kernels((), (), (1,), (2,), (0, 3)), range(5), lambda done, n: told.append((done, n)))
    assert list(work) == [1, 2, 0, 3, 4] or list(work) == [1, 2, 3, 0, 4]
    assert told == [(i, 5) for i in range(1, 6)]


def test_callees_that_are_kept_are_not_waited_for():
    assert list(ahead._Work(kernels((), (0,), (0, 1)), [2], None)) == [2]


def test_who_ends_early_leaves_the_rest_to_others():
    work, taken = ahead._Work(kernels((), (0,), (1,), (2,)), range(4), None), []
    first = iter(work)
    assert next(first) == 0
    other = threading.Thread(target=lambda: taken.extend(work))
    other.start()
    first.close()
    other.join(10.0)
    assert taken == [1, 2, 3] and not other.is_alive()


def test_nothing_more_is_taken_once_it_is_stopped():
    work = ahead._Work(kernels((), (0,), (1,)), range(3), None)
    taken = iter(work)
    assert next(taken) == 0
    work.stop()
    assert list(taken) == [] and list(work) == []


def test_an_interruption_ends_it_and_its_helpers(tmp_path):
    code = "from tracker_node.compiled.ahead import compile_ahead; print('begun', flush=True); compile_ahead(processes=2)"
    process = started(["-c", code], tmp_path)
    assert process.stdout.readline() == "begun\n"
    time.sleep(3.0)
    os.killpg(process.pid, signal.SIGINT)  # as the terminal does
    _, errors = process.communicate(timeout=20.0)
    assert errors.rstrip().endswith("KeyboardInterrupt") and process.returncode in (-signal.SIGINT, 130)


def test_an_interruption_that_compiling_swallows_ends_it_all_the_same(monkeypatch):
    compiled = []

    def swallowing(kernel):
        compiled.append(kernel)
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Kernel, "is_kept", lambda kernel: False)
    monkeypatch.setattr(Kernel, "compile", swallowing)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        compile_ahead(processes=1)
    assert len(compiled) == 1 and signal.getsignal(signal.SIGINT) is before


def test_what_compiling_stumbles_over_after_an_interruption_is_the_interruption(monkeypatch):
    def stumbling(kernel):
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(Kernel, "is_kept", lambda kernel: False)
    monkeypatch.setattr(Kernel, "compile", stumbling)
    with pytest.raises(KeyboardInterrupt):
        compile_ahead(processes=1)


def test_a_helper_that_is_interrupted_says_nothing(tmp_path):
    process = started(["-m", "tracker_node.compiled.ahead"], tmp_path)
    place = next(i for i, kernel in enumerate(listed()) if not kernel.after)
    process.stdin.write(f"{place}\n")
    process.stdin.flush()
    assert process.stdout.readline() == f"{place}\n"
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20.0)[1] == "" and process.returncode == 0


def test_a_helper_whose_asker_is_gone_says_nothing(tmp_path):
    process = started(["-m", "tracker_node.compiled.ahead"], tmp_path)
    process.stdout.close()
    process.stdin.write(f"{next(i for i, kernel in enumerate(listed()) if not kernel.after)}\n")
    process.stdin.close()
    assert process.stderr.read() == "" and process.wait(20.0) == 0


def started(arguments: list[str], cache: Path) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, *arguments], env={**os.environ, "NUMBA_CACHE_DIR": str(cache)}, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def test_what_is_gone_or_takes_other_arguments_by_now_is_left_out():
    gone = ("geometry.so3:nothing", "(float64,)"), ("nowhere:f", "()")
    for name, arguments in (*gone, ("geometry.so3:exp_kernel", "(float64, float64)")):
        assert Kernel(name, arguments, (), 1).is_kept()
    other = Kernel("geometry.so3:exp_kernel", "(float64,)", (), 1)
    other.compile()
    assert not other.is_kept()


@pytest.mark.parametrize(("watched", "said"), [(True, "\rcompiling, once: 1 of 2\rcompiling, once: 2 of 2\n"), (False, "")])
def test_progress_is_shown_to_who_may_be_watching(watched, said, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: watched)
    ahead.show_progress(1, 2)
    ahead.show_progress(2, 2)
    assert capsys.readouterr().err == said


def test_nothing_is_compiled_twice():
    assert ahead.compile_ahead(processes=1) >= 0
    assert ahead.compile_ahead(lambda done, n: pytest.fail("something was missing")) == 0
