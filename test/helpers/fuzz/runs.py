"""Reads fuzzed files in a process of its own and says how each was answered: refused in a message, the same again, or badly.

``python -m helpers.fuzz.runs FOLDER SEED KIND,KIND FIRST COUNT`` is that process: one line of JSON for each file before it is
read and one after. Its memory is limited; `run` ends it when a file takes longer than its limit.
"""

from __future__ import annotations

import json
import os
import queue
import random
import resource
import subprocess
import sys
import threading
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

TIME_LIMIT_S = 20.0  # for one file; the machine may be busy
MEMORY_LIMIT = 3 << 30  # bytes of address space, of which numba and its like take a good one before anything is read
TESTS = Path(__file__).resolve().parents[2]  # where `helpers` is found
START_LIMIT_S = 120.0


@dataclass
class Answers:
    """How files were answered; ``bad`` lists the others as texts."""

    total: int = 0
    refused: int = 0
    same: int = 0
    bad: list[str] = field(default_factory=list)
    by_kind: Counter = field(default_factory=Counter)
    say: Callable[[int], None] = lambda total: None  # told after each file

    @property
    def answered(self) -> int:
        return self.refused + self.same

    def add(self, kind: str, verdict: str, number: int) -> None:
        self.total += 1
        if verdict == "refused":
            self.refused += 1
            self.by_kind[kind, "refused"] += 1
        elif verdict == "same":
            self.same += 1
        else:
            self.bad.append(f"{kind} {number}: {verdict}")
        self.by_kind[kind, "total"] += 1
        self.say(self.total)


def judge(kind, path: Path, neutral: bool, valid) -> str:
    """``refused``, ``same``, or what is wrong with the answer to a file."""
    from helpers.fuzz.kinds import same
    from tracker_node.errors import FileFormatError, TrackerError

    try:
        value = kind.load(path)
    except FileFormatError as error:
        named = error.field or error.got == ""  # a field without a name is named by being empty
        if neutral:
            return f"refused, though it says the same: {error}"
        if str(path) not in str(error) or not named or "\n" in str(error) or len(str(error)) > 4000:
            return f"the message does not name file and field in one line: {str(error)[:300]}"
        return "refused"
    except TrackerError as error:
        return "refused" if str(path) in str(error) and not neutral else f"the message names no file: {str(error)[:300]}"
    except BaseException as error:
        return f"{type(error).__name__}: {str(error)[:200]} at {_place(error)}"
    return _judge_value(kind, value, path, same, valid if neutral else None)


def _judge_value(kind, value, path: Path, same: Callable, valid) -> str:
    try:
        kind.check(value)
        if valid is not None:
            assert same(value, valid), "not what the valid file says"
        if kind.dump is not None:
            copy = path.with_name(f"copy_{path.name}")
            kind.dump(value, copy)
            assert same(kind.load(copy), value), "not the same when written and read again"
    except BaseException as error:
        return f"accepted, but {type(error).__name__}: {str(error)[:200]} at {_place(error)}"
    return "same"


def _place(error: BaseException) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{Path(last.filename).name}:{last.lineno}"


def case(kind, seed: int, number: int) -> tuple[bytes, bool]:
    """File ``number`` of a kind."""
    return kind.case(random.Random(f"{seed} {kind.name} {number}"))


def kinds(folder: Path) -> dict:
    from helpers.fuzz.kinds import core_kinds, other_kinds, point_kinds

    return {kind.name: kind for kind in [*core_kinds(folder), *other_kinds(folder), *point_kinds(folder)]}


def child(folder: Path, seed: int, names: Sequence[str], first: int, count: int, memory_limit: int | None = MEMORY_LIMIT) -> None:
    """Read files of these kinds in turn, and say how it went."""
    chosen = {name: kind for name, kind in kinds(folder).items() if name in names}
    valid = {}
    for name, kind in chosen.items():
        path = folder / f"valid_{name}{kind.suffix}"
        path.write_bytes(kind.content)
        valid[name] = kind.load(path)
    if memory_limit is not None:
        resource.setrlimit(resource.RLIMIT_AS, (memory_limit, memory_limit))
    for number in range(first, first + count):
        kind = chosen[names[number % len(names)]]
        content, neutral = case(kind, seed, number)
        path = folder / f"fuzzed_{kind.name}{kind.suffix}"
        path.write_bytes(content)
        print(json.dumps([number]), flush=True)
        print(json.dumps([number, judge(kind, path, neutral, valid[kind.name])]), flush=True)


def run(folder: Path, seed: int, names: Sequence[str], count: int, answers: Answers) -> None:
    """Read ``count`` files of these kinds in turn, each within its time."""
    folder.mkdir(parents=True, exist_ok=True)
    number = 0
    while number < count:
        number = _run_child(folder, seed, names, number, count, answers)


def _run_child(folder: Path, seed: int, names: Sequence[str], first: int, count: int, answers: Answers) -> int:
    """Runs until all are read, or one has taken too long or killed its reader; the number of the next."""
    command = [sys.executable, "-m", __name__, str(folder), str(seed), ",".join(names), str(first), str(count - first)]
    environment = {**os.environ, "PYTHONPATH": str(TESTS), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
    lines: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_pass_on, args=(process.stdout, lines), daemon=True).start()
    number, limit_s = first, START_LIMIT_S
    try:
        while number < count:
            line = lines.get(timeout=limit_s)
            if not line:
                answers.add(names[number % len(names)], f"the process ended with status {process.wait()}", number)
                return number + 1
            limit_s, message = TIME_LIMIT_S, json.loads(line)
            if len(message) == 2:
                answers.add(names[number % len(names)], message[1], number)
                number = message[0] + 1
    except queue.Empty:
        answers.add(names[number % len(names)], f"no answer within {limit_s:g} s", number)
        return number + 1
    finally:
        process.kill()
        process.wait()
    return number


def _pass_on(stream, lines: queue.Queue) -> None:
    for line in stream:
        lines.put(line)
    lines.put("")


if __name__ == "__main__":
    child(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3].split(","), int(sys.argv[4]), int(sys.argv[5]))
