#!/usr/bin/env python3
"""Contours alone, colors alone, and both in one least-squares problem: the clips of `color/articulated.py`, without plates.

A skinned mannequin, not the tracker's model, in a suit of colored parts; four cameras, a furnished room, lens distortion, blur,
noise and a shadow. Nobody has seen the room empty; the displayed colors are learned from the first image set. Errors as there:
the mean distance of joints from truth after one constant offset per joint in the frame of its segment; ``_raw`` without that.
``sigma_ratio``: median over the degrees of freedom of their standard deviations, together against contours.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.color.articulated import CLIPS, DEFAULT_CACHE, recording
from benchmark.contour._runs import Clip, judged, track
from tracker_node.errors import TrackerError
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import default_motions
from tracker_node.tracking.config import from_dict

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
    except TrackerError as error:
        print(f"contour_together: error: {error}", file=sys.stderr)
        return 2
    for engine in ENGINES:
        errors = [value for key, value in figures.items() if key.endswith(f".{engine}_error_mm")]
        figures[f"together.{engine}_error_mm"] = float(np.mean(errors))
    report_metrics(figures, args.json)
    return 0


def measure(clip: Clip, name: str, args: argparse.Namespace) -> dict[str, float | int]:
    figures: dict[str, float | int] = {}
    sigmas: dict[str, np.ndarray] = {}
    for key, (colors, contours) in ENGINES.items():
        modalities = [*(["color"] if colors else []), *([args.contours] if contours else [])]
        config = from_dict({"modalities": modalities, **({"color": {"learn_colors": True}} if colors else {})})
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


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__, "", "the walk alone")
    add = parser.add_argument
    add("--only", nargs="+", metavar="CLIP", help="only these clips, e.g. walk dance_a")
    add("--sets", type=int, metavar="N", help="only the first N image sets")
    add("--contours", choices=("chamfer", "region"), default="region", help="their modality (default: %(default)s)")
    add("--backgrounds", action="store_true", help="use the images of the background")
    add("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER", help="recordings (default: %(default)s)")
    add("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
