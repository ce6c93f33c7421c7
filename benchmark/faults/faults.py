#!/usr/bin/env python3
"""What happens when something breaks: faults injected into a running graph of real processes, and 11 000 files gone wrong.

Each drill starts a small graph (three cameras of a moving arm, the tracker, a recorder or player where they matter), injects one
fault, and compares what happens, and what /diagnostics says of it, with what is expected. docs/troubleshooting.md has the table.

Each fuzzed file is read in another process, with limits of time and memory. It must be refused by one line that names file and
field, or hold something that can be used (finite, cameras that project, bodies that can be posed) and is the same when it is
written and read again; files that only write the same in another way must be read as the same. The seed is fixed.

`fuzz.*` are files of rigs, bodies, robot descriptions, parameters, recordings and states, `fuzz_others.*` a tenth as many of
OpenCV's storages, meshes, clicks and tables, on top. Exit status 1 when a drill is not as expected or a file is not answered;
drills that cannot be run here are `faults.skipped`.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from helpers.fuzz.runs import Answers, run
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

SEED, N_FILES = 6, 10_000
CORE = ("rig", "rig_file", "model", "slides", "part", "config", "plain_config", "recording", "state", "urdf")
OTHERS = ("opencv_yaml", "opencv_xml", "opencv_json", "mesh", "clicks", "control_points", "places", "stamps", "markers", "table")
OTHERS_SHARE = 0.1  # of the number of the others, on top
PARTS = ("drills", "fuzz")


def fuzz(n_files: int, seed: int) -> dict[str, float | int]:
    """Read so many files, and a tenth of the other kinds on top; the metrics."""
    metrics: dict[str, float | int] = {}
    print(f"fuzzed files (seed {seed}): kind, refused, of")
    for group, names, count in (("fuzz", CORE, n_files), ("fuzz_others", OTHERS, round(OTHERS_SHARE * n_files))):
        answers = Answers(say=lambda n: print(f"{n} files", file=sys.stderr) if n % 1000 == 0 else None)
        with tempfile.TemporaryDirectory(prefix="fuzz_") as folder:
            run(Path(folder), seed, names, count, answers)
        for name in names:
            print(f"  {name:16} {answers.by_kind[name, 'refused']:6} {answers.by_kind[name, 'total']:6}")
        for text in answers.bad:
            print(f"  not answered: {text}")
        metrics[f"{group}.answered"], metrics[f"{group}.total"] = answers.answered, answers.total
        metrics[f"{group}.refused_percent"] = 100.0 * answers.refused / max(answers.total, 1)
    return metrics


def drills() -> tuple:
    """All of them; they need ROS."""
    from benchmark.faults._file_drills import DRILLS as FILE_DRILLS
    from benchmark.faults._image_drills import DRILLS as IMAGE_DRILLS
    from benchmark.faults._process_drills import DRILLS as PROCESS_DRILLS
    from benchmark.faults._request_drills import DRILLS as REQUEST_DRILLS
    from benchmark.faults._stream_drills import DRILLS as STREAM_DRILLS

    return (*PROCESS_DRILLS, *REQUEST_DRILLS, *IMAGE_DRILLS, *FILE_DRILLS, *STREAM_DRILLS)


def drill(only: list[str]) -> dict[str, float | int]:
    """Inject the faults one after the other; the metrics."""
    from benchmark.faults._graph import recorded_and_ros, run_drill

    chosen = [one for one in drills() if not only or any(text in one.name for text in only)]
    n_expected = n_run = n_skipped = 0
    print("| fault | expected | seen | data lost | verdict |\n|---|---|---|---|---|")
    with recorded_and_ros() as recording:
        for one in chosen:
            began = time.monotonic()
            outcome = run_drill(one, recording)
            verdict = "skipped" if outcome.skipped else "as expected" if outcome.expected else "NOT AS EXPECTED"
            n_run += not outcome.skipped
            n_skipped += outcome.skipped
            n_expected += outcome.expected and not outcome.skipped
            print(f"| {one.name} | {one.expected} | {outcome.seen} | {outcome.lost} | {verdict} |", flush=True)
            print(f"{one.name}: {time.monotonic() - began:.1f} s", file=sys.stderr)
    return {"faults.as_expected": n_expected, "faults.total": n_run, "faults.skipped": n_skipped}


def all_as_expected(metrics: dict[str, float | int]) -> bool:
    """Whether each drill that was run went as expected, and each file was answered."""
    good = {"faults.as_expected": "faults.total", "fuzz.answered": "fuzz.total", "fuzz_others.answered": "fuzz_others.total"}
    return all(metrics.get(part) == metrics.get(whole) for part, whole in good.items())


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="example:\n  python benchmark/faults/faults.py --json out/benchmark/faults.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="a tenth of the files")
    parser.add_argument("--only", choices=PARTS, help="drills or fuzzed files alone")
    parser.add_argument("--drills", nargs="+", default=[], metavar="TEXT", help="only drills whose name has one of these texts")
    parser.add_argument("--files", type=int, default=N_FILES, metavar="N", help="fuzzed files (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=SEED, metavar="N", help="of the fuzzed files (default: %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    args = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    metrics: dict[str, float | int] = {}
    if args.only != "fuzz":
        metrics |= drill(args.drills)
    if args.only != "drills":
        metrics |= fuzz(args.files // 10 if args.quick else args.files, args.seed)
    report_metrics(metrics, args.json)
    return 0 if all_as_expected(metrics) else 1


if __name__ == "__main__":
    sys.exit(main())
