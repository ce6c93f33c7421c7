#!/usr/bin/env python3
"""Clothed people before walls of their clothes' colors: points and contours together, and each alone, against exact joints.

Clips: ``jump`` and ``box``, rendered by others (``clothed_people`` beside the other recordings that TRACKER_SHARED_DATA
names), and seeds 1 to 8 of ``draw_clips.py`` where they are drawn; ``--clips`` names others. The body has ankles, and is
scaled to ``static.trc``; parameters are the defaults, no background is known, states are those of the moment.
``clothed_CLIP``: modalities region and keypoints, the body is found in the first image set; ``..._points``: keypoints alone;
``..._contours``: region alone, from the true state; ``..._own_body``: both modalities, the body made from the points of the
first five image sets; ``bone_error_mm``: of the lengths of its eight limb bones. ``clothed_1cam``: as together, each camera
alone, which finds the body in its own images, over all clips and cameras; ``_floor``: with ``floor.enabled``.
``mpjpe12_mm``, ``offset_free12_mm``: mean error of 12 joints, raw, and without one constant offset a joint in the world.

``clothed.wrong_called_tracking``, ``right_called_lost``: fractions of the limb-sets that are wrong (end joint more than 150 mm
off) or right: together and contours as above, and together with a limb put wrong at the start, with a start of another moment,
with a fifth of the detections disturbed, with a limb behind a board in all cameras. ``right_called_tracking``: of the right ones
of which the true pose shows more than half; what other people and things hide is not known and counts as shown.
``within_2_sigma``: offset-free errors of points and contours together, axis by axis; ``least``, ``largest`` of the 12
joints. ``together_over_best``: the worst clip.
``points.swaps_wrong``: a fifth of the detections have left and right exchanged, or are of a person of another clip; fraction of
the images in which sides, or the person, are then taken wrong. ``start_clothed``: starts from random image sets, processor time
of networks and tracker until the first state; success where five sets later no joint is more than 150 mm off, and the mean no
more than 60 mm.

What the network finds is kept in the output folder, by pixels, crop, weights and code.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.clothed._disturbed import Decisions, disturbed_runs
from benchmark.clothed._judged import (
    Accuracy,
    LimbCounts,
    accuracy,
    limbs_of_run,
    together_over_best,
    within_sigmas,
    worst_joints,
    wrong_sets,
)
from benchmark.clothed._people import KeptPeople, add_arguments
from benchmark.clothed._recording import JOINTS, ClothedClip, default_folders, limbs_shown, load_clip
from benchmark.clothed._runs import (
    CONTOURS,
    ONE_CAMERA,
    ONE_ON_FLOOR,
    OWN_BODY,
    POINTS,
    TOGETHER,
    Run,
    bone_error_mm,
    settings,
    track,
    with_own_body,
    without_people,
)
from benchmark.clothed._starts import Trial, starts
from benchmark.contour._runs import WARM_UP, print_circumstances
from tracker_node.errors import SourceError, TrackerError
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.observation.keypoints.blazepose import BlazePoseFiles
from tracker_node.report.metrics_file import report_metrics

PARTS = ("own_body", "trust", "starts", "contours", "one_camera")
DEFAULT_SIZE = "full"
KINDS = (TOGETHER, POINTS, OWN_BODY, CONTOURS, ONE_CAMERA, ONE_ON_FLOOR)
QUICK_CONTOURS = 2  # clips of which contours alone are tracked in a quick run
OUTPUT = Path("out/benchmark/clothed")


@dataclass(eq=False)
class Found:
    """What has been measured so far; ``limbs`` by kind of run and clip."""

    runs: dict[str, list[Run]] = field(default_factory=lambda: {kind: [] for kind in KINDS})
    bones_mm: list[float] = field(default_factory=list)
    limbs: dict[tuple[str, str], LimbCounts] = field(default_factory=dict)
    decisions: Decisions = field(default_factory=Decisions)
    trials: list[Trial] = field(default_factory=list)


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    try:
        folders = args.clips or default_folders(args.drawn)
        if not folders:
            raise SourceError("clothed_people", "name folders with --clips, or that of all recordings by TRACKER_SHARED_DATA")
        clips = [load_clip(folder) for folder in folders]
        clips = [clip.seen_by(*args.cameras) for clip in clips] if args.cameras else clips
        files = weights_of(args.size, args.weights)
        found = measure(clips, files, args)
    except TrackerError as error:
        print(f"clothed: error: {error}", file=sys.stderr)
        return 2
    figures = figures_of(found, args.size)
    print_circumstances()
    print_table(found)
    report_metrics(figures, args.json)
    return 0


def weights_of(size: str, folder: Path | None) -> BlazePoseFiles:
    """Weights of the networks; those of other sizes than the default's lie in ``folder``."""
    if size == DEFAULT_SIZE:
        return pose_weights()
    if folder is None:
        raise SourceError(f"pose_landmark_{size}.tflite", "name its folder with --weights")
    return pose_weights(folder / f"pose_landmark_{size}.tflite")


