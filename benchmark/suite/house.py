#!/usr/bin/env python3
"""How large the code and its documentation are, how much of it is documented, and how long `import tracker_node` takes.

``house.modules`` and ``house.lines``: ``.py`` in `tracker_node`, lines of all of them, ``__init__`` not counted as modules.
``house.largest_folder``: most ``.py`` files directly in one folder of `tracker_node`, `test` or `benchmark`.
``house.documented_public``: fraction of the public functions and methods of two or more arguments whose docstring has
Parameters and, where something is returned, Returns; methods that override those of a base class are not counted.
``docs.pages``, ``docs.words``: ``docs/*.md`` and the README without generated pages. ``api.script_lines``: lines of the script
in the README, blank ones left out. ``phone.tutorial_commands``: from videos of phones to a report, in docs/tutorial.md.
``start.import_s``: median of fresh processes from their start to their end;
``start.import_in_numpy`` is that over the median of ``import numpy``. ``--quick`` starts fewer processes.
"""

from __future__ import annotations

import argparse
import ast
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour._runs import print_circumstances
from tools.check_docstrings import overriding

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("tracker_node", "test", "benchmark")
GENERATED = "<!-- Generated"  # how such a page begins
STARTS, QUICK_STARTS = 21, 5

Function = ast.FunctionDef | ast.AsyncFunctionDef


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    files = python_files(ROOT / "tracker_node")
    inherited = overriding(files)
    functions = [function for file in files for function in public_functions(file, inherited)]
    pages = pages_of(ROOT)
    largest, n_files = largest_folder(ROOT)
    own_s, numpy_s = import_times_s(("tracker_node", "numpy"), QUICK_STARTS if args.quick else STARTS)
    figures: dict[str, float | int] = {
        "house.modules": sum(file.name != "__init__.py" for file in files),
        "house.lines": sum(len(file.read_text().splitlines()) for file in files),
        "house.largest_folder": n_files,
        "house.public_functions": len(functions),
        "house.documented_public": sum(map(is_documented, functions)) / len(functions),
        "docs.pages": len(pages),
        "docs.words": sum(len(page.read_text().split()) for page in pages),
        "api.script_lines": script_lines((ROOT / "README.md").read_text()),
        "phone.tutorial_commands": tutorial_commands(ROOT),
        "start.import_s": own_s,
        "start.import_in_numpy": own_s / numpy_s,
    }
    print_circumstances()
    print(f"largest folder: {largest.relative_to(ROOT)}")
    report_metrics(figures, args.json)
    return 0


def tutorial_commands(root: Path) -> int:
    """Commands of the tutorial's section with phones; a test runs them."""
    section = re.search(r"^## With phones\n(.*?)(?=^## |\Z)", (root / "docs/tutorial.md").read_text(), re.MULTILINE | re.DOTALL)
    if section is None:
        raise ValueError("expected a section 'With phones' in docs/tutorial.md, got none")
    return len(re.findall(r"^    tracker_node ", section[1], re.MULTILINE))


def python_files(folder: Path) -> list[Path]:
    """The ``.py`` files below a folder."""
    return sorted(path for path in folder.rglob("*.py") if "__pycache__" not in path.parts)


def largest_folder(root: Path) -> tuple[Path, int]:
    """The folder below `FOLDERS` with the most ``.py`` files directly in it, and their number."""
    folders = [file.parent for name in FOLDERS for file in python_files(root / name)]
    largest = max(folders, key=folders.count)
    return largest, folders.count(largest)


def public_functions(file: Path, inherited: frozenset[tuple[str, str]] = frozenset()) -> Iterator[Function]:
    """Functions, and methods of public classes, without a leading underscore, of two or more arguments beside ``self``.

    Parameters
    ----------
    file : of Python.
    inherited : (class, method) that a base class documents, which are left out.

    Yields
    ------
    Nodes of the syntax tree.
    """
    yield from _public(ast.parse(file.read_text()).body, "", inherited)


def _public(body: list[ast.stmt], in_class: str, inherited: frozenset[tuple[str, str]]) -> Iterator[Function]:
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from _public(node.body, node.name, inherited)
        elif isinstance(node, Function) and not node.name.startswith("_") and (in_class, node.name) not in inherited:
            bound = bool(in_class) and not any(ast.unparse(d) == "staticmethod" for d in node.decorator_list)
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            if len(arguments) - bound + (node.args.vararg is not None) + (node.args.kwarg is not None) >= 2:
                yield node


def is_documented(function: Function) -> bool:
    """Whether the docstring has the section Parameters and, where something is returned, Returns or Yields."""
    text = ast.get_docstring(function) or ""
    return _has_section(text, "Parameters") and (
        not _returns(function) or _has_section(text, "Returns") or _has_section(text, "Yields")
    )


def _returns(function: Function) -> bool:
    return function.returns is not None and ast.unparse(function.returns) not in ("None", "NoReturn", "Never", "Iterator[None]")


def _has_section(text: str, name: str) -> bool:
    return re.search(rf"^{name}\n-{{{len(name)}}}$", text, re.MULTILINE) is not None


def pages_of(root: Path) -> list[Path]:
    """The README and the pages of the documentation that people write."""
    pages = [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    return [page for page in pages if not page.read_text().startswith(GENERATED)]


def script_lines(readme: str) -> int:
    """Lines of the first block of Python on a page, blank ones left out."""
    found = re.search(r"^```python\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    if found is None:
        raise ValueError("expected a page with a block of Python, got none")
    return sum(bool(line.strip()) for line in found[1].splitlines())


def import_times_s(modules: tuple[str, ...], starts: int) -> list[float]:
    """Median seconds that fresh processes take to import each module, in turn; one start of each before counts for nothing."""
    times: dict[str, list[float]] = {module: [] for module in modules}
    for _ in range(starts + 1):
        for module in modules:
            began = time.perf_counter()
            subprocess.run([sys.executable, "-c", f"import {module}"], check=True, cwd=ROOT)
            times[module].append(time.perf_counter() - began)
    return [statistics.median(found[1:]) for found in times.values()]


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/suite/house.py --json out/benchmark/house.json", f"{QUICK_STARTS} starts instead of {STARTS}"
    )
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
