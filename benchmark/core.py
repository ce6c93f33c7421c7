#!/usr/bin/env python3
"""How long the whole core takes for one image set: BGR arrays in, state with covariance out.

Six cameras of 640x480 watch the 40-degree-of-freedom human of 18 parts move in a furnished room. ``set_ms``: evidence from the
full images; ``roi_set_ms``: only in the region around the predicted body, which is how the tracker works. Correspondence lines
(``modalities: [region]``) read nothing but the pixels along them, so that both are the same run. The chamfer evidence
(plate, shadows and colors, edges, distances) is given exactly five iterations with 25 samples a line, lines their scales as
configured. ``latency_ms``: until the state is there, from which is learned after that. On two threads, on one and on four;
``speedup_2t``: one over two; ``loaded_2t``: the same while other programs take every processor. Milliseconds stand beside their
multiple of one fixed reference kernel.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tracker_node.loaders.images.source import SourceOptions, load_backgrounds
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.image_sets import SourceStream
from tracker_node.synthesis.recording import Request, produce, show_progress
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.tracker import Tracker

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the repository

from benchmark._reference import reference_ms
from benchmark.contour._runs import clip_parser, configured, print_circumstances

ITERATIONS, SAMPLES, N_IMAGES = 5, 25, 30  # the quick cones of contour_accuracy.py
WARM_UP = 5
THREADS = {2: "", 1: "_one_thread", 4: "_four_threads"}
WHOLE_PX = 1000  # around the body: more than an image is large


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    folder = args.cache / f"cones-{N_IMAGES}"
    produce(Request(subject="model", motion="waves", n_images=N_IMAGES), folder, progress=show_progress)
    rounds = 1 if args.quick else 5
    figures: dict[str, float | int] = {}
    reference = reference_ms()
    for threads, suffix in THREADS.items():
        region = configuration(threads, args.changes)
        roi = measure(folder, region, rounds)
        whole = roi if "chamfer" not in region.modalities else measure(folder, full_images(region), rounds)
        figures |= timing_figures("", suffix, *whole, reference) | timing_figures("roi_", suffix, *roi, reference)
    figures["core.speedup_2t"] = figures["core.set_ms_p50_one_thread"] / figures["core.set_ms_p50"]
    figures["core.loaded_2t"] = loaded_speedup(folder, args.changes, rounds)
    samples = region.chamfer.samples_per_line if "chamfer" in region.modalities else region.region.samples_per_line
    figures |= {"core.cameras": 6, "core.dof": 40, "core.samples_per_line": samples, "core.reference_ms": reference}
    figures["core.regions_only"] = int("chamfer" not in region.modalities)
    print(f"modalities: {', '.join(region.modalities)}")
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def loaded_speedup(folder: Path, changes: list[str], rounds: int) -> float:
    """How much sooner two threads are done than one where a busy program stands on every processor; less than one: later."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        times = {n: [] for n in (1, 2)}
        for _ in range(2):  # in turn, since the machine's other load changes
            for threads, found in times.items():
                found.append(measure(folder, configuration(threads, changes), rounds)[0][:, 0])
        return float(np.median(np.concatenate(times[1])) / np.median(np.concatenate(times[2])))
    finally:
        for program in busy:
            program.kill()
            program.wait()


def timing_figures(
    prefix: str, suffix: str, times: np.ndarray, stages: tuple[float, float], counts: tuple[float, float], reference: float
) -> dict[str, float]:
    """Figures of one run; ``counts`` are mean iterations and samples."""
    (p50, latency), (p95, _) = np.percentile(times, [50, 95], axis=0)
    figures = {
        "set_ms_p50": float(p50), "set_ms_p95": float(p95), "set_ms_min": float(times[:, 0].min()),
        "latency_ms_p50": float(latency), "latency_in_references_p50": float(latency / reference),
        "set_in_references_p50": float(p50 / reference), "observe_ms_p50": stages[0], "optimize_ms_p50": stages[1],
        "iterations": counts[0], "samples": counts[1],
    }  # fmt: skip
    return {f"core.{prefix}{key}{suffix}": value for key, value in figures.items()}


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = clip_parser(__doc__, "python benchmark/core.py --quick --json out/benchmark/core.json")
    return parser.parse_args(arguments)


def configuration(threads: int, changes: list[str]) -> TrackerConfig:
    """By chamfer five iterations whatever the cost does (a tolerance of zero), the rest as by default."""
    config = configured(changes, threads=threads)
    if config.modalities == ("region",):
        return config
    five = {"max_iterations": ITERATIONS, "coarse_iterations": 2, "tolerance": 0.0, "samples_per_line": SAMPLES}
    return replace(config, chamfer=replace(config.chamfer, **five))


def full_images(config: TrackerConfig) -> TrackerConfig:
    """The same, looking at every pixel."""
    return replace(config, chamfer=replace(config.chamfer, margin_px=WHOLE_PX, reach_px=WHOLE_PX))


def measure(folder: Path, config: TrackerConfig, rounds: int) -> tuple[np.ndarray, tuple[float, float], tuple[float, float]]:
    """Milliseconds of every image set, (n, 2), and until its state is there; medians of observing and optimizing; mean iterations
    and samples."""
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    sets: list[ImageSet] = list(SourceStream(rig, config.synchronizer, SourceOptions()))
    tracker = Tracker(rig, model, config, load_backgrounds(rig), load_state(folder / "state.yaml", model))
    times, stages, counts = [], [], []
    gc.disable()
    for _ in range(rounds):
        tracker.reset()
        for i, image_set in enumerate(sets):
            start = time.perf_counter()
            estimate = tracker.estimate(image_set)
            latency = 1e3 * (time.perf_counter() - start)
            tracker.learn()
            elapsed = 1e3 * (time.perf_counter() - start)
            if i >= WARM_UP:
                times.append((elapsed, latency))
                stages.append((estimate.timings.observe_ms, estimate.timings.optimize_ms))
                counts.append((estimate.iterations, sum(camera.samples for camera in estimate.cameras)))
    gc.enable()
    observe, optimize = np.median(np.array(stages), axis=0)
    iterations, samples = np.mean(np.array(counts), axis=0)
    return np.array(times), (float(observe), float(optimize)), (float(iterations), float(samples))


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
