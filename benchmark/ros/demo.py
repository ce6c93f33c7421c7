#!/usr/bin/env python3
"""What a newcomer would take for an alarm in a run where all is well: warnings of the demo, printed, logged or on /diagnostics.

`tracker_node demo` runs as a user runs it. Counted are lines at WARN or above of all its processes, warnings of Python,
tracebacks, and parts of /diagnostics that were at another level than OK at any time of the recording. Quick: a pipeline that
records everything of a short rendered clip.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import Request, produce, show_progress

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour.accuracy import DEFAULT_CACHE

N_IMAGES = 30  # the quick cones of contour_accuracy.py
ALARM = re.compile(r"\[(WARN|ERROR|FATAL)\]|Warning:|Traceback \(most recent call last\)|^[\w ]+: (warning|error):")
RECORDED = ("--masks", "--overlays", "--markers", "--images")
PATIENCE_S = 3600.0  # inner loops may have to be compiled


def main() -> int:
    args = _arguments()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    began = time.monotonic()
    try:
        with tempfile.TemporaryDirectory(prefix="demo-") as folder:
            lines = run(_quick(args.cache, Path(folder)) if args.quick else ["demo", "--output", folder])
            logged = alarms(lines)
            diagnosed = troubled_parts(Path(folder) / "bag")
    except TrackerError as error:
        print(f"demo: error: {error}", file=sys.stderr)
        return 2
    for text in (*logged, *diagnosed):
        print(text, file=sys.stderr)
    figures = {
        "demo.warnings": len(logged) + len(diagnosed),
        "demo.warnings_logged": len(logged),
        "demo.warnings_of_diagnostics": len(diagnosed),
        "demo.wall_s": time.monotonic() - began,
    }
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "python benchmark/ros/demo.py --quick --json out/benchmark/demo.json",
        "a rendered clip through the pipeline instead of the demo",
    )
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    return parser.parse_args()


def _quick(cache: Path, folder: Path) -> list[str]:
    clip = cache / f"cones-{N_IMAGES}"
    produce(Request(subject="model", motion="waves", n_images=N_IMAGES), clip, progress=show_progress)
    files = ["--rig", str(clip / "rig.yaml"), "--model", str(clip / "person.yaml"), "--initial-state", str(clip / "state.yaml")]
    return ["pipeline", *files, "--output", str(folder), *RECORDED]


def run(arguments: list[str]) -> list[str]:
    """All lines that a verb and the processes that it starts print.

    Raises
    ------
    TrackerError : it fails.
    """
    command = [sys.executable, "-m", "tracker_node.cli.main", *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE_S)
    if done.returncode:
        raise TrackerError(f"{' '.join(arguments)} ended with status {done.returncode}:\n{done.stdout}")
    return done.stdout.splitlines()


def alarms(lines: list[str]) -> list[str]:
    """Lines that tell of trouble."""
    return [line for line in lines if ALARM.search(line)]


def troubled_parts(bag: Path) -> list[str]:
    """Each part of the recorded /diagnostics that was not OK at some time, with the worst that it said."""
    worst: dict[str, tuple[int, str]] = {}
    with BagReader(bag) as reader:
        for _, message in reader.decoded("/diagnostics"):
            for status in message.status:
                level = status.level if isinstance(status.level, int) else ord(status.level)
                if level > worst.get(status.name, (0, ""))[0]:
                    worst[status.name] = level, status.message
    return [f"/diagnostics {name}: level {level}, {said}" for name, (level, said) in sorted(worst.items())]


if __name__ == "__main__":
    sys.exit(main())
