#!/usr/bin/env python3
"""How long one image set takes: six variables, three cameras of 768x576, a start 60 mm and 6 degrees off.

From handing over the images to the answer, for every optimizer: milliseconds (median and 95th percentile), multiples of the fixed
reference kernel, how many scores (or linearizations) it asked for, and how far off it ended. ``stepping`` looks at fewer rows
in its early loops, ``stepping_published`` at all of them; the images are drawn by another renderer than the one that scores.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from tracker_node.objective.color.score import ColorObjective
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.color._fits import contestants
from benchmark.color._scene import ColorScene, displaced, make_scene, root_error

START_M, START_RAD = 0.06, np.radians(6.0)
N_STATES = 11
PAPER_EVALUATIONS_PER_VARIABLE = 20


def measure(scene: ColorScene, trials: int, seed: int = 0) -> dict[str, float]:
    """All figures."""
    reference = reference_ms()
    metrics: dict[str, float] = {
        "step.reference_ms": reference,
        "step.mask_pixels": _mask_pixels(scene),
        "step.paper_evaluations_per_variable": PAPER_EVALUATIONS_PER_VARIABLE,
    }
    for name, contestant in contestants(scene).items():
        rng = np.random.default_rng(seed)  # the same starts for each
        for truth, images in zip(scene.truth[:2], scene.images, strict=False):
            contestant(images, truth)  # compile
        times, evaluations, errors = [], [], []
        for trial in range(trials):
            truth, images = scene.truth[trial % len(scene.truth)], scene.images[trial % len(scene.truth)]
            start = displaced(truth, START_M, START_RAD, rng)
            began = time.perf_counter()
            found = contestant(images, start)
            times.append(1e3 * (time.perf_counter() - began))
            evaluations.append(found.evaluations)
            errors.append(root_error(found.state, truth))
        key = f"step.{name}"
        metrics[f"{key}_ms"], metrics[f"{key}_ms_p95"] = np.percentile(times, [50, 95]).tolist()
        metrics[f"{key}_per_reference"] = metrics[f"{key}_ms"] / reference
        metrics[f"{key}_evaluations"] = float(np.mean(evaluations))
        for unit, values in zip(("mm", "deg"), np.transpose(errors), strict=True):
            metrics[f"{key}_error_{unit}_p50"], metrics[f"{key}_error_{unit}_p90"] = np.percentile(values, [50, 90]).tolist()
    return metrics


def _mask_pixels(scene: ColorScene) -> float:
    """Of all cameras together, mean over the states."""
    score = ColorObjective(scene.model, scene.rig)
    pixels = []
    for truth, images in zip(scene.truth, scene.images, strict=True):
        score.set_images(images)
        pixels.append(score.evaluate(truth).camera_pixels.sum())
    return float(np.mean(pixels))


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/color/step.py --json out/color_step.json", "a few image sets only: shows that it runs"
    )
    parser.add_argument("--trials", type=int, default=110, help="image sets for each optimizer (%(default)s)")
    args = parser.parse_args(arguments)
    metrics = measure(make_scene(2), 4) if args.quick else measure(make_scene(N_STATES), args.trials)
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
