#!/usr/bin/env python3
"""How many of the declared parameters do nothing: those whose test sees no difference for any other value.

Runs ``test/tracking/test_parameters_count.py``, which tracks short clips with another value of each parameter and compares what
the tracker says to the last bit; a list there has the parameters that cannot show, each with its reason.
``house.tried_parameters`` are those that were tried, ``house.exempt_parameters`` those of that list. ``--quick`` tries every
twelfth.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour._runs import print_circumstances

ROOT = Path(__file__).resolve().parents[2]
FILE = "test/tracking/test_parameters_count.py"
TEST = "test_another_value_changes_what_is_said"
QUICK_STEP = 12


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    names = tests_of(FILE)[:: QUICK_STEP if args.quick else 1]
    inert, tried = failed_tests(names)
    print_circumstances()
    print(*inert, sep="\n")
    figures = {
        "house.inert_parameters": len(inert), "house.tried_parameters": tried, "house.exempt_parameters": exempt_parameters(),
    }  # fmt: skip
    report_metrics(figures, args.json)
    return 0


def tests_of(file: str) -> list[str]:
    """Names of the tests of a file that try one parameter each, as pytest takes them."""
    with tempfile.TemporaryDirectory(prefix="parameters-") as folder:
        listed = _pytest(Path(folder), "--collect-only", file)
    return [line for line in listed.stdout.splitlines() if f"::{TEST}[" in line]


def failed_tests(names: Sequence[str]) -> tuple[list[str], int]:
    """Run tests; names of those that failed, and how many ran.

    Raises
    ------
    RuntimeError : the tests did not end.
    """
    with tempfile.TemporaryDirectory(prefix="parameters-") as folder:
        report = Path(folder) / "report.xml"
        done = _pytest(Path(folder), "-n", "2", f"--junitxml={report}", *names)
        if done.returncode not in (0, 1):
            raise RuntimeError(f"expected tests that pass or fail, got status {done.returncode}: {done.stdout[-2000:]}")
        return outcomes(report)


def _pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run pytest with a cache of its own: it may itself be run by a test."""
    command = [sys.executable, "-m", "pytest", "-q", "-o", f"cache_dir={folder / 'cache'}", *arguments]
    return subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True)


def outcomes(report: Path) -> tuple[list[str], int]:
    """Names of the tests of a JUnit report that failed, and how many there are."""
    cases = list(ElementTree.parse(report).iter("testcase"))
    failed = [case.get("name", "") for case in cases if case.find("failure") is not None or case.find("error") is not None]
    return failed, len(cases)


def exempt_parameters(file: Path = ROOT / FILE) -> int:
    """How many parameters the test's list has."""
    assigned = [node for node in ast.parse(file.read_text()).body if isinstance(node, ast.Assign)]
    (listed,) = (node.value for node in assigned if ast.unparse(node.targets[0]) == "WITHOUT_EFFECT")
    return len(ast.literal_eval(listed))


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/suite/parameters.py --json out/benchmark/parameters.json", f"every {QUICK_STEP}th parameter"
    )
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
