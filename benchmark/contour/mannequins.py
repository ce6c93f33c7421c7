#!/usr/bin/env python3
"""How accurate contours are on a person that is not the tracker's model, in a room that nobody has seen empty.

A skinned, dressed body in captured motions, four cameras of 640x480 at 30 Hz, noise of 4 gray levels, blur of 0.6 px, lens
distortion, colored patterns all around, a shadow. The body is first scaled by a T-pose, then fitted to images of the same
person in another motion (`calibrate body`); ``--scaled`` leaves that out. ``mpjpe_mm`` has one constant offset per joint taken
out, in the frame of its segment, ``mpjpe_world_mm`` in the world, ``mpjpe_raw_mm`` none. ``own_shapes``: a person drawn from the
tracker's own model, to which a network's points are worse than lines. ``..._together``: the same clips by points and contours,
the default for people.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.clothed._people import KeptPeople
from benchmark.contour._fitted_body import fitted_body, with_body
from benchmark.contour._runs import (
    SCENE,
    clip_parser,
    configured,
    judged,
    print_circumstances,
    recorded,
    report_lost,
    time_figures,
    track,
)
from tracker_node.errors import SourceError, TrackerError
from tracker_node.evaluation.evaluate import Evaluation
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import Request, default_motions
from tracker_node.synthesis.scenes.scene import SceneConfig

PERSON_SCENE = replace(SCENE, distortion=SceneConfig().distortion, shadow=True)
OWN_SHAPES = "own_shapes"
CLIPS = ("spinkick", "cartwheel", OWN_SHAPES, "walk")
BODY_CLIP = "dance_a"  # the body is fitted to this one
QUICK_IMAGES, OWN_IMAGES = 12, 60
BOTH = ("region", "keypoints")


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    figures: dict[str, float | int] = {}
    try:
        if args.motions is None:
            raise SourceError("bullet_motions", "name the folder of the captured clips with --motions or TRACKER_SHARED_DATA")
        request = Request(motion=BODY_CLIP, motions=args.motions, scene=PERSON_SCENE)
        config = configured(args.changes)
        body = None
        if not args.scaled:
            body = fitted_body(recorded(f"mannequin_{BODY_CLIP}_4", request, args.cache), config, args.body, args.refit)
        for name in args.only or (CLIPS[-1:] if args.quick else CLIPS):
            own = {"subject": "model", "motion": "waves", "motions": None, "n_images": OWN_IMAGES} if name == OWN_SHAPES else {}
            key = OWN_SHAPES if own else f"mannequin_{name}"
            clip = recorded(f"{key}_4", replace(request, **(own or {"motion": name})), args.cache)
            if body is not None and not own:
                clip = with_body(clip, body)
            for kind, people in (("", None), ("_together", KeptPeople(pose_weights(), args.cache / f"{key}.sqlite"))):
                used = config if people is None else replace(config, modalities=BOTH)
                found = None if people is None else lambda tracker, one, people=people: people.with_people(tracker, one)[0]
                run = track(clip, used, clip.sets(limit=QUICK_IMAGES if args.quick else None), people=found)
                result = judged(clip, run, f"{key}{kind}")
                report_lost(result)
                figures |= person_figures(result)
                figures |= time_figures(run, used, f"{key}{kind}")
    except TrackerError as error:
        print(f"contour_mannequin: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = clip_parser(__doc__, "python benchmark/contour/mannequins.py --only walk --set modalities=region", CLIPS)
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    parser.add_argument("--scaled", action="store_true", help="the body as scaled by the T-pose, not fitted to images")
    parser.add_argument("--body", type=Path, metavar="FILE", help="this body instead of fitting one")
    parser.add_argument("--refit", action="store_true", help="fit the body again even if that has been done")
    return parser.parse_args(arguments)


def person_figures(result: Evaluation) -> dict[str, float | int]:
    """Figures of a run on a body that is not the tracker's."""
    figures: dict[str, float | int] = {
        "mpjpe_mm": result.offset_free.mean_mm,
        "mpjpe_world_mm": result.offset_free_world.mean_mm,
        "mpjpe_raw_mm": result.raw.mean_mm,
        "lost_limbs": len(result.lost_limbs),
        "lost_sets": int(result.lost.sum()) + result.missing_sets,
        "residual_px": float(result.residual.mean()),
        "sets": result.image_sets,
    }
    return {f"{result.name}.{key}": value for key, value in figures.items()}


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
