#!/usr/bin/env python3
"""Joint angles of rendered people against exact ones: another body (anny), another renderer.

Clips are those of ``draw_clips.py``, seeds 1 to 8, which know how each segment is turned; ``--clips`` names others. The tracker
has the fuller human, scaled to ``static.trc`` or made from points, region and keypoints, no start and no background, parameters
at their defaults. Angles are the ISB's, of the online states.

``angles.JOINT_AXIS_rms_deg``: root mean square over both sides and all clips, without one constant offset a side and clip;
``raw_deg`` with it. Axial rotations, and the arm's plane of elevation, are judged over the image sets whose own sigma is at most
8 degrees; ``fraction`` of all are these. ``within_2_sigma``: offset-free errors within two of their standard deviations.
Targets: 2 degrees of flexions, 4 of abductions, 8 of axial rotations. Wrists turn in clips that are drawn with ``--hands`` alone.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from benchmark._arguments import parser_of
from benchmark.clothed._clip import write_clip
from benchmark.clothed._people import KeptPeople, add_arguments
from benchmark.clothed._recording import ClothedClip, load_clip
from benchmark.clothed._runs import OWN_BODY_SETS, TOGETHER, followed, settings
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.angles._angles import KINDS, TARGETS_DEG, AngleErrors, angles_with_sigmas, errors_of, figures
from benchmark.clothed.person._body import MANNEQUIN
from benchmark.contour._runs import print_circumstances
from tracker_node.errors import SourceError, TrackerError
from tracker_node.evaluation.motion.isb_angles import angles_of_segments
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.report.metrics_file import report_metrics
from tracker_node.tracking.keypoints.body_from_points import body_from_points

QUICK_CLIPS, QUICK_SETS = 1, 12


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    try:
        folders = args.clips or [folder for seed in range(1, 9) if (folder := args.drawn / f"clip_{seed}").is_dir()]
        if args.quick and not folders:
            folders = [args.output / "clip_4"]
            write_clip(set_stage(4, Sources(args.drawn, None, MANNEQUIN, "guard", hands=True), QUICK_SETS), folders[0])
        if not folders:
            raise SourceError(args.drawn, "no clips; draw them by benchmark/clothed/draw_clips.py")
        errors: list[AngleErrors] = []
        for folder in folders[:QUICK_CLIPS] if args.quick else folders:
            clip = load_clip(folder, load_model(args.model))
            if not clip.rotations:
                raise SourceError(folder, "its segments' rotations are not known; draw it by benchmark/clothed/draw_clips.py")
            errors += measure(clip, args)
    except TrackerError as error:
        print(f"angles: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(told(errors, args.mark), args.json)
    return 0


def measure(clip: ClothedClip, args: argparse.Namespace) -> list[AngleErrors]:
    """Track a clip as live, and compare."""
    people = KeptPeople(pose_weights(), args.output / f"{clip.name}.sqlite", args.near)
    if args.own_body:
        seen = [[people.find(np.ascontiguousarray(i.bgr), None).people for i in s.images] for s in clip.sets(0, OWN_BODY_SETS)]
        clip = replace(clip, model=body_from_points(load_model(args.model), clip.rig, seen).model)
    estimates = followed(clip, settings(TOGETHER, args.changes), people.with_people, QUICK_SETS if args.quick else None)
    rows = [row for row, _ in estimates]
    found = angles_with_sigmas(clip.model, [each.state for _, each in estimates], [each.covariance for _, each in estimates])
    errors = errors_of(found, angles_of_segments(clip.rotations), np.array(rows))
    worst = sorted(errors, key=lambda each: -float(np.sqrt(np.mean(each.free**2))) if len(each.free) else 0.0)[:4]
    told_worst = ", ".join(f"{each.name} {np.degrees(np.sqrt(np.mean(each.free**2))):.1f}" for each in worst)
    print(f"{clip.name}: {len(rows)} sets; worst {told_worst}", file=sys.stderr, flush=True)
    return errors


def told(errors: list[AngleErrors], mark: str = "") -> dict[str, float | int]:
    """Metrics by key, and a table of them; ``mark`` is put behind the keys' first word."""
    result: dict[str, float | int] = {}
    print(f"{'angle':30}{'rms':>7}{'target':>8}{'raw':>7}{'sets':>7}{'2 sigma':>9}   degrees")
    for name, kind in KINDS.items():
        own = [each for each in errors if each.name == name]
        if own:
            f = figures(own)
            missed = "  unobservable" if not f.fraction else "" if f.rms_deg <= TARGETS_DEG[kind] else "  misses"
            print(
                f"{name:30}{f.rms_deg:7.2f}{TARGETS_DEG[kind]:8.0f}{f.raw_deg:7.2f}{f.fraction:7.2f}{f.within_2_sigma:9.2f}{missed}"
            )
            key = f"angles{mark}.{name}"
            result |= {f"{key}_rms_deg": f.rms_deg, f"{key}_raw_deg": f.raw_deg, f"{key}_within_2_sigma": f.within_2_sigma}
            if f.fraction < 1.0:
                result[f"{key}_fraction"] = f.fraction
    return result


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "OMP_NUM_THREADS=1 python benchmark/clothed/angles/angles.py --clips out/clothed/clip_1",
        "one clip's first image sets; a mannequin's where none are drawn",
    )
    add_arguments(parser, "clip_1 to clip_8", Path("out/benchmark/angles"))
    add = parser.add_argument
    add("--model", default="gait_human", metavar="MODEL", help="the body (default: %(default)s)")
    add("--mark", default="", metavar="TEXT", help="put behind the keys' first word, for runs that differ")
    add("--own-body", action="store_true", help="made from the points of the first five image sets, not from static.trc")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
