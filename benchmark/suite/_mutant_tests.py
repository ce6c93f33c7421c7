"""Which tests run which functions, and which modules: the nearest tests of a module are tried first.

What imports what is read from the sources (`Imports`). What a test runs is seen by running its file once, unchanged, with a
trace of calls (`Recorder`); functions run while a file is loaded, or fixtures are made, count for every test of the file.
Functions that numba compiles are not seen: those that call them by name stand for them (`users_of_kernels`). Nor is what a
module does that is run as a program: any test that runs something of it stands for that (`is_program`).
"""

from __future__ import annotations

import ast
import json
import re
import sys
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

PACKAGE = "tracker_node"
_COMPILED = ("compiled", "pixel_function", "pixel_loop")


class Imports:
    """Who imports whom: modules of the package, tests, and the helpers that these import by their plain names."""

    def __init__(self, root: Path):
        folders = [root / name for name in (PACKAGE, "test", "benchmark")]
        self.files = {path.relative_to(root).as_posix() for folder in folders for path in folder.rglob("*.py")}
        self.trees = {name: ast.parse((root / name).read_bytes()) for name in sorted(self.files)}
        self.imported = {name: self._of(name) for name in self.files}
        self._words: dict[str, set[str]] = {}
        self._importers: dict[str, set[str]] = {name: set() for name in self.files}
        for name, others in self.imported.items():
            for other in others:
                self._importers[other].add(name)

    def distances(self, module: str) -> dict[str, int]:
        """How many imports lead from a file to the module, for all that it can be reached from."""
        found, queue = {module: 0}, deque([module])
        while queue:
            name = queue.popleft()
            for importer in self._importers[name]:
                if importer not in found:
                    found[importer] = found[name] + 1
                    queue.append(importer)
        return found

    def test_files(self, module: str) -> list[str]:
        """Files of tests that reach the module, nearest first.

        First those of its name; then by the imports between, of which the share of the words of its name and of what it defines
        that a file says makes up for two: a command is one import away from every file that runs any command.
        """
        stem = Path(module).stem.strip("_")
        same_place = Path(module).parts[1]

        def order(item: tuple[str, int]) -> tuple[int, float, int, str]:
            name, distance = item
            alike = 0 if Path(name).stem == f"test_{stem}" else 1 if stem in name else 2
            return alike, distance - 2.0 * self._said(module, name), 0 if same_place == Path(name).parts[1] else 1, name

        distances = self.distances(module)
        tests = {n: d for n, d in distances.items() if n.startswith("test/") and Path(n).name.startswith("test_")}
        return [name for name, _ in sorted(tests.items(), key=order)]

    def _said(self, module: str, test: str) -> float:
        """The share of the words of a module's name, or of the names that it defines, that a file of tests says."""
        words = set(Path(module).stem.strip("_").split("_"))
        defined = {n.name for n in self.trees[module].body if isinstance(n, (ast.FunctionDef, ast.ClassDef)) and n.name[0] != "_"}
        shares = [len(these & self._words_of(test)) / len(these) for these in (words, defined) if these]
        return max(shares)

    def _words_of(self, name: str) -> set[str]:
        """Names that a file uses, the words of these, and those of its texts."""
        if name not in self._words:
            tree = self.trees[name]
            used = {
                n.attr if isinstance(n, ast.Attribute) else n.id
                for n in ast.walk(tree)
                if isinstance(n, (ast.Attribute, ast.Name))
            }
            texts = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
            self._words[name] = used | {
                word for text in (*used, *texts, Path(name).stem) for word in re.findall(r"[a-z0-9]+", text)
            }
        return self._words[name]

    def _of(self, name: str) -> set[str]:
        found: set[str] = set()
        parts = Path(name).with_suffix("").parts
        for node in ast.walk(self.trees[name]):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    found |= self._file(alias.name.split("."))
            elif isinstance(node, ast.ImportFrom):
                base = list(parts[: len(parts) - node.level]) if node.level else []
                base += (node.module or "").split(".") if node.module else []
                found |= self._file(base)
                for alias in node.names:
                    found |= self._file([*base, alias.name])
            elif isinstance(node, ast.JoinedStr) and isinstance(node.values[0], ast.Constant):  # import_module(f"...")
                prefix = str(node.values[0].value)
                if prefix.startswith(f"{PACKAGE}."):
                    found |= {other for other in self.files if other.replace("/", ".").startswith(prefix)}
        return found - {name}

    def _file(self, parts: list[str]) -> set[str]:
        path = "/".join(parts)
        options = (f"{path}.py", f"{path}/__init__.py", f"test/{path}.py", f"benchmark/{path}.py")
        return {one for one in options if one in self.files}


