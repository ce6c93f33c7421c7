"""``tracker_node evaluate``: one run or several, against truth and against each other."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..evaluation.report.summary import Target

SUMMARY = "report on one run or several, against truth and each other: report.json, report.html and report.pdf"
EXAMPLE = (
    "tracker_node evaluate out/run --truth markers.trc --model person.yaml --rig rig.yaml --name walk --output out/evaluation"
)


_DAYS_HZ = "6"  # the same for all days, so that a filter is no difference


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("runs", nargs="+", metavar="run",
        help="folder written by track or pipeline, or a bag with tracked states; several are compared")  # fmt: skip
    add("--truth", action="append", default=[], metavar="FILE",
        help=".trc, .c3d or .csv like joints.csv (positions); .csv like states.csv, .mot or .sto (degrees of freedom);"
        " one of each kind, for all runs, or one for each in their order; or none")  # fmt: skip
    add("--y-up", action=argparse.BooleanOptionalAction,
        help="axes of a .trc, .c3d or .mot: y up, as OpenSim and Pose2Sim write it, or those of the world (default:"
        " a .c3d as it says itself, the others have y up)")  # fmt: skip
    add("--z-up", dest="y_up", action="store_false", default=None, help="the same as --no-y-up, as calibrate body has it")
    add("--model", action="append", default=[], metavar="FILE",
        help="body model, one for all runs or one for each; default: what run.json names")  # fmt: skip
    add("--rig", action="append", default=[], metavar="FILE",
        help="camera rig, one for all or one for each (default: what run.json names), for silhouettes and pictures")  # fmt: skip
    add("--masks", metavar="FILE", help="reference masks (masks.json) to compare silhouettes with")
    add("--lag", default="auto", metavar="auto|IMAGES", help="constant lag of the images behind the truth (default: estimated)")
    add("--align", choices=("auto", "first", "stamp"), default="auto",
        help="first: the truth's first row belongs to image 0; stamp: its times are those of the run as they stand; auto: stamp"
        " for .csv, for the others what fits best")  # fmt: skip
    add("--filter", metavar="auto|none|HZ",
        help="of joint angles and velocities: a Butterworth filter, its cutoff by residual analysis (default; none of smoothed"
        " states) or in Hz")  # fmt: skip
    add("--opensim", metavar="FILE",
        help="model of OpenSim (.osim), scaled to the person: its inverse kinematics with our landmarks as markers, weighted by"
        " their covariances; also writes opensim.mot")  # fmt: skip
    add("--image-sets", type=int, default=0, metavar="N", help="number of sets that there should be, to count missing ones")
    add("--first-image", type=int, metavar="N",
        help="number, in sources and truth, of the image that the first set shows (default: run.json, or 0)")  # fmt: skip
    add("--pictures", type=int, default=6, metavar="N", help="time steps on the contact sheets (default 6; 0: none)")
    add("--target", action="append", default=[], metavar="KEY<=X", help="light for a metric, for example mpjpe_mm<=60; repeat")
    add("--topic", help="topic of the states, where a bag has several")
    add("--name", action="append", default=[], metavar="NAME",
        help="prefix of the metrics' keys; repeat for several runs (default: run, or the names of their folders)")  # fmt: skip
    add("--days", action="store_true",
        help="each run is a recording day of one person, or a folder of its runs, such as batch leaves: mean and SD of each day"
        " and differences to the first; the filter is 6 Hz unless --filter says otherwise")  # fmt: skip
    add("--csv", action="store_true", help="also write every table and chart as CSV and JSON, into figures/")
    add("--no-pdf", action="store_true", help="without report.pdf, which takes the longest to write")
    add("-o", "--output", metavar="DIR", help="where the report goes (default: the folder of the run; needed for several)")


def run(args: argparse.Namespace) -> int:
    if args.days:
        return _compare_days(args)
    from ..evaluation.evaluate import EvaluationOptions
    from ..evaluation.masks.reference import load_reference_masks
    from ..evaluation.report import builder as report
    from ..evaluation.run_review import RunFiles, review_run
    from ..report.metrics_file import print_metrics

    _check_numbers(args)
    targets, lag, cutoff = _targets_of(args.target), lag_of(args.lag), _cutoff_of(args.filter or "auto")
    names, folder = names_of(args.runs, args.name), output_folder(args.output, args.runs)
    models, rigs = (one_each(args.runs, given, option) for given, option in ((args.model, "--model"), (args.rig, "--rig")))
    masks = load_reference_masks(args.masks) if args.masks else {}
    reviews = []
    for path, name, model, rig, truth in zip(args.runs, names, models, rigs, _truths_of(args), strict=True):
        compared = EvaluationOptions(name, lag, args.align, args.image_sets, cutoff_hz=cutoff)
        files = RunFiles(path, model, rig, args.topic, truth, args.y_up, masks, args.pictures, compared, args.first_image,
                         args.opensim)  # fmt: skip
        reviews.append(review_run(files, _say))
    options = report.ReportOptions(targets, args.csv, not args.no_pdf)
    metrics = report.write_report(folder, reviews, options, _say)
    print_metrics(metrics)
    written = [report.REPORT_JSON, report.REPORT_HTML, *([] if args.no_pdf else [report.REPORT_PDF])]
    _say(f"wrote {', '.join(str(folder / name) for name in written)}")
    return 0


def _compare_days(args: argparse.Namespace) -> int:
    from ..errors import TrackerError
    from ..evaluation.evaluate import EvaluationOptions
    from ..evaluation.report import builder as report
    from ..evaluation.report.days import Day, days_document, days_metrics
    from ..evaluation.run_review import RunFiles, review_run, runs_in
    from ..report.metrics_file import print_metrics

    for option in ("truth", "masks", "target", "topic", "rig", "opensim"):
        if getattr(args, option):
            raise TrackerError(f"--{option}: days are compared with each other alone, expected none, got {getattr(args, option)}")
    if len(args.runs) < 2:
        raise TrackerError(f"--days: expected two days or more, got {len(args.runs)}")
    names, folder = names_of(args.runs, args.name), output_folder(args.output, args.runs)
    days, cutoff = [], _cutoff_of(args.filter or _DAYS_HZ)
    for path, name, model in zip(args.runs, names, one_each(args.runs, args.model, "--model"), strict=True):
        reviews, runs = [], runs_in(path)
        alike = len({run.name for run in runs}) < len(runs)  # of one body of several trials
        for run in runs:
            compared = EvaluationOptions(f"{run.parent.name}_{run.name}" if alike else run.name, cutoff_hz=cutoff)
            files = RunFiles(str(run), model, pictures=0, options=compared)
            reviews.append(review_run(files, _say))
        days.append(Day(name, reviews))
    metrics = days_metrics(days)
    report.write_document(folder, days_document(days), metrics, report.ReportOptions({}, args.csv, not args.no_pdf), _say)
    print_metrics(metrics)
    _say(f"wrote {folder / report.REPORT_HTML}")
    return 0


def _say(text: str) -> None:
    print(f"{text}\n", end="", file=sys.stderr, flush=True)  # at once: cameras are read by several threads


def names_of(runs: Sequence[str], given: Sequence[str]) -> list[str]:
    """Names of the runs in the report.

    Parameters
    ----------
    runs : paths.
    given : on the command line.

    Returns
    -------
    names : as given, "run" for a single one, or those of the folders: where they are alike with that of the folder above, and
        where these are, too, numbered.
    """
    from ..errors import TrackerError

    if given and (len(given) != len(runs) or len(set(given)) != len(given) or not all(name.strip() for name in given)):
        expected = "one name" if len(runs) == 1 else f"{len(runs)} different names"
        raise TrackerError(f"--name: expected {expected}, got {', '.join(map(repr, given))}")
    if given or len(runs) == 1:
        return list(given) or ["run"]
    paths = [Path(run).resolve() for run in runs]
    short = [path.stem for path in paths]
    long = [path.stem if short.count(path.stem) == 1 else f"{path.parent.name}_{path.stem}" for path in paths]
    names = short if len(set(long)) < len(long) else long
    return [name if names.count(name) == 1 else f"{name}{i}" for i, name in enumerate(names, start=1)]


def one_each(runs: Sequence[str], given: Sequence[str], option: str) -> list[str | None]:
    """A file for each run.

    Parameters
    ----------
    runs : paths.
    given : one for all, one for each, or none.
    option : for messages.

    Returns
    -------
    files : None where none is given.
    """
    from ..errors import TrackerError

    if len(runs) > 1 and len(given) not in (0, 1, len(runs)):
        raise TrackerError(f"{option}: expected one file for all runs or {len(runs)}, got {len(given)}")
    return list(given) if len(given) == len(runs) else [given[-1] if given else None] * len(runs)


def _truths_of(args: argparse.Namespace) -> list[list[str]]:
    """Files with truth for each run."""
    from ..evaluation.truth.files import holds_states

    states = [path for path in args.truth if holds_states(path)]
    kinds = [of for of in (states, [path for path in args.truth if path not in states]) if of]
    if len(args.runs) == 1:
        return [args.truth]  # two of a kind are refused with the run
    for of in kinds:
        if len(of) == 1:
            _say(f"--truth {of[0]} is that of all {len(args.runs)} runs (one for each: repeat it, in their order)")
    by_kind = [one_each(args.runs, of, "--truth") for of in kinds]
    return [[str(of[i]) for of in by_kind] for i in range(len(args.runs))]


def _targets_of(texts: Sequence[str]) -> dict[str, Target]:
    """Bounds by the keys of metrics."""
    from ..errors import TrackerError
    from ..evaluation.report.summary import parse_target

    try:
        return dict(parse_target(text) for text in texts)
    except ValueError as error:
        raise TrackerError(f"--target: {error}") from None


def lag_of(text: str) -> float | None:
    """A number of images; None where it is to be estimated."""
    from ..errors import TrackerError
    from ..loaders.recording_yaml import MOST_LAG_IMAGES

    if text == "auto":
        return None
    try:
        lag = float(text)
    except ValueError:
        lag = math.nan
    if not abs(lag) <= MOST_LAG_IMAGES:
        raise TrackerError(f"--lag: expected 'auto' or a number of images, at most {MOST_LAG_IMAGES}, got {text!r}")
    return lag


def _cutoff_of(text: str) -> float | str:
    """A number where it is one; the evaluation refuses what it does not know."""
    try:
        return float(text)
    except ValueError:
        return text


def _check_numbers(args: argparse.Namespace) -> None:
    """Raises TrackerError for a number of images that is below zero."""
    from ..errors import TrackerError

    for name in ("image_sets", "first_image", "pictures"):
        value = getattr(args, name)
        if value is not None and value < 0:
            raise TrackerError(f"--{name.replace('_', '-')}: expected 0 or more, got {value}")


def output_folder(output: str | None, runs: Sequence[str]) -> Path:
    """Folder of the report.

    Parameters
    ----------
    output : as given; None: the folder of the only run.
    runs : paths.

    Returns
    -------
    folder : that can be written to.

    Raises
    ------
    TrackerError : no place for several runs, or one that is no folder, or that nothing can be written to.
    """
    from ..errors import TrackerError

    if len(runs) > 1 and not output:
        raise TrackerError("several runs have no folder in common; give --output DIR")
    run = Path(runs[0])
    folder = Path(output) if output else run if run.is_dir() else run.parent
    there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        raise TrackerError(f"--output: expected a folder that can be written to, got {there}")
    return folder
