"""``tracker_node evaluate``: one run or several, against truth and against each other."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from .arguments.review import check_numbers, lag_of, names_of, one_each, output_folder, targets_of

SUMMARY = "report on one run or several, against truth and each other: report.json, report.html and report.pdf"
EXAMPLE = (
    "tracker_node evaluate out/run --truth markers.trc --model person.yaml --rig rig.yaml --name walk --output out/evaluation"
)

_MOST_UNTOLD = 5
_LASTING = 0.1  # share of the sets, below which nothing is said of a degree of freedom by itself


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("runs", nargs="+", metavar="run",
        help="folder written by track or pipeline, or a bag with tracked states; several are compared")  # fmt: skip
    add("--truth", action="append", default=[], metavar="FILE",
        help=".trc, .c3d or .csv like joints.csv (positions); .csv like states.csv, .mot or .sto (degrees of freedom);"
        " one of each kind, or none")  # fmt: skip
    add("--y-up", action=argparse.BooleanOptionalAction,
        help="axes of a .trc, .c3d or .mot: y up, as OpenSim and Pose2Sim write it, or those of the world (default:"
        " a .c3d as it says itself, the others have y up)")  # fmt: skip
    add("--model", action="append", default=[], metavar="FILE",
        help="body model, one for all runs or one for each; default: what run.json names")  # fmt: skip
    add("--rig", action="append", default=[], metavar="FILE",
        help="camera rig, one for all or one for each (default: what run.json names), for silhouettes and pictures")  # fmt: skip
    add("--masks", metavar="FILE", help="reference masks (masks.json) to compare silhouettes with")
    add("--lag", default="auto", metavar="auto|IMAGES", help="constant lag of the images behind the truth (default: estimated)")
    add("--align", choices=("auto", "first", "stamp"), default="auto",
        help="first: the truth's first row belongs to image 0 (for .trc); stamp: both count the same time")  # fmt: skip
    add("--image-sets", type=int, default=0, metavar="N", help="number of sets that there should be, to count missing ones")
    add("--first-image", type=int, metavar="N",
        help="number, in sources and truth, of the image that the first set shows (default: run.json, or 0)")  # fmt: skip
    add("--pictures", type=int, default=6, metavar="N", help="instants on the contact sheets (default 6; 0: none)")
    add("--target", action="append", default=[], metavar="KEY<=X", help="light for a figure, for example mpjpe_mm<=60; repeat")
    add("--topic", help="topic of the states, where a bag has several")
    add("--name", action="append", default=[], metavar="NAME",
        help="prefix of the figures' keys; repeat for several runs (default: run, or the names of their folders)")  # fmt: skip
    add("--csv", action="store_true", help="also write every table and chart as CSV and JSON, into figures/")
    add("--no-pdf", action="store_true", help="without report.pdf, which takes the longest to write")
    add("-o", "--output", metavar="DIR", help="where the report goes (default: the folder of the run; needed for several)")


def run(args: argparse.Namespace) -> int:
    from ..evaluation.report import builder as report
    from ..report.metrics_file import print_metrics

    check_numbers(args)
    targets, lag = targets_of(args.target), lag_of(args.lag)
    names, folder = names_of(args.runs, args.name), output_folder(args.output, args.runs)
    models, rigs = (one_each(args.runs, given, option) for given, option in ((args.model, "--model"), (args.rig, "--rig")))
    reviews = []
    for path, name, model, rig in zip(args.runs, names, models, rigs, strict=True):
        reviews.append(_review(args, path, name, model, rig, lag))
    options = report.ReportOptions(targets, args.csv, not args.no_pdf)
    figures = report.write_report(folder, reviews, options, _say)
    print_metrics(figures)
    written = [report.REPORT_JSON, report.REPORT_HTML, *([] if args.no_pdf else [report.REPORT_PDF])]
    _say(f"wrote {', '.join(str(folder / name) for name in written)}")
    return 0


def _review(args: argparse.Namespace, path: str, name: str, model_path: str | None, rig_path: str | None, lag: Any):
    """One run held against truth, and its images looked at."""
    from dataclasses import replace

    from ..errors import TrackerError
    from ..evaluation.evaluate import EvaluationOptions
    from ..evaluation.review import review
    from ..evaluation.truth.files import truth_of
    from ..loaders.model.model_yaml import load_model
    from ..runs.images import file_of, first_image_of
    from ..runs.load import load_run

    tracked = load_run(path, args.topic)
    first_image = first_image_of(tracked.info) if args.first_image is None else args.first_image
    model_path, rig_path = model_path or file_of(tracked.info, "model"), rig_path or file_of(tracked.info, "rig")
    if not model_path:
        raise TrackerError(f"{path} does not name its body model; give --model FILE")
    model = load_model(model_path)
    tracked.check_model(model, model_path)
    _say(f"{name}: {len(tracked)} states of {path}")
    sources = {"run": path, "truth": ", ".join(args.truth) or "none", "model": model_path, "rig": rig_path or "not given"}
    options = EvaluationOptions(name, lag, args.align, args.image_sets, first_image)
    found = review(tracked, model, truth_of(args.truth, args.y_up, model), options, sources)
    images = _look_at_images(args, tracked, model, rig_path, found.period_s * 1e9, first_image)
    problems = [*found.problems, *_contradicted(tracked.info), *_untold(tracked.info), *images.problems]
    joints = None if found.joints is None else replace(found.joints, silhouettes=images.scores)
    return replace(found, joints=joints, silhouettes=images.scores, pictures=images.pictures, problems=problems)


def _look_at_images(args: argparse.Namespace, tracked: Any, model: Any, rig_path: str | None, period_ns: float, first_image: int):
    """Silhouettes, pictures for the contact sheets, and what could not be shown."""
    from ..evaluation.masks.reference import load_reference_masks
    from ..evaluation.masks.silhouettes import ImageReview, ReviewOptions, review_images
    from ..loaders.rig.rig_yaml import load_rig
    from ..runs.images import file_of, rig_of_run

    if not rig_path:
        return ImageReview(problems=["Without a rig there are no silhouettes and no pictures (--rig FILE)."])
    masks = load_reference_masks(args.masks) if args.masks else {}
    options = ReviewOptions(pictures=args.pictures, first_image=first_image)
    rig = rig_of_run(load_rig(rig_path), tracked.info, other_file=rig_path != file_of(tracked.info, "rig"))
    return review_images(tracked, model, rig, masks, period_ns, options, _say)


def _contradicted(info: Any) -> list[str]:
    """A sentence for each camera that the others have contradicted during the run."""
    found = info.get("contradicted_cameras") or []
    return [f"{entry['said']}; so it was found after {entry['sets']} of the image sets." for entry in found]


def _untold(info: Any) -> list[str]:
    """Sentences on what the images have not told: what lasts longest first, at most `_MOST_UNTOLD`, and how many more."""
    found = sorted(info.get("unobservable") or [], key=lambda entry: -entry["sets"])
    least = _LASTING * info.get("image_sets", 0)
    shown = [entry for entry in found if entry["sets"] >= least][:_MOST_UNTOLD]
    said = [
        f"The images of {entry['sets']} set{'s' * (entry['sets'] != 1)} do not tell the {entry['what']}; it is guessed there."
        for entry in shown
    ]
    more = len(found) - len(shown)
    others = "one other degree of freedom" if more == 1 else f"{more} other degrees of freedom"
    return [*said, *([f"The images of some sets do not tell {others}."] if more else [])]


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