def compiled_functions(tree: ast.Module) -> set[str]:
    """Names of a module's functions that numba compiles."""
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return {f.name for f in functions if any(word in ast.unparse(d) for d in f.decorator_list for word in _COMPILED)}


def is_program(tree: ast.Module) -> bool:
    """Whether a module can be run by itself: what it does in a process of its own is not seen, and taken to be all of it."""
    return any(isinstance(node, ast.If) and "__name__" in ast.unparse(node.test) for node in tree.body)


def users_of_kernels(imports: Imports) -> dict[tuple[str, str], set[tuple[str, str]]]:
    """Of each compiled function, (file, name): the functions, not compiled, that use it, directly or not; those of tests, too."""
    compiled = {name: compiled_functions(tree) for name, tree in imports.trees.items() if name.startswith(PACKAGE)}
    uses: dict[tuple[str, str], set[tuple[str, str]]] = {}
    for name in (*compiled, *(name for name in imports.trees if name.startswith("test/"))):
        for function, words in _words(imports.trees[name]).items():
            for other in (name, *imports.imported[name]):
                for kernel in compiled.get(other, set()) & words:
                    uses.setdefault((other, kernel), set()).add((name, function))
    result: dict[tuple[str, str], set[tuple[str, str]]] = {}
    for kernel in ((name, f) for name, functions in compiled.items() for f in functions):
        seen, queue = {kernel}, deque([kernel])
        while queue:
            for user in uses.get(queue.popleft(), set()) - seen:
                seen.add(user)
                queue.append(user)
        result[kernel] = {(name, function) for name, function in seen if function not in compiled.get(name, ())}
    return result


def _words(tree: ast.Module) -> dict[str, set[str]]:
    """The names that each function of a module uses; methods by their qualified name, the module's own code as ''."""
    found: dict[str, set[str]] = {}
    for node in tree.body:
        members = [(f"{node.name}.", m) for m in node.body] if isinstance(node, ast.ClassDef) else [("", node)]
        for prefix, member in members:
            name = prefix + member.name if isinstance(member, (ast.FunctionDef, ast.AsyncFunctionDef)) else ""
            words = {n.id for n in ast.walk(member) if isinstance(n, ast.Name)}
            found.setdefault(name, set()).update(words | {n.attr for n in ast.walk(member) if isinstance(n, ast.Attribute)})
    return found


class Recorder:
    """A plugin for pytest: seconds, outcome and functions of each test, as a JSON file."""

    def __init__(self, root: Path, out: Path):
        self._prefix, self._out = f"{root}/", out
        self._package = f"{root}/{PACKAGE}/"
        self._seen: set[Any] = set()
        self._tests: dict[str, dict[str, Any]] = {}
        self._fixtures: set[str] = set()

    def pytest_sessionstart(self) -> None:
        threading.settrace(self._trace)
        sys.settrace(self._trace)

    def _trace(self, frame: Any, event: str, arg: Any) -> None:
        self._seen.add(frame.f_code)

    def pytest_runtest_logstart(self, nodeid: str, location: Any) -> None:
        self._fixtures |= self._taken()  # what is run when a file is loaded is there for all of its tests
        self._began = time.process_time()

    def pytest_runtest_logreport(self, report: Any) -> None:
        functions = self._taken()
        one = self._tests.setdefault(report.nodeid, {"seconds": 0.0, "passed": True, "functions": []})
        if report.when == "call":
            one["functions"] = sorted(functions)
            one["passed"] = one["passed"] and report.passed
        else:
            self._fixtures |= functions
            one["passed"] = one["passed"] and not (report.failed or report.skipped)
        one["seconds"] += time.process_time() - self._began
        self._began = time.process_time()

    def _taken(self) -> set[str]:
        codes, self._seen = self._seen, set()
        inside = [c for c in codes if c.co_filename.startswith(self._package)]
        return {f"{c.co_filename.removeprefix(self._prefix)}::{outermost(c.co_qualname)}" for c in inside}

    def pytest_sessionfinish(self) -> None:
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
        self._out.write_text(json.dumps({"tests": self._tests, "fixtures": sorted(self._fixtures)}))


def outermost(qualified: str) -> str:
    """The function of a module or class that code lies in: `A.f.<locals>.g` lies in `A.f`."""
    return qualified.partition(".<locals>")[0]
