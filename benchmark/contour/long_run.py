#!/usr/bin/env python3
"""Whether contours last: 700 image sets of dances, kicks and spins without a restart, in a room that nobody has seen empty.

The clips dance_b, kick, dance_a, spinkick and spin at 30 Hz, joined by blends of 0.3 s with the root going on, repeated; six
cameras of 640x480, noise of 4 gray levels, blur of 0.6 px, lens distortion, a shadow, colored patterns all around. The body is
fitted to images of the same person in another motion, as in contour_mannequin.py. ``--room`` takes a furnished room.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour._fitted_body import fitted_body, with_body
from benchmark.contour._runs import (
    Run,
    clip_parser,
    configured,
    judged,
    print_circumstances,
    recorded,
    report_lost,
    time_figures,
    track,
)
from benchmark.contour.mannequins import BODY_CLIP, PERSON_SCENE, person_figures
from tracker_node.errors import SourceError, TrackerError
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.motions.motion import LONG_RUN, LONG_RUN_IMAGES
from tracker_node.synthesis.recording import Request, default_motions
from tracker_node.synthesis.scenes.scene import SceneConfig

LONG_SCENE = replace(PERSON_SCENE, n_cameras=6, lossless=False)  # JPEG of quality 95: 4200 images
ROOM_SCENE = replace(SceneConfig(), noise_levels=4.0, blur_px=0.6)
QUICK_IMAGES = 100


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    try:
        if args.motions is None:
            raise SourceError("bullet_motions", "name the folder of the captured clips with --motions or TRACKER_SHARED_DATA")
        config = configured(args.changes)
        scene, name = (ROOM_SCENE, f"{LONG_RUN}_room") if args.room else (LONG_SCENE, LONG_RUN)
        n = args.images or (QUICK_IMAGES if args.quick else LONG_RUN_IMAGES)
        request = Request(motion=LONG_RUN, motions=args.motions, scene=scene, n_images=n)
        clip = recorded(name if n == LONG_RUN_IMAGES else f"{name}-{n}", request, args.cache)
        if not args.scaled:
            request = replace(request, motion=BODY_CLIP, scene=PERSON_SCENE, n_images=None)
            clip = with_body(clip, fitted_body(recorded(f"mannequin_{BODY_CLIP}_4", request, args.cache), config, args.body))
        backgrounds = load_backgrounds(clip.rig) if args.room else {}
        run = track(clip, config, clip.sets(), _progress, backgrounds)
        result = judged(clip, run, LONG_RUN)
        report_lost(result)
        figures = person_figures(result) | time_figures(run, config, LONG_RUN) | _iterations(run)
    except TrackerError as error:
        print(f"contour_long_run: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = clip_parser(
        __doc__, "python benchmark/contour/long_run.py --set modalities=region --json out/benchmark/long_run.json", [LONG_RUN]
    )
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    parser.add_argument("--images", type=int, metavar="N", help=f"image sets of the recording (default: {LONG_RUN_IMAGES})")
    parser.add_argument("--room", action="store_true", help="a furnished room, with backgrounds")
    parser.add_argument("--scaled", action="store_true", help="the body as scaled by the T-pose, not fitted to images")
    parser.add_argument("--body", type=Path, metavar="FILE", help="this body instead of fitting one")
    return parser.parse_args(arguments)


def _progress(n: int) -> None:
    if n % 50 == 0:
        print(f"long run: image set {n}", file=sys.stderr, flush=True)


def _iterations(run: Run) -> dict[str, float]:
    """All sets, the first one with its many iterations as well."""
    return {f"{LONG_RUN}.iterations": float(np.mean([e.iterations for e in run.estimates]))}


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
