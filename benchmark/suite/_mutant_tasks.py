"""The tests to be tried on each planted fault, by what was measured of them, in the order in which they are."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from benchmark.suite._mutant_tests import PACKAGE, Imports, compiled_functions, is_program, users_of_kernels
from benchmark.suite._mutation import Mutant

TEST_S = 20.0  # seconds of tests after which no more are begun on a fault


def measured_file(folder: Path, root: Path, file: str) -> Path:
    """Where the tests of a file are kept that were measured once, as long as it is the same."""
    return folder / f"measured/{file.replace('/', '-')}.{hashlib.sha256((root / file).read_bytes()).hexdigest()[:12]}.json"


def tasks_of(
    drawn: list[Mutant], chosen: dict[str, list[str]], imports: Imports, root: Path, folder: Path
) -> list[dict[str, Any]]:
    """What is to be tried on each fault; ``chosen``: of each module the files of tests, measured before."""
    users = users_of_kernels(imports)
    compiled = {name for name, tree in imports.trees.items() if name.startswith(PACKAGE) and compiled_functions(tree)}
    tasks = []
    for one in drawn:
        kernel = one.path in compiled and (one.function in compiled_functions(imports.trees[one.path]) or not one.function)
        stale = sorted(compiled & set(imports.distances(one.path)) - {one.path}) if kernel or not one.function else []
        anywhere = not one.function or kernel or is_program(imports.trees[one.path])
        functions = None if anywhere else {f"{one.path}::{one.function}"}
        if kernel and one.function:
            functions = {f"{file}::{name}" for file, name in users[one.path, one.function] if name}
        measured = {file: json.loads(measured_file(folder, root, file).read_text()) for file in chosen[one.path]}
        tests, left_out, seconds = _tests(one, functions, measured, imports)
        tasks.append({"mutant": one, "tests": tests, "left_out": left_out, "seconds": seconds, "stale": stale,
                      "compiling": one.path in compiled or bool(stale)})  # fmt: skip
    return tasks


def _tests(
    mutant: Mutant, functions: set[str] | None, measured: dict[str, Any], imports: Imports
) -> tuple[list[list[str]], int, float]:
    """Groups of tests to try one after the other, how many were left out, and seconds of all that are tried."""
    stem = Path(mutant.path).stem.strip("_")
    distances = imports.distances(mutant.path)
    found: list[tuple[int, float, str]] = []
    for file, content in measured.items():
        everywhere = set(content["fixtures"])
        near = 0 if Path(file).stem == f"test_{stem}" else 1 if distances[file] <= 1 else 2
        here = [name for one in content["tests"].values() for name in one["functions"]]
        calls = functions is not None and any(name.startswith(f"{file}::") for name in functions)  # a kernel, itself
        for test, one in content["tests"].items():
            ran = everywhere.union(one["functions"]) if near else everywhere.union(here)  # what tests of a file keep for others
            inside = any(name.startswith(f"{mutant.path}::") for name in ran) if functions is None else bool(functions & ran)
            if one["passed"] and (inside or calls):
                found.append((near, one["seconds"], test))
    groups: list[list[str]] = [[], [], []]
    total = 0.0
    left_out = 0
    for near, seconds, test in sorted(found):
        if total > TEST_S or seconds > 3.0 * TEST_S:
            left_out += 1
            continue
        total += seconds
        groups[near].append(test)
    return [group for group in groups if group], left_out, total
