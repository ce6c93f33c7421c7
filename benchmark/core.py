#!/usr/bin/env python3
"""How long the whole core takes for one image set: BGR arrays in, state with covariance out.

Six cameras of 640x480 watch the 40-degree-of-freedom human of cones and ellipsoids move in a furnished room. Every image set is
given exactly five iterations with 25 samples a line, with the evidence that the tracker uses by default (plate, shadows and
colors, edges, distances), on two threads and on one. Milliseconds stand beside their multiple of one fixed reference kernel.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from _reference import reference_ms
from contour_accuracy import DEFAULT_CACHE

from tracker_node.cli.synthesize import Request, produce, show_progress
from tracker_node.evaluation.image_sets import SourceStream
from tracker_node.evaluation.metrics_file import print_metrics, write_metrics
from tracker_node.loaders.image_source import SourceOptions
from tracker_node.loaders.model_yaml import load_model
from tracker_node.loaders.plate_file import load_plates
from tracker_node.loaders.rig_yaml import load_rig
from tracker_node.loaders.state_yaml import load_state
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.tracker import Tracker

ITERATIONS, SAMPLES, N_IMAGES = 5, 25, 30  # the quick cones of contour_accuracy.py
WARM_UP = 5


def main() -> int:
    args = _arguments()
    folder = args.cache / f"cones-{N_IMAGES}"
    produce(Request(subject="model", motion="waves", n_images=N_IMAGES), folder, progress=show_progress)
    rounds = 1 if args.quick else 5
    figures: dict[str, float | int] = {}
    reference = reference_ms()
    for threads in (2, 1):
        times, stages, iterations = measure(folder, configuration(threads), rounds)
        suffix = "" if threads == 2 else "_one_thread"
        p50, p95 = np.percentile(times, [50, 95])
        figures |= {f"core.set_ms_p50{suffix}": float(p50), f"core.set_ms_p95{suffix}": float(p95)}
        figures |= {f"core.set_ms_min{suffix}": float(times.min()), f"core.set_in_references_p50{suffix}": float(p50 / reference)}
        figures |= {f"core.observe_ms_p50{suffix}": float(stages[0]), f"core.optimize_ms_p50{suffix}": float(stages[1])}
        figures[f"core.iterations{suffix}"] = iterations
    figures |= {"core.cameras": 6, "core.dof": 40, "core.samples_per_line": SAMPLES, "core.reference_ms": reference}
    print_metrics(figures)
    if args.json:
        write_metrics(args.json, figures)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  python benchmark/core.py --quick --json out/benchmark/core.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="every image set once instead of five times")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    return parser.parse_args()


def configuration(threads: int) -> TrackerConfig:
    """Five iterations whatever the cost does (a tolerance of zero), the rest as by default."""
    optimizer = {"max_iterations": ITERATIONS, "coarse_iterations": 2, "tolerance": 0.0, "samples_per_line": SAMPLES}
    return from_dict({"threads": threads, "optimizer": optimizer})


def measure(folder: Path, config: TrackerConfig, rounds: int) -> tuple[np.ndarray, tuple[float, float], float]:
    """Milliseconds of every image set; medians of observing and optimizing; mean iterations."""
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    sets: list[ImageSet] = list(SourceStream(rig, config.synchronizer, SourceOptions()))
    tracker = Tracker(rig, model, config, load_plates(rig), load_state(folder / "state.yaml", model))
    times, stages, iterations = [], [], []
    gc.disable()
    for _ in range(rounds):
        tracker.reset()
        for i, image_set in enumerate(sets):
            start = time.perf_counter()
            estimate = tracker.step(image_set)
            elapsed = 1e3 * (time.perf_counter() - start)
            if i >= WARM_UP:
                times.append(elapsed)
                stages.append((estimate.timings.observe_ms, estimate.timings.optimize_ms))
                iterations.append(estimate.iterations)
    gc.enable()
    observe, optimize = np.median(np.array(stages), axis=0)
    return np.array(times), (float(observe), float(optimize)), float(np.mean(iterations))


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