def measure(clips: list[ClothedClip], files: BlazePoseFiles, args: argparse.Namespace) -> Found:
    """All runs; a line is printed for each."""
    found = Found()
    kept = {clip.name: KeptPeople(files, args.output / f"{clip.name}_{args.size}.sqlite", args.near) for clip in clips}
    for clip in clips:
        for kind in (TOGETHER, POINTS):
            _add(found, clip, track(clip, kind, settings(kind, args.changes), kept[clip.name].with_people))
    if "own_body" in args.only:
        for clip in clips:
            own = with_own_body(clip, kept[clip.name])
            found.bones_mm.append(bone_error_mm(clip, own.model))
            _add(found, own, track(own, OWN_BODY, settings(OWN_BODY, args.changes), kept[clip.name].with_people))
    if "trust" in args.only:
        for clip, run in zip(clips, found.runs[TOGETHER], strict=True):
            others = [each for each in found.runs[TOGETHER] if each.clip != clip.name]
            for disturbed, shown, decisions in disturbed_runs(clip, run, others, kept[clip.name].with_people, args):
                found.decisions += decisions
                _tell(found, disturbed, shown, f"; {decisions}" if decisions.images else "")
    if "starts" in args.only:
        for clip in clips:
            found.trials += starts(clip, kept[clip.name], 5 if args.quick else 20, args.changes)
    if "one_camera" in args.only:
        for clip in clips:
            for camera in clip.rig.names[:1] if args.quick else clip.rig.names:
                one = clip.seen_by(camera)
                for kind in (ONE_CAMERA, ONE_ON_FLOOR):
                    _add(found, one, track(one, kind, settings(kind, args.changes), kept[clip.name].with_people))
    if "contours" in args.only:  # a body that is lost is searched for long
        for clip in clips[:QUICK_CONTOURS] if args.quick else clips:
            _add(found, clip, track(clip, CONTOURS, settings(CONTOURS, args.changes), without_people, clip.start()))
    return found


def _add(found: Found, clip: ClothedClip, run: Run) -> None:
    found.runs[run.kind].append(run)
    _tell(found, run, limbs_shown(clip, run.rows))


def _tell(found: Found, run: Run, shown: np.ndarray, more: str = "") -> None:
    limbs = limbs_of_run(run, shown)
    key = run.kind, run.clip
    found.limbs[key] = found.limbs.get(key, LimbCounts()) + limbs
    result = accuracy(run)
    print(
        f"{run.clip}, {run.kind}: {result.mpjpe12_mm:.1f} mm, offset-free {result.offset_free12_mm:.1f}; lost limbs"
        f" {', '.join(result.lost_limbs) or 'none'}, sets {result.lost_sets} of {len(run.rows)}; state from set"
        f" {result.first_state_set}; wrong limb-sets {limbs.wrong} ({limbs.wrong_tracking} TRACKING), right {limbs.right}"
        f" ({limbs.right_lost} LOST); sets with a joint 200 mm off: {_ranges(wrong_sets(run))};"
        f" {np.median(run.step_ms):.0f} ms, network {np.median(run.network_ms):.0f} ms{more}",
        file=sys.stderr, flush=True,
    )  # fmt: skip


