#!/usr/bin/env python3
"""How accurate and how quick contours are without a picture of the empty room: a figure of ten cones in fast motion.

22 degrees of freedom; four cameras of 640x480, f = 560 px, 3.2 m away; noise of 4 gray levels, blur of 0.6 px; colored patterns
all around. ``figure`` is every image at 30 Hz, ``figure_stride2`` and ``figure_stride4`` every 2nd and 4th, ``figure_2cams`` two
cameras. ``figure_basin``: the figure stands still (another noise in every image), and every joint, the root's orientation and its
position start off by the stated amounts; the fraction of trials that have all joints within 20 mm after 20 image sets.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour._runs import (
    RATE_HZ,
    SCENE,
    Clip,
    accuracy_figures,
    clip_parser,
    configured,
    image_set,
    judged,
    print_circumstances,
    recorded,
    time_figures,
    track,
)
from tracker_node.errors import TrackerError
from tracker_node.experiments.contour.errors import displaced
from tracker_node.loaders.motion.trajectory_file import read_states
from tracker_node.model.configuration import Configuration, State
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import FIGURE_IMAGES, Request
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio
from tracker_node.synthesis.subjects.cones import ModelSubject
from tracker_node.synthesis.subjects.figure import speeds
from tracker_node.tracking.config import TrackerConfig

FIGURE_SCENE = replace(SCENE, radius=3.2, focal_px=560.0)
RUNS = {"figure": (1, 4), "stride2": (2, 4), "stride4": (4, 4), "2cams": (1, 2)}  # stride, cameras
BASINS = {"6deg_20mm": (6.0, 0.020), "10deg_30mm": (10.0, 0.030)}
TRIALS = {"quick": 6, "full": 30}
BASIN_SETS, BASIN_WITHIN_M = 20, 0.020
QUICK_IMAGES = 24


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    figures: dict[str, float | int] = {}
    try:
        request = Request(subject="figure", n_images=FIGURE_IMAGES, scene=FIGURE_SCENE)
        clip = recorded("figure", request, args.cache)
        wanted = args.only or [*RUNS, "basin"]
        for name in (name for name in RUNS if name in wanted):
            figures |= sequence_figures(clip, name, args.changes, QUICK_IMAGES if args.quick else None)
        if "basin" in wanted:
            trials = args.trials or TRIALS["quick" if args.quick else "full"]
            for name in (name for name in BASINS if name in (args.basins or BASINS)):
                figures |= basin_figures(clip, FIGURE_SCENE, name, configured(args.changes), trials)
    except TrackerError as error:
        print(f"contour_figure: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = clip_parser(__doc__, "python benchmark/contour/figure.py --only figure basin --set threads=1", [*RUNS, "basin"])
    parser.add_argument("--basins", nargs="+", choices=BASINS, help="only these starts of the basin")
    parser.add_argument("--trials", type=int, metavar="N", help="trials of each start")
    return parser.parse_args(arguments)


def sequence_figures(clip: Clip, name: str, changes: list[str], n_images: int | None) -> dict[str, float | int]:
    """Every ``stride``-th image of the clip, tracked from its first pose."""
    stride, n_cameras = RUNS[name]
    config = configured(changes, synchronizer__image_period_s=stride / RATE_HZ)
    clip = clip.with_cameras(range(n_cameras))
    limit = None if n_images is None else -(-n_images // stride)
    sets = list(clip.sets(stride, limit))  # nobody decodes beside what is timed
    track(clip, config, sets[:2])  # compiles, or loads what was compiled
    run = track(clip, config, sets)
    prefix = name if name == "figure" else f"figure_{name}"
    figures = accuracy_figures(judged(clip, run, prefix)) | time_figures(run, config, prefix)
    if name == "figure":
        if config.threads == 2:
            alone = track(clip, replace(config, threads=1), sets)
            one = time_figures(alone, config, prefix)[f"{prefix}.set_ms_p50"]
            figures[f"{prefix}.speedup_2t"] = one / figures[f"{prefix}.set_ms_p50"]
        moved_m, turned = speeds(clip.model, true_states(clip))
        figures |= {f"{prefix}.motion_mm_per_image": 1e3 * moved_m, f"{prefix}.motion_deg_per_image": float(np.degrees(turned))}
    return figures


def true_states(clip: Clip) -> list[State]:
    return [State.from_values(row.values) for row in read_states(clip.folder / "true_states.csv").rows]


def basin_figures(
    clip: Clip, scene: SceneConfig, name: str, config: TrackerConfig, trials: int, n_sets: int = BASIN_SETS
) -> dict[str, float | int]:
    """Poses of the clip, held still, each tracked from another wrong start."""
    angle_deg, shift_m = BASINS[name]
    poses = true_states(clip)
    rng = np.random.default_rng(int(angle_deg))
    subject = ModelSubject(clip.model)
    errors_m, ends_m = [], []
    with Studio(clip.rig, scene) as studio:
        for trial in range(trials):
            pose = poses[trial * len(poses) // trials]
            views = studio.views(subject.mesh(Configuration(clip.model, pose)))
            images = (studio.exposed(views, 1000 * trial + i) for i in range(n_sets))
            sets = (image_set(clip.rig, one, round(i * 1e9 / RATE_HZ)) for i, one in enumerate(images))
            start = displaced(pose, np.radians(angle_deg), shift_m, rng)
            run = track(replace(clip, start=start), config, sets)
            ends_m.append(_worst_joint_m(clip, run.estimates[-1].state, pose))
            errors_m.append(_worst_joint_m(clip, start, pose))
            said = run.estimates[-1].status.name
            print(f"basin {name}: trial {trial}: {1e3 * errors_m[-1]:.0f} -> {1e3 * ends_m[-1]:.1f} mm, {said}", file=sys.stderr)
    return {
        f"figure_basin.{name}": float(np.mean(np.array(ends_m) < BASIN_WITHIN_M)),
        f"figure_basin.{name}_trials": trials,
        f"figure_basin.{name}_start_mm": float(1e3 * np.mean(errors_m)),
        f"figure_basin.{name}_end_median_mm": float(1e3 * np.median(ends_m)),
    }


def _worst_joint_m(clip: Clip, state: State, truth: State) -> float:
    found, true = (Configuration(clip.model, s).landmarks_world for s in (state, truth))
    return float(np.linalg.norm(found - true, axis=1).max())


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
