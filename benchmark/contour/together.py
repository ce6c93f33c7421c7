#!/usr/bin/env python3
"""Contours alone, colors alone, and both in one least-squares problem: the clips of `color/articulated.py`, without plates.

A skinned mannequin, not the tracker's model, in a suit of colored parts; four cameras, a furnished room, lens distortion, blur,
noise and a shadow. Nobody has seen the room empty; the displayed colors are learned from the first image set. Errors as there:
the mean distance of joints from truth after one constant offset per joint in the frame of its segment; ``_raw`` without that.
``sigma_ratio``: median over the degrees of freedom of their standard deviations, together against contours.

Then people in clothes, whose parts share one cloth, from the true start, by contours and by both: mannequins, clothed people as
in `clothed/clothed.py`, the real Balancing clip; ``--clothes no``: without. ``together.worst_ratio``, ``mean_ratio``: errors
by both over those of contours, the largest and the mean of all clips, raw and offset-free.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.clothed._judged import accuracy
from benchmark.clothed._recording import default_folders, load_clip
from benchmark.clothed._runs import track as track_person
from benchmark.clothed._runs import without_people
from benchmark.color.articulated import CLIPS, DEFAULT_CACHE, recording
from benchmark.contour import _balancing_clip as balancing
from benchmark.contour._runs import Clip, judged, recorded, track
from benchmark.contour.balancing import LAG_IMAGES
from benchmark.contour.mannequins import PERSON_SCENE
from tracker_node.errors import TrackerError
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import Request, default_motions
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.tracker import Tracker

MANNEQUINS = ("walk", "spinkick", "cartwheel")
ENGINES = {"contour": (False, True), "color": (True, False), "together": (True, True)}  # by colors, by contours


def main() -> int:
    args = _arguments()
    figures: dict[str, float | int] = {}
    if args.motions is None:
        print("contour_together: skipped, it needs the captured clips (--motions, or TRACKER_SHARED_DATA)", file=sys.stderr)
        return 0
    try:
        for name in args.only or CLIPS["quick" if args.quick else "full"]:
            figures |= measure(Clip.load(recording(name, args.motions, args.cache)), name, args)
        if args.clothes == "yes" and not args.quick:
            for name, (contours, together) in in_clothes(args):
                print(f"{name}: {contours} by contours, {together} by both", file=sys.stderr, flush=True)
                figures |= {f"together_{name}.{key}": v for way in (contours, together) for key, v in way.items()}
    except TrackerError as error:
        print(f"contour_together: error: {error}", file=sys.stderr)
        return 2
    ratios = [
        value / figures[key.replace(".together_", ".contour_")]
        for key, value in figures.items() if ".together_error" in key
    ]  # fmt: skip
    figures |= {"together.worst_ratio": max(ratios), "together.mean_ratio": float(np.mean(ratios))}
    for engine in ENGINES:
        errors = [figures[key] for name in CLIPS["full"] if (key := f"together_{name}.{engine}_error_mm") in figures]
        figures[f"together.{engine}_error_mm"] = float(np.mean(errors))
    report_metrics(figures, args.json)
    return 0


def measure(clip: Clip, name: str, args: argparse.Namespace) -> dict[str, float | int]:
    figures: dict[str, float | int] = {}
    sigmas: dict[str, np.ndarray] = {}
    for key, (colors, contours) in ENGINES.items():
        config = settings(colors, contours, args)
        backgrounds = load_backgrounds(clip.rig) if args.backgrounds else None
        run = track(clip, config, clip.sets(limit=args.sets), backgrounds=backgrounds)
        result = judged(clip, run, name)
        figures[f"together_{name}.{key}_error_mm"] = result.offset_free.mean_mm
        figures[f"together_{name}.{key}_error_raw_mm"] = result.raw.mean_mm
        figures[f"together_{name}.{key}_lost_limbs"] = len(result.lost_limbs)
        figures[f"together_{name}.{key}_ms"] = float(np.median(run.times_ms))
        sigmas[key] = np.median([np.sqrt(np.diag(e.covariance)) for e in run.estimates], axis=0)
    figures[f"together_{name}.sigma_ratio"] = float(np.median(sigmas["together"] / sigmas["contour"]))
    return figures


def settings(colors: bool, contours: bool, args: argparse.Namespace) -> TrackerConfig:
    """Defaults, but for modalities and colors, which are learned."""
    modalities = [*(["color"] if colors else []), *([args.contours] if contours else [])]
    return from_dict({"modalities": modalities, **({"color": {"learn_colors": True}} if colors else {})})


def in_clothes(args: argparse.Namespace) -> Iterator[tuple[str, list[dict[str, float]]]]:
    """Figures of each clip by contours and together."""
    ways = {key: settings(*ENGINES[key], args) for key in ("contour", "together")}
    for motion in MANNEQUINS:
        request = Request(motion=motion, motions=args.motions, scene=PERSON_SCENE)
        clip = recorded(f"mannequin_{motion}_4", request, args.cache)
        results = {key: judged(clip, track(clip, way, clip.sets(limit=args.sets)), motion) for key, way in ways.items()}
        yield f"mannequin_{motion}", [_errors(key, each.raw.mean_mm, each.offset_free.mean_mm) for key, each in results.items()]
    for folder in default_folders(args.drawn):
        person = load_clip(folder)
        people = {}
        for key, way in ways.items():
            sets = (person.image_set(row) for row in range(min(len(person), args.sets or len(person))))
            people[key] = accuracy(track_person(person, key, way, without_people, person.start(), sets))
        yield person.name, [_errors(key, each.mpjpe12_mm, each.offset_free12_mm) for key, each in people.items()]
    real = balancing.load_clip(args.sample, args.cache)
    real = replace(real, sets=real.sets[: args.sets])
    found = {}
    for key, way in ways.items():
        run = balancing.track(Tracker(real.rig, real.model, way, real.backgrounds, real.start), real.sets)
        found[key] = balancing.judge(real, run, "balancing", LAG_IMAGES)
    yield "balancing", [_errors(key, result.raw.mean_mm, result.offset_free.mean_mm) for key, result in found.items()]


def _errors(key: str, raw_mm: float, free_mm: float) -> dict[str, float]:
    return {f"{key}_error_mm": free_mm, f"{key}_error_raw_mm": raw_mm}


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__, "", "the walk alone")
    add = parser.add_argument
    add("--only", nargs="+", metavar="CLIP", help="only these clips, e.g. walk dance_a")
    add("--sets", type=int, metavar="N", help="only the first N image sets")
    add("--contours", choices=("chamfer", "region"), default="region", help="their modality (default: %(default)s)")
    add("--backgrounds", action="store_true", help="use the images of the background")
    add("--clothes", choices=("yes", "no"), default="yes", help="people in clothes, too (default: %(default)s)")
    add("--drawn", type=Path, default=Path("out/clothed"), metavar="FOLDER", help="drawn people (default: %(default)s)")
    add("--sample", type=Path, default=Path("out/demo/sample"), metavar="FOLDER", help="of Balancing (default: %(default)s)")
    add("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER", help="recordings (default: %(default)s)")
    add("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