def _ranges(rows: np.ndarray) -> str:
    """``3-7, 12`` for rows 3 to 7 and 12."""
    parts = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1) if len(rows) else []
    return ", ".join(f"{part[0]}-{part[-1]}" if len(part) > 1 else str(part[0]) for part in parts) or "none"


def figures_of(found: Found, size: str) -> dict[str, float | int]:
    """Metrics by key; those of another network than the default have its name in them."""
    mark = "" if size == DEFAULT_SIZE else f"_{size}"
    figures: dict[str, float | int] = {}
    results = {kind: [accuracy(run) for run in runs] for kind, runs in found.runs.items()}
    for kind, ending in ((TOGETHER, ""), (POINTS, "_points"), (OWN_BODY, "_own_body"), (CONTOURS, "_contours")):
        for run, result in zip(found.runs[kind], results[kind], strict=True):
            name = f"clothed{mark}_{run.clip}{ending}"
            figures |= {
                f"{name}.mpjpe12_mm": result.mpjpe12_mm, f"{name}.offset_free12_mm": result.offset_free12_mm,
                f"{name}.lost_limbs": len(result.lost_limbs), f"{name}.lost_sets": result.lost_sets,
                f"{name}.first_state_set": result.first_state_set,
                f"{name}.within_2_sigma": float(within_sigmas([run]).mean()),
                f"{name}.wrong_called_tracking": found.limbs[kind, run.clip].fractions()["wrong_called_tracking"],
            }  # fmt: skip
    name = f"clothed{mark}"
    figures |= {
        f"clothed{mark}_{run.clip}_own_body.bone_error_mm": value
        for run, value in zip(found.runs[OWN_BODY], found.bones_mm, strict=True)
    }
    if found.bones_mm:
        figures[f"{name}.bone_error_mm"] = float(np.mean(found.bones_mm))
    for kind, ending in ((ONE_CAMERA, ""), (ONE_ON_FLOOR, "_floor")):
        figures |= _of_one_camera(found, kind, f"{name}_1cam{ending}", results[kind])
    apart = POINTS, ONE_CAMERA, ONE_ON_FLOOR
    limbs = sum((each for (kind, _), each in found.limbs.items() if kind not in apart), LimbCounts())
    figures |= {f"{name}.{key}": value for key, value in limbs.fractions().items()}
    figures |= {f"{name}.wrong_limb_sets": limbs.wrong, f"{name}.right_limb_sets": limbs.right}
    within = within_sigmas(found.runs[TOGETHER])
    figures |= {
        f"{name}.within_2_sigma": float(within.mean()), f"{name}.within_2_sigma_least": float(within.min()),
        f"{name}.within_2_sigma_largest": float(within.max()),
    }  # fmt: skip
    if found.runs[CONTOURS]:
        ratios = together_over_best(results[TOGETHER], results[POINTS], results[CONTOURS])
        figures[f"{name}.together_over_best"] = max(ratios.values())
        figures |= {f"{name}.together_over_best_{key}": value for key, value in ratios.items()}
    step, reference = _median_ms(found.runs[TOGETHER], "step_ms"), reference_ms()
    figures |= {
        f"{name}.set_ms": step, f"{name}.set_in_references": step / reference, f"{name}.reference_ms": reference,
        f"{name}.network_ms": _median_ms(found.runs[TOGETHER], "network_ms"),
    }  # fmt: skip
    decisions = found.decisions
    if decisions.images:
        figures |= {
            f"points{mark}.swaps_wrong": decisions.wrong, f"points{mark}.left_right_wrong": decisions.left_right_wrong,
            f"points{mark}.other_taken": decisions.other_taken, f"points{mark}.body_left_out": decisions.body_left_out,
            f"points{mark}.swaps_images": decisions.images,
        }  # fmt: skip
    if found.trials:
        figures |= {
            f"start_clothed{mark}.cpu_s": float(np.mean([trial.cpu_s for trial in found.trials])),
            f"start_clothed{mark}.cpu_s_max": max(trial.cpu_s for trial in found.trials),
            f"start_clothed{mark}.fraction": float(np.mean([trial.success for trial in found.trials])),
            f"start_clothed{mark}.trials": len(found.trials),
        }  # fmt: skip
    return figures


