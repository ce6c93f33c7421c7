"""``tracker_node evaluate``: hold a run against truth."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

SUMMARY = "compare a run with true joint positions: report.json and one self-contained report.html"
EXAMPLE = (
    "tracker_node evaluate out/run --truth markers.trc --model person.yaml --rig rig.yaml --name walk --output out/evaluation"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", help="folder written by track_offline, or a bag with tracked states (live recordings too)")
    add("--truth", required=True, metavar="FILE", help=".trc, .c3d, or .csv with the columns stamp_ns,landmark,x,y,z in metres")
    add("--y-up", action=argparse.BooleanOptionalAction,
        help="axes of a .trc or .c3d: y up, as OpenSim and Pose2Sim write it, or those of the world (default: a .trc has y up, a"
        " .c3d says it itself)")  # fmt: skip
    add("--model", metavar="FILE", help="body model; default: what run.json names")
    add("--rig", metavar="FILE", help="camera rig; default: what run.json names; needed for silhouettes and pictures")
    add("--masks", metavar="FILE", help="reference masks (masks.json) to compare silhouettes with")
    add("--lag", default="auto", metavar="auto|IMAGES", help="constant lag of the images behind the truth (default: estimated)")
    add("--align", choices=("auto", "first", "stamp"), default="auto",
        help="first: the truth's first row belongs to image 0 (for .trc); stamp: both count the same time")  # fmt: skip
    add("--image-sets", type=int, default=0, metavar="N", help="number of sets that there should be, to count missing ones")
    add("--first-image", type=int, metavar="N",
        help="number, in sources and truth, of the image that the first set shows (default: run.json, or 0)")  # fmt: skip
    add("--pictures", type=int, default=6, metavar="N", help="instants on the contact sheet (default 6; 0: none)")
    add("--target", action="append", default=[], metavar="KEY<=X", help="light for a figure, for example mpjpe_mm<=60; repeat")
    add("--topic", help="topic of the states, where a bag has several")
    add("--name", default="run", help="prefix of the figures' keys (default: run)")
    add("--output", metavar="DIR", help="where report.json and report.html go (default: DIR of the run)")


def run(args: argparse.Namespace) -> int:
    from ..evaluation import report
    from ..evaluation.evaluate import EvaluationOptions, evaluate
    from ..evaluation.metrics_file import print_metrics
    from ..evaluation.run_data import load_run
    from ..evaluation.truth import OWN_TIME, load_truth
    from ..loaders.model_yaml import load_model

    targets = _targets(args.target)
    lag = _lag(args.lag)
    tracked = load_run(args.run, args.topic)
    first_image = _first_image(tracked.info) if args.first_image is None else args.first_image
    options = EvaluationOptions(args.name, lag, args.align, args.image_sets, first_image)
    model_path = args.model or _named(tracked.info, "model")
    if not model_path:
        return _complain("the run does not name its body model; give --model FILE")
    model = load_model(model_path)
    tracked.check_model(model, model_path)
    truth = load_truth(args.truth, args.y_up)
    _say(f"{len(tracked)} states of {args.run}, {len(truth.stamps_ns)} rows of truth")
    evaluation = evaluate(tracked, model, truth, options, truth_is_trc=Path(args.truth).suffix.lower() in OWN_TIME)
    rig_path = args.rig or _named(tracked.info, "rig")
    evaluation, pictures, problems = _look_at_images(args, tracked, model, rig_path, evaluation, first_image)
    problems = [*_contradicted(tracked.info), *_untold(tracked.info), *problems]
    folder = Path(args.output or (args.run if Path(args.run).is_dir() else Path(args.run).parent))
    sources = {"run": args.run, "truth": args.truth, "model": str(model_path), "rig": str(rig_path or "not given")}
    figures = report.write_report(folder, evaluation, pictures, report.ReportContext(sources, problems, targets))
    print_metrics(figures)
    _say(f"wrote {folder / report.REPORT_JSON} and {folder / report.REPORT_HTML}")
    return 0


def _look_at_images(
    args: argparse.Namespace, tracked: Any, model: Any, rig_path: str | None, evaluation: Any, first_image: int
):
    """The evaluation with silhouettes, pictures for the contact sheet, and what could not be shown."""
    from dataclasses import replace

    from ..evaluation.reference_masks import load_reference_masks
    from ..evaluation.silhouettes import ReviewOptions, review_images
    from ..loaders.rig_yaml import load_rig

    if not rig_path:
        return evaluation, [], ["Without a rig there are no silhouettes and no pictures (--rig FILE)."]
    masks = load_reference_masks(args.masks) if args.masks else {}
    options = ReviewOptions(pictures=args.pictures, first_image=first_image)
    review = review_images(tracked, model, load_rig(rig_path), masks, evaluation.period_s * 1e9, options, _say)
    return replace(evaluation, silhouettes=review.scores), review.pictures, review.problems


def _targets(texts: list[str]) -> dict[str, Any]:
    from ..errors import TrackerError
    from ..evaluation.report import parse_target

    try:
        return dict(parse_target(text) for text in texts)
    except ValueError as error:
        raise TrackerError(f"--target: {error}") from None


def _lag(text: str) -> float | None:
    from ..errors import TrackerError

    if text == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise TrackerError(f"--lag: expected 'auto' or a number of images, got {text!r}") from None


def _first_image(info: Any) -> int:
    """The image that an offline run of the rig's sources began with."""
    options = info.get("options")
    start = options.get("start") if isinstance(options, dict) and not options.get("bag") else None
    return start if isinstance(start, int) else 0


def _contradicted(info: Any) -> list[str]:
    """A sentence for each camera that the others have contradicted during the run."""
    found = info.get("contradicted_cameras") or []
    return [f"{entry['said']}; so it was found after {entry['sets']} of the image sets." for entry in found]


def _untold(info: Any) -> list[str]:
    """A sentence on each degree of freedom, or direction, that the images of the run have not told."""
    found = info.get("unobservable") or []
    return [f"The images of {entry['sets']} sets do not tell the {entry['what']}; it is guessed there." for entry in found]


def _named(info: Any, key: str) -> str | None:
    """A file that run.json names, at its top or among its options."""
    for place in (info, info.get("options"), info.get("files")):
        if isinstance(place, dict) and isinstance(place.get(key), str):
            return place[key]
    return None


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _complain(text: str) -> int:
    _say(f"tracker_node evaluate: error: {text}")
    return 2
