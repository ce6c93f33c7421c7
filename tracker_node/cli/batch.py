"""``tracker_node batch``."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments.run_images import check

if TYPE_CHECKING:
    from ..batch.batch import Progress

SUMMARY = "track many trials, on several processes or a Dask cluster, and report on all of them together"
EXAMPLE = """tracker_node batch trials.yaml
  tracker_node batch trials.yaml --scheduler tcp://127.0.0.1:8786"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS", help="trials.yaml: subjects, trials, and what they share (docs/own_data.md)"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="instead of the output that TRIALS names")
    parser.add_argument("--only", nargs="+", metavar="TRIAL", help="only these trials")
    parser.add_argument("--again", action="store_true", help="track trials that are done already, too")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: its processors)")
    where.add_argument("--scheduler", metavar="ADDRESS", help="take the workers of this Dask scheduler, tcp://HOST:PORT")
    parser.add_argument(
        "--threads", type=int, metavar="N",
        help="of each tracker (default: 1; with --scheduler, or fewer processes than processors, what its parameters say)",
    )  # fmt: skip
    parser.add_argument("--no-pdf", action="store_true", help="without report.pdf")
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")


def run(args: argparse.Namespace) -> int:
    from ..batch.batch import BatchOptions, run_batch
    from ..batch.report import write_batch_report
    from ..batch.work import FAILED_STATE
    from ..evaluation.report.builder import REPORT_HTML
    from ..loaders.trials_yaml import load_trials

    for name in ("workers", "threads"):
        value = getattr(args, name)
        check(value is None or value >= 1, f"--{name}", "a whole number, 1 or more", value)
    trials, shown = load_trials(args.trials, args.output), _Shown(args.quiet)
    options = BatchOptions(args.workers, args.scheduler, args.threads, args.again, tuple(args.only or ()))
    outcomes = run_batch(trials, options, shown.tell, shown.progress)
    write_batch_report(trials.output, outcomes, not args.no_pdf, (lambda text: None) if args.quiet else shown.tell)
    failed = [outcome.name for outcome in outcomes if outcome.state == FAILED_STATE]
    print(f"{len(outcomes) - len(failed)} of {len(outcomes)} trials tracked{'; failed: ' if failed else ''}{', '.join(failed)}")
    if doubtful := [outcome.name for outcome in outcomes if outcome.is_doubtful]:
        print(f"with warnings or LOST sets: {', '.join(doubtful)}")
    print(f"report in {trials.output / REPORT_HTML}")
    return 1 if failed else 0


class _Shown:
    """One line on a terminal, a line every few seconds elsewhere; sentences between them."""

    def __init__(self, quiet: bool):
        self._quiet, self._terminal, self._next = quiet, sys.stderr.isatty(), 0.0

    def tell(self, sentence: str) -> None:
        clear = "\r\x1b[K" if self._terminal and not self._quiet else ""
        print(f"{clear}batch: {sentence}", file=sys.stderr, flush=True)

    def progress(self, now: Progress) -> None:
        if self._quiet or time.monotonic() < self._next:
            return
        self._next = time.monotonic() + (0.2 if self._terminal else 10.0)
        text = f"{now.done} of {now.trials} trials"
        if now.failed:
            text += f" ({now.failed} failed)"
        if now.working:
            of = f" of {now.expected_sets}" if now.expected_sets else ""
            text += f", {now.working} at work ({now.sets}{of} image sets)"
        if now.left_s is not None:
            minutes, seconds = divmod(round(now.left_s), 60)
            text += f", {f'{minutes} min ' if minutes else ''}{seconds} s left"
        print(f"batch: {text:<70}", end="\r" if self._terminal else "\n", file=sys.stderr, flush=True)
