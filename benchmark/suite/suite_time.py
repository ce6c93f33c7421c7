#!/usr/bin/env python3
"""How long `make test` takes on two cores: a clean clone of what is committed, after `make setup`, nothing compiled yet.

Processor time of all processes stands beside it: half of it is what two cores of one's own would take at the least, whatever else
the machine does now. ``--quick`` times `make lint` and one folder of tests in this tree, with what is compiled already.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour._runs import print_circumstances

ROOT = Path(__file__).resolve().parents[2]
CACHES = ("NUMBA_CACHE_DIR", "MAKEFLAGS", "MAKELEVEL")  # not inherited: the clone has caches of its own


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    if args.quick:
        status, figures = timed(["make", "test", "PYTEST_ARGS=test/geometry"], ROOT, prefix="test.quick_")
    else:
        with tempfile.TemporaryDirectory(prefix="suite_time-", dir=args.work) as folder:
            clone = Path(folder) / "tracker_node"
            subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
            subprocess.run(["make", "setup"], cwd=clone, check=True, env=environment())
            status, figures = timed(["make", "test"], clone, prefix="test.")
    print_circumstances()
    print(f"load of the machine: {os.getloadavg()[1]:.1f} in the last five minutes")
    report_metrics(figures, args.json)
    return 1 if status else 0


def timed(command: Sequence[str], folder: Path, prefix: str) -> tuple[int, dict[str, float]]:
    """Run a command on two cores; its exit status, its minutes and those of the processors."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    cores = sorted(os.sched_getaffinity(0))[:2]
    done = subprocess.run(command, cwd=folder, check=False, env=environment(), preexec_fn=lambda: os.sched_setaffinity(0, cores))
    wall_s, after = time.monotonic() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.returncode, {
        f"{prefix}minutes": wall_s / 60.0,
        f"{prefix}cpu_minutes": cpu_s / 60.0,
        f"{prefix}exit_status": done.returncode,
    }


def environment() -> dict[str, str]:
    """That of this process without what would share its caches."""
    return {name: value for name, value in os.environ.items() if name not in CACHES}


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/suite/suite_time.py --json out/benchmark/suite_time.json", "one folder of tests, in this tree"
    )
    parser.add_argument("--work", type=Path, metavar="FOLDER", help="where the clone is made; default: the temporary folder")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
