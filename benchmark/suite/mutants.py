#!/usr/bin/env python3
"""How many planted faults the tests notice: each small fault is tried against the tests that run the function it is in.

Equally many faults are drawn by a seed from each module of `NAMED`, whose faults cost users most, and from other modules that the
seed draws. A fault counts as noticed when a test of `make test` (not `long`, not `ros`) fails or does not end. The tests tried
are those that run the faulty function, from the `--files` files of tests nearest to the module (by name, then by the fewest
imports between and by what they say), the nearest and shortest first, for about twenty seconds in all; where a fault survives
these, those of `--further` files more. Tests that do not pass without a fault are not used. The share is a lower bound: tests
farther off are not asked.

Faults that change nothing that could be seen are listed with their reasons in `suite/_equivalent_mutants.py`, and are left out.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.suite._equivalent_mutants import EQUIVALENT
from benchmark.suite._mutant_runs import BROKEN, COMPILING_S, SURVIVED, brought_up_to_date, tree, workers
from benchmark.suite._mutant_tasks import measured_file, tasks_of
from benchmark.suite._mutant_tests import PACKAGE, Imports, Recorder
from benchmark.suite._mutation import Mutant, draw, mutants

SEED = 20294
NAMED = (
    "calibration/points/bundle_adjustment", "calibration/points/triangulation", "camera/model", "loaders/bag/mcap_writer",
    "objective/chamfer/correspondences", "observation/synchronizer", "optimize/levenberg_marquardt", "runs/messages/body",
    "tracking/uncertainty/covariance", "tracking/chamfer/judge", "tracking/limbs/judge", "tracking/cameras/self_check",
    "tracking/motion/smoother",
)  # fmt: skip
N_OTHERS, EACH = {False: 20, True: 7}, {False: 7, True: 3}  # by --quick
FILES, FURTHER = 2, 4  # files of tests tried on a module's faults, and more for those that survive
MEASURING_S = 40.0  # of processor time for a file of tests as it is; what has not run by then is not used
MOST_COMPILING = 4  # times that a file of tests is run for that


@dataclass(frozen=True)
class Result:
    """What became of a fault; ``left_out``: tests that run its function, and were not tried."""

    mutant: Mutant
    noticed: bool
    by: str
    tests: int
    left_out: int


def main() -> int:
    args = _arguments()
    root = Path(__file__).resolve().parents[2]
    began = time.monotonic()
    for number in range(args.jobs):
        brought_up_to_date(root, args.folder / f"worker{number + 1}")
    root = args.folder / "worker1"  # whoever goes on with the sources does not disturb
    drawn, equivalent = drawn_mutants(root, args)
    if args.list:
        for one in drawn:
            print(f"{one.path}:{one.line}: {one.kind}: {one.before}  ->  {one.after}")
        return 0
    imports = Imports(root)
    with workers(args.folder, args.jobs) as pool:
        results = _tried(pool, drawn, imports, root, args, slice(args.files))
        survivors = [result.mutant for result in results if not result.noticed]
        if args.further and survivors:  # whoever is not noticed near by may be farther off
            before = {result.mutant: result for result in results}
            again = _tried(pool, survivors, imports, root, args, slice(args.files, args.files + args.further))
            results = [result for result in results if result.noticed] + [_joined(before[r.mutant], r) for r in again]
    for result in results:
        _say(result, args.verbose)
    metrics = {
        "mutants.killed": sum(r.noticed for r in results) / max(len(results), 1),
        "mutants.total": len(results),
        "mutants.equivalent": equivalent,
    }
    _tell(results)
    print(f"seed {args.seed}, {time.monotonic() - began:.0f} s")
    from tracker_node.report.metrics_file import report_metrics  # not before the workers: theirs is the copy

    report_metrics(metrics, args.json)
    return 0


def _joined(near: Result, far: Result) -> Result:
    """Of a fault that the tests near by have not noticed."""
    return replace(far, tests=near.tests + far.tests, left_out=near.left_out + far.left_out)


def _tried(pool: Any, drawn: list[Mutant], imports: Imports, root: Path, args: argparse.Namespace, files: slice) -> list[Result]:
    """What becomes of faults, by these of the files of tests, from the nearest on."""
    chosen = {name: imports.test_files(name)[files] for name in {one.path for one in drawn}}
    needed = sorted({file for names in chosen.values() for file in names})
    print(f"{len(drawn)} faults; {len(needed)} files of tests to measure without one", file=sys.stderr, flush=True)
    list(pool.imap_unordered(measure, [(file, measured_file(args.folder, root, file)) for file in needed]))
    tasks = tasks_of(drawn, chosen, imports, root, args.folder)
    random.Random(args.seed).shuffle(tasks)  # what is known on the way is an estimate of the whole
    results: list[Result] = []
    for result in pool.imap_unordered(try_mutant, tasks):
        results.append(result)
        rest = "" if result.noticed else f"; not {result.mutant.path}:{result.mutant.line}: {result.mutant.after}"
        print(f"{sum(r.noticed for r in results)} of {len(results)} noticed{rest}", file=sys.stderr, flush=True)
    return results


def drawn_mutants(root: Path, args: argparse.Namespace) -> tuple[list[Mutant], int]:
    """The faults to try, and the number of those drawn and left out as equivalent."""
    each = args.each or EACH[args.quick]
    modules = [f"{PACKAGE}/{name}.py" for name in NAMED]
    if args.only:
        everything = sorted(p.relative_to(root).as_posix() for p in (root / PACKAGE).rglob("*.py"))
        modules = [name for name in everything if any(text in name for text in args.only)]
    else:
        modules += _others(root, modules, N_OTHERS[args.quick], each, args.seed)
    drawn = [one for name in modules for one in draw(name, (root / name).read_bytes(), each, args.seed)]
    kept = [one for one in drawn if (one.path, one.before, one.after) not in EQUIVALENT]
    return kept, len(drawn) - len(kept)


def _others(root: Path, named: list[str], count: int, each: int, seed: int) -> list[str]:
    """More modules, drawn from all that have room for enough faults."""
    names = sorted(p.relative_to(root).as_posix() for p in (root / PACKAGE).rglob("*.py"))
    random.Random(seed).shuffle(names)
    chosen: list[str] = []
    for name in names:
        if len(chosen) < count and name not in named and len(mutants(name, (root / name).read_bytes())) >= each:
            chosen.append(name)
    return chosen


def measure(task: tuple[str, Path]) -> None:
    """Run a file of tests as it is, to see what they run."""
    file, out = task
    if not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        copy = tree()
        fresh = copy.root / "measured.json"
        fresh.unlink(missing_ok=True)
        for _ in range(MOST_COMPILING):  # until nothing is compiled any more, which may take longer than all tests
            compiled = copy.compiled()
            outcome = copy.run([file], MEASURING_S, (Recorder(copy.root, fresh),), ("--maxfail=1000",))
            if copy.compiled() == compiled:
                break
        content = json.loads(fresh.read_text()) if fresh.exists() else {"tests": {}, "fixtures": []}
        if outcome.status not in (*SURVIVED, None):
            failed = [name for name, one in content["tests"].items() if not one["passed"]]
            print(f"{file}: not all passed without a fault: {failed or outcome.said[-300:]}", file=sys.stderr, flush=True)
        out.write_text(json.dumps(content))


def try_mutant(task: dict[str, Any]) -> Result:
    """Plant a fault in this worker's copy, run the tests, and take it out again."""
    one, copy = task["mutant"], tree()
    source = (copy.root / one.path).read_bytes()
    copy.plant(one.path, one.applied(source), task["stale"])
    by = ""
    try:
        for tests in task["tests"]:
            outcome = copy.run(tests, 20.0 + 4.0 * task["seconds"] + (COMPILING_S if task["compiling"] else 0.0))
            if outcome.status == BROKEN:
                print(f"{one.path}:{one.line}: pytest itself failed, which says nothing: {outcome.said}", file=sys.stderr)
            elif outcome.status not in SURVIVED:
                by = _first_failure(outcome.said) or ("no end" if outcome.status is None else f"status {outcome.status}")
                break
    finally:
        copy.restore(one.path, task["stale"])
    return Result(one, bool(by), by, sum(map(len, task["tests"])), task["left_out"])


