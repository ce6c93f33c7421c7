#!/usr/bin/env python3
"""A real person by contours, without a picture of the empty scene: the Balancing clip, 4 cameras of 544x960, 100 image sets.

``balancing``: all cameras. Errors against joints triangulated from 2D detections, good to 3 to 5 cm: with their constant lag of
about an image taken out, and with a constant offset per landmark taken out too. Silhouettes against masks drawn by hand
(cam01, cam02) and made from stills (cam03, cam04), over the images that have one.
``balancing_2cams``: cameras 1 and 3 only. ``balancing_stride8``: every 8th image set, 7.5 Hz.
``balancing_basin.6deg_20mm``: 20 starts, every joint axis off by 6 degrees, up or down, the root by 20 mm and 6 degrees in any
direction, from where the undisturbed run has the body in its first set; that run begins where the sample's files have it. A start
succeeds if over the last 5 of 25 sets no evaluated joint is farther than 60 mm from where the undisturbed run has it, nor than
200 mm from the truth, where that is known; ``reference_mm`` is how far the undisturbed run itself is off then.

Every other run begins in the first image set, where the tracker has found the body by itself: it is shown the four cameras
without being told where the body is, and from the set in which it has found it, it goes back to the first one. ``--start given``:
where the sample's files have it, good to some centimeters.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.contour._balancing_clip import Clip, Run, judge, load_clip, silhouettes, track
from benchmark.contour._runs import setting
from tracker_node.errors import TrackerError
from tracker_node.evaluation.evaluate import ErrorSeries, Evaluation
from tracker_node.evaluation.metrics import LOST_JOINT_M
from tracker_node.evaluation.truth.files import EVALUATED_JOINTS
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.render.overlay import draw_overlay
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import load_config
from tracker_node.tracking.config import TrackerConfig, updated
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

PARTS = ("balancing", "2cams", "stride8", "basin")
CONFIG = Path(__file__).resolve().parents[2] / "config/balancing.yaml"
TWO_CAMERAS = ("cam01", "cam03")
STRIDE = 8
LAG_IMAGES = 0.9  # of the images behind the joints, as whole runs find it; for runs that are too short to tell
FEW_SETS = 60
WARM_UP = 5
BASIN_DEG, BASIN_MM, BASIN_STARTS, BASIN_SETS, BASIN_JUDGED = 6.0, 20.0, 20, 25, 5
SAME_JOINT_M = 0.060


def main() -> int:
    args = _arguments()
    try:
        config = configured(args.config, args.set)
        clip = _clip_of(args)
        n = args.sets or (20 if args.quick else len(clip.sets))
        given, figures, parts = clip, {}, args.only or PARTS
        if args.start == "own" and set(parts) != {"basin"}:
            state, figures = own_start(clip, config, args)
            clip = replace(clip, start=state)
        for part in parts:
            figures |= MEASURE[part](given if part == "basin" else clip, config, n, args)
    except TrackerError as error:
        print(f"contour_balancing: error: {error}", file=sys.stderr)
        return 2
    report_metrics(figures, args.json)
    return 0


def configured(path: Path, changes: Sequence[str]) -> TrackerConfig:
    """The configuration of a file, with ``group.name=value`` on top."""
    return updated(load_config(path), dict(map(setting, changes)), "--set")


def _clip_of(args: argparse.Namespace) -> Clip:
    named = None if args.start in ("own", "given") else Path(args.start)
    return load_clip(args.sample, args.cache, rig=args.rig, model=args.model, start=named)


def make_tracker(clip: Clip, config: TrackerConfig, args: argparse.Namespace, start: State | None = None) -> Tracker:
    """``start``: instead of the one asked for."""
    backgrounds = {name: b for name, b in clip.backgrounds.items() if name in clip.rig.names} if args.backgrounds else {}
    return Tracker(clip.rig, clip.model, config, backgrounds, start or clip.start)


def own_start(clip: Clip, config: TrackerConfig, args: argparse.Namespace) -> tuple[State, dict[str, float | int]]:
    """The state in the first image set, found without being told; how many sets were looked at for it, and the longest time.

    Raises
    ------
    TrackerError : nothing was found.
    """
    tracker = Tracker(clip.rig, clip.model, config, clip.backgrounds if args.backgrounds else {})
    times: list[float] = []
    for image_set in clip.sets:
        estimate = tracker.step(image_set)
        times.append(estimate.timings.total_ms)
        if estimate.status is not Status.INITIALIZING:
            break
    else:
        raise TrackerError(f"no start was found: {estimate.status_reason}")
    n = len(times)
    last_ns = estimate.stamp_ns
    backward = [replace(s, stamp_ns=2 * last_ns - s.stamp_ns, images=_mirrored(s, last_ns)) for s in clip.sets[n - 1 :: -1]]
    state = track(make_tracker(clip, config, args, estimate.state), backward).states[-1]
    return state, {"balancing.start_sets": n, "balancing.start_s": 1e-3 * max(times)}


def _mirrored(image_set: ImageSet, about_ns: int) -> tuple[CameraImage, ...]:
    """The images with stamps as though time ran the other way."""
    return tuple(replace(image, stamp_ns=2 * about_ns - image.stamp_ns) for image in image_set.images)


def whole(clip: Clip, config: TrackerConfig, n: int, args: argparse.Namespace) -> dict[str, float | int]:
    run = track(make_tracker(clip, config, args), clip.sets[:n])
    result = judge(clip, run, "balancing", _lag(n))
    found = result.metrics()
    figures = {
        key: found[f"balancing.{key}"] for key in ("mpjpe_mm", "mpjpe_offset_free_mm", "lost_sets", "lost_limbs", "lag_images")
    }
    ious = {camera: float(np.mean(values)) for camera, values in silhouettes(clip, run).ious.items() if values}
    figures["iou_min"] = min(ious.values())
    figures |= {f"iou_{camera}": value for camera, value in ious.items()}
    p50, p95 = np.percentile(run.times_ms[WARM_UP:], [50, 95])
    reference = reference_ms()
    figures |= {
        "set_ms": float(p50),
        "set_ms_p95": float(p95),
        "set_in_references": float(p50 / reference),
        "reference_ms": reference,
    }
    figures["iterations"] = float(np.mean([e.iterations for e in run.estimates]))
    figures["observe_ms"] = float(np.median([e.timings.observe_ms for e in run.estimates]))
    figures["optimize_ms"] = float(np.median([e.timings.optimize_ms for e in run.estimates]))
    counts = Counter(estimate.status for estimate in run.estimates)
    figures |= {f"sets_{status.name.lower()}": counts[status] for status in (Status.TRACKING, Status.DEGRADED, Status.LOST)}
    if args.details:
        _show_details(result)
    if args.pictures:
        write_sheet(args.pictures / "balancing.png", clip, run)
    return {f"balancing.{key}": value for key, value in figures.items()}


def two_cameras(clip: Clip, config: TrackerConfig, n: int, args: argparse.Namespace) -> dict[str, float | int]:
    fewer = clip.with_cameras(TWO_CAMERAS)
    run = track(make_tracker(fewer, config, args), fewer.sets[:n])
    result = judge(fewer, run, "balancing_2cams", _lag(n))
    if args.details:
        _show_details(result)
    if args.pictures:
        write_sheet(args.pictures / "balancing_2cams.png", clip, run)
    return _short(result, ("mpjpe_mm", "mpjpe_offset_free_mm", "lost_sets", "lost_limbs"))


def every_eighth(clip: Clip, config: TrackerConfig, n: int, args: argparse.Namespace) -> dict[str, float | int]:
    run = track(make_tracker(clip, config, args), clip.sets[::STRIDE])
    result = judge(clip, run, "balancing_stride8", LAG_IMAGES / STRIDE)
    if args.details:
        _show_details(result)
    if args.pictures:
        write_sheet(args.pictures / "balancing_stride8.png", clip, run)
    return _short(result, ("mpjpe_mm", "lost_sets", "lost_limbs", "image_sets"))


def basin(clip: Clip, config: TrackerConfig, n: int, args: argparse.Namespace) -> dict[str, float | int]:
    starts = 5 if args.quick else BASIN_STARTS
    undisturbed = track(make_tracker(clip, config, args), clip.sets[:BASIN_SETS])
    reference = judge(clip, undisturbed, "basin", LAG_IMAGES).raw
    rng = np.random.default_rng(7)
    tasks = [(disturbed(undisturbed.states[0], rng), _joints(clip.model, undisturbed), config, args) for _ in range(starts)]
    if args.processes > 1:
        with ProcessPoolExecutor(args.processes, get_context("spawn"), initializer=_take, initargs=(args,)) as pool:
            tried = list(pool.map(basin_trial, *zip(*tasks, strict=True)))
    else:
        _clips[:] = [clip]
        tried = [basin_trial(*task) for task in tasks]
    for number, (success, status, worst, off_mm) in enumerate(tried):
        if args.details:
            print(f"basin {number}: {'ok' if success else 'failed'}, {worst} {off_mm:.0f} mm, {status.name}", file=sys.stderr)
    name = f"balancing_basin.{BASIN_DEG:.0f}deg_{BASIN_MM:.0f}mm"
    failures = [status for success, status, *_ in tried if not success]
    return {
        name: 1.0 - len(failures) / starts,
        f"{name}_starts": starts,
        f"{name}_failures": len(failures),
        f"{name}_failures_told": sum(status is not Status.TRACKING for status in failures),
        f"{name}_reference_mm": float(np.nanmean(reference.per_set_mm()[-BASIN_JUDGED:])),
    }


_clips: list[Clip] = []  # the one that this process has trials of


def _take(args: argparse.Namespace) -> None:
    _clips[:] = [_clip_of(args)]


def basin_trial(
    start: State, wanted_m: np.ndarray, config: TrackerConfig, args: argparse.Namespace
) -> tuple[bool, Status, str, float]:
    """Whether a run from ``start`` arrives at ``wanted_m`` (n, m, 3); what it says then, and its worst joint, millimeters."""
    clip = _clips[0]
    run = track(make_tracker(clip, config, args, start), clip.sets[:BASIN_SETS])
    errors = np.linalg.norm(_joints(clip.model, run) - wanted_m, axis=-1)
    success = arrived(errors, judge(clip, run, "basin", LAG_IMAGES).raw)
    worst = int(errors[-1].argmax())
    return success, run.estimates[-1].status, EVALUATED_JOINTS[worst], float(1e3 * errors[-1, worst])


def arrived(errors_m: np.ndarray, against_truth: ErrorSeries) -> bool:
    """Whether a run is where it should be in its last sets: by ``errors_m`` (n, m) from the undisturbed run, and by the truth.

    Raises
    ------
    TrackerError : nothing is known of the truth in these sets.
    """
    known = against_truth.valid[-BASIN_JUDGED:]
    if not known.any():
        raise TrackerError(f"no joint of the last {BASIN_JUDGED} image sets has a truth to be compared with")
    off_m = against_truth.errors_m[-BASIN_JUDGED:][known]
    return bool(errors_m[-BASIN_JUDGED:].max() < SAME_JOINT_M and off_m.max() < LOST_JOINT_M)


MEASURE = dict(zip(PARTS, (whole, two_cameras, every_eighth, basin), strict=True))


def disturbed(state: State, rng: np.random.Generator) -> State:
    """Every joint axis off by ``BASIN_DEG``, up or down; the root moved and turned in a random direction."""
    tangent = np.radians(BASIN_DEG) * rng.choice([-1.0, 1.0], size=len(state.to_values()))
    for part, size in ((slice(0, 3), 1e-3 * BASIN_MM), (slice(3, 6), np.radians(BASIN_DEG))):
        direction = rng.normal(size=3)
        tangent[part] = size * direction / np.linalg.norm(direction)
    return state.retract(tangent)


def write_sheet(path: Path, clip: Clip, run: Run) -> None:
    """Overlays of every camera at five instants."""
    rows = []
    for i in np.linspace(0, len(run.estimates) - 1, 5).astype(int):
        estimate = run.estimates[i]
        image_set = next(s for s in clip.sets if s.stamp_ns == estimate.stamp_ns)
        configuration = Configuration(clip.model, estimate.state)
        views = [draw_overlay(image_set.get(camera.name).bgr, configuration, camera) for camera in clip.rig]
        rows.append(np.hstack([cv2.resize(view, (272, 480), interpolation=cv2.INTER_AREA) for view in views]))
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.vstack(rows))


def _joints(model: ArticulatedModel, run: Run) -> np.ndarray:
    """(n, m, 3) evaluated joints."""
    columns = [model.landmark_index(name) for name in EVALUATED_JOINTS]
    return np.array([Configuration(model, state).landmarks_world[columns] for state in run.states])


def _lag(n: int) -> float | None:
    return LAG_IMAGES if n < FEW_SETS else None


def _short(result: Evaluation, keys: Sequence[str]) -> dict[str, float | int]:
    found = result.metrics()
    return {f"{result.name}.{key}": found[f"{result.name}.{key}"] for key in keys}


def _show_details(result: Evaluation) -> None:
    """Error per joint, raw and offset-free, and over time."""
    for name, raw, free in zip(result.joints, result.raw.per_joint_mm(), result.offset_free.per_joint_mm(), strict=True):
        print(f"{result.name}: {name:16s} {raw:6.1f} {free:6.1f} mm", file=sys.stderr)
    print(f"{result.name}: every 10th set {np.round(result.raw.per_set_mm()[::10])}", file=sys.stderr)
    print(f"{result.name}: lost limbs {result.lost_limbs}, lost sets {np.flatnonzero(result.lost)}", file=sys.stderr)


def _arguments() -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "python benchmark/contour/balancing.py --only balancing --set modalities=region --details",
        "20 image sets, 5 starts",
    )
    add = parser.add_argument
    add("--only", nargs="+", choices=PARTS, metavar="PART", help=f"only these of {' '.join(PARTS)}")
    add("--sets", type=int, metavar="N", help="only the first N image sets")
    add("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="parameters, e.g. chamfer.max_iterations=8")
    add("--config", type=Path, default=CONFIG, metavar="FILE", help="parameters of the tracker (default: %(default)s)")
    add("--backgrounds", action="store_true", help="use the images of the background")
    add("--rig", type=Path, metavar="FILE", help="another rig than the sample's refined one")
    add("--model", type=Path, metavar="FILE", help="another body than the sample's")
    add("--start", default="own", metavar="own|given|FILE", help="where the body is at first: see above (default: own)")
    add("--processes", type=int, default=1, metavar="N", help="starts of the basin side by side (default: %(default)s)")
    add("--details", action="store_true", help="errors per joint, and what is lost, on stderr")
    add("--pictures", type=Path, metavar="FOLDER", help="write contact sheets here")
    add("--sample", type=Path, default=Path("out/demo/sample"), metavar="FOLDER", help="made if it is not there")
    add("--cache", type=Path, default=Path("out/benchmark/balancing"), metavar="FOLDER", help="decoded images, 630 MB")
    return parser.parse_args()


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