def _of_one_camera(found: Found, one_camera: str, name: str, results: list[Accuracy]) -> dict[str, float | int]:
    """Over all clips and cameras; errors within two standard deviations are those with their constant offsets."""
    runs = found.runs[one_camera]
    if not runs:
        return {}
    limbs = sum((each for (kind, _), each in found.limbs.items() if kind == one_camera), LimbCounts())
    fractions, errors_m = limbs.fractions(), np.concatenate([run.errors_m[run.has_state] for run in runs])
    return {
        f"{name}.wrong_called_tracking": fractions["wrong_called_tracking"], f"{name}.wrong_limb_sets": limbs.wrong,
        f"{name}.right_called_lost": fractions["right_called_lost"], f"{name}.right_limb_sets": limbs.right,
        f"{name}.within_2_sigma": float(within_sigmas(runs, offset_free=False).mean()),
        f"{name}.median_mm": 1e3 * float(np.median(errors_m)),
        f"{name}.first_state_set": max(result.first_state_set for result in results),
    }  # fmt: skip


def _median_ms(runs: list[Run], name: str) -> float:
    """Of the image sets after each run's first ones; nan where there are none."""
    times = np.concatenate([getattr(run, name)[WARM_UP:] for run in runs])
    return float(np.median(times)) if len(times) else float("nan")


def print_table(found: Found) -> None:
    """Every clip beside the modalities alone, its worst joints, and limbs by kind of run."""
    print("\nraw / offset-free mm, lost limbs, lost sets; the worst joints together")
    print(f"{'clip':12s}" + "".join(f"{kind:>24s}" for kind in found.runs))
    for run in found.runs[TOGETHER]:
        results = [[accuracy(each) for each in runs if each.clip == run.clip] for runs in found.runs.values()]
        cells = [
            f"{r.mpjpe12_mm:.1f} / {r.offset_free12_mm:.1f}, {len(r.lost_limbs)}, {r.lost_sets}" for each in results for r in each
        ]
        print(f"{run.clip:12s}" + "".join(f"{cell:>24s}" for cell in cells) + f"   {worst_joints(run)}")
    within = within_sigmas(found.runs[TOGETHER])
    print("within 2 sigma: " + ", ".join(f"{joint} {value:.2f}" for joint, value in zip(JOINTS, within, strict=True)))
    titles = ("wrong", "TRACKING", "DEGRADED", "right", "LOST", "DEGRADED", "shown", "TRACKING")
    print(f"\n{'limb-sets':12s}" + "".join(f"{title:>10s}" for title in titles))
    for kind in dict.fromkeys(kind for kind, _ in found.limbs):
        limbs = sum((each for (own, _), each in found.limbs.items() if own == kind), LimbCounts())
        print(f"{kind:12s}" + "".join(f"{count:10d}" for count in limbs.values))
    print(flush=True)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "OMP_NUM_THREADS=1 python benchmark/clothed/clothed.py --only --clips out/clothed/clip_1",
        "fewer disturbed runs and starts, contours alone on two clips",
    )
    add_arguments(parser, "clip_1 to clip_8", OUTPUT)
    add = parser.add_argument
    add("--only", nargs="*", choices=PARTS, default=PARTS, metavar="PART", help=f"beside points: {', '.join(PARTS)}")
    add("--cameras", nargs="+", default=(), metavar="CAMERA", help="by which the clips are seen (default: all)")
    add("--size", default=DEFAULT_SIZE, choices=("lite", "full", "heavy"), help="of the network (default: %(default)s)")
    add("--weights", type=Path, metavar="FOLDER", help="of pose_landmark_SIZE.tflite for another size")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