def _first_failure(said: str) -> str:
    lines = [line for line in said.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return lines[0].split(" - ")[0] if lines else ""


def _say(result: Result, verbose: bool) -> None:
    one = result.mutant
    if result.noticed and verbose:
        print(f"noticed {one.path}:{one.line} ({one.kind}) {one.before}  ->  {one.after}\n    {result.by}", flush=True)
    if not result.noticed:
        tried = f"{result.tests} tests" + (f", {result.left_out} left out" if result.left_out else "")
        print(f"survives {one.path}:{one.line} ({one.kind}; {tried})\n    {one.before}\n    {one.after}", flush=True)


def _tell(results: list[Result]) -> None:
    """Tables by module and by kind."""
    for title, key in (("module", lambda m: m.path), ("kind", lambda m: m.kind)):
        total, noticed = Counter(key(r.mutant) for r in results), Counter(key(r.mutant) for r in results if r.noticed)
        print(f"\n{title:60} noticed  of")
        for name in sorted(total):
            print(f"{name:60} {noticed[name]:7} {total[name]:3}")
    print()


def _arguments() -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "python benchmark/suite/mutants.py --only optimize/levenberg_marquardt --each 20 --seed 3",
        "three faults of each of 20 modules instead of seven of each of 33",
    )
    parser.add_argument("--seed", type=int, default=SEED, help="which faults, and which other modules (default: %(default)s)")
    parser.add_argument("--only", nargs="+", metavar="TEXT", help="modules whose path has this in it, instead of all")
    parser.add_argument("--each", type=int, metavar="N", help="faults of each module")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--files", type=int, default=FILES, help="nearest files of tests looked at (default: %(default)s)")
    parser.add_argument("--further", type=int, default=FURTHER, help="more of them for what survives (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="say which faults, and try none")
    parser.add_argument("--verbose", action="store_true", help="also say which test noticed a fault")
    parser.add_argument(
        "--folder", type=Path, default=Path("out/mutants"),
        help="copies of the tree, and what each test runs, kept for the next time (default: %(default)s)",
    )  # fmt: skip
    args = parser.parse_args()
    args.folder = args.folder.resolve()
    return args


if __name__ == "__main__":
    sys.exit(main())
