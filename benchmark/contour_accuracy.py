#!/usr/bin/env python3
"""How accurate the contour tracker is where truth is exact: on its own body, and on a person that is not its model.

``cones`` is the tracker's own model in motion: what is left is the method's error. ``mannequin_*`` is a skinned, dressed body in
captured motions, to which the model was scaled by a T-pose: what is left besides is the model's. Both are rendered by another
renderer than the tracker's, in a furnished room, with lens distortion, blur, noise and a shadow; 6 cameras of 640x480, 30 Hz.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tracker_node.cli.synthesize import Request, default_motions, produce, show_progress
from tracker_node.errors import TrackerError
from tracker_node.evaluation.evaluate import Evaluation, EvaluationOptions, evaluate
from tracker_node.evaluation.image_sets import SourceStream
from tracker_node.evaluation.metrics_file import print_metrics, write_metrics
from tracker_node.evaluation.run_data import RunData
from tracker_node.evaluation.truth import load_truth
from tracker_node.loaders.image_source import SourceOptions
from tracker_node.loaders.model_yaml import load_model
from tracker_node.loaders.plate_file import load_plates
from tracker_node.loaders.rig_yaml import load_rig
from tracker_node.loaders.state_yaml import load_state
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.tracker import Tracker

CONES_IMAGES = {"quick": 30, "full": 120}
CLIPS = {"quick": ("walk", "spinkick"), "full": ("walk", "cartwheel", "spinkick")}
ABLATION_ITERATIONS = 50
DEFAULT_CACHE = Path("out/synthetic")


@dataclass(frozen=True)
class Job:
    """A recording, and the prefix of the figures made on it."""

    name: str
    request: Request


def main() -> int:
    args = _arguments()
    size = "quick" if args.quick else "full"
    figures: dict[str, float | int] = {}
    try:
        for job in _jobs(size, args.motions):
            if args.only and job.name not in args.only:
                continue
            folder = _recording(job, args.cache)
            config = TrackerConfig()
            result = track(folder, job.name, config)
            figures |= _cone_figures(result) if job.name == "cones" else _mannequin_figures(result)
            if job.name == "cones":
                figures |= _sliding_figures(folder, config)
    except TrackerError as error:
        print(f"contour_accuracy: error: {error}", file=sys.stderr)
        return 2
    print_metrics(figures)
    if args.json:
        write_metrics(args.json, figures)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  python benchmark/contour_accuracy.py --quick --json out/benchmark/contour_accuracy.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="fewer and shorter sequences")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="only these sequences, e.g. cones mannequin_walk")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args()


def _jobs(size: str, motions: str | None) -> list[Job]:
    jobs = [Job("cones", Request(subject="model", motion="waves", n_images=CONES_IMAGES[size]))]
    if motions is None:
        missing = ", ".join(f"mannequin_{clip}" for clip in CLIPS[size])
        print(
            f"NOT MEASURED: {missing}. They need the captured clips (humanoid3d_walk.txt and so on): name their folder with"
            " --motions, or the folder that holds bullet_motions/ with TRACKER_SHARED_DATA. The procedural motion stands in.",
            file=sys.stderr,
        )
        return [*jobs, Job("mannequin_swing", Request(motion="swing", n_images=60))]
    return jobs + [Job(f"mannequin_{clip}", Request(motion=clip, motions=motions)) for clip in CLIPS[size]]


def _recording(job: Job, cache: Path) -> Path:
    """Folder of the recording, rendered if it is not there."""
    count = "" if job.request.n_images is None else f"-{job.request.n_images}"
    folder = cache / f"{job.name}{count}"
    made = produce(job.request, folder, progress=show_progress)
    print(f"{job.name}: {'rendered into' if made else 'found in'} {folder}", file=sys.stderr)
    return folder


def track(folder: Path, name: str, config: TrackerConfig) -> Evaluation:
    """Track a recording from its first pose, and hold the states against its truth."""
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    tracker = Tracker(rig, model, config, load_plates(rig), load_state(folder / "state.yaml", model))
    stream = SourceStream(rig, config.synchronizer, SourceOptions())
    estimates = []
    for image_set in stream:
        estimates.append(tracker.step(image_set))
        if sys.stderr.isatty():
            print(f"\r{name}: set {len(estimates)}", end="", file=sys.stderr, flush=True)
    if stream.errors:
        raise TrackerError(f"{folder}: {'; '.join(map(str, stream.errors))}")
    run = RunData(
        path=folder,
        dof_names=model.chain.dof_names,
        stamps_ns=np.array([e.stamp_ns for e in estimates], dtype=np.int64),
        status=np.array([int(e.status) for e in estimates]),
        values=np.array([e.state.to_values() for e in estimates]),
        residual_px=np.array([e.residual_px for e in estimates]),
        iterations=np.array([e.iterations for e in estimates]),
        cameras=rig.names,
        camera_residuals_px=np.array([[c.residual_px for c in e.cameras] for e in estimates]),
        camera_samples=np.array([[c.samples for c in e.cameras] for e in estimates]),
    )
    truth = load_truth(folder / "truth.csv")
    options = EvaluationOptions(name, lag_images=0.0, align="stamp", image_sets=len(truth.stamps_ns))
    return evaluate(run, model, truth, options)


def _cone_figures(result: Evaluation) -> dict[str, float | int]:
    return {
        "cones.joint_error_mm": result.raw.mean_mm,
        "cones.joint_error_max_mm": float(1e3 * result.raw.errors_m[result.raw.valid].max()),
        "cones.iterations": float(result.iterations.mean()),
        "cones.residual_px": float(result.residual_px.mean()),
        "cones.lost_sets": int(result.lost.sum()) + result.missing_sets,
        "cones.sets": result.image_sets,
    }


def _mannequin_figures(result: Evaluation) -> dict[str, float | int]:
    figures: dict[str, float | int] = {
        "mpjpe_mm": result.offset_free.mean_mm,
        "mpjpe_world_mm": result.offset_free_world.mean_mm,
        "mpjpe_raw_mm": result.raw.mean_mm,
        "lost_limbs": len(result.lost_limbs),
        "lost_sets": int(result.lost.sum()) + result.missing_sets,
        "iterations": float(result.iterations.mean()),
        "residual_px": float(result.residual_px.mean()),
        "sets": result.image_sets,
    }
    return {f"{result.name}.{key}": value for key, value in figures.items()}


def _sliding_figures(folder: Path, config: TrackerConfig) -> dict[str, float | int]:
    """The ablation: the same recording with and without the sliding of the contour generator in the Jacobian (chamfer).

    The optimizer may go on until it has converged, so that the numbers of iterations can differ.
    """
    figures: dict[str, float | int] = {}
    for sliding, name in ((True, "with"), (False, "without")):
        optimizer = replace(config.optimizer, sliding=sliding, max_iterations=ABLATION_ITERATIONS)
        evidence = replace(config.evidence, kind="chamfer")
        result = track(folder, f"sliding {name}", replace(config, optimizer=optimizer, evidence=evidence))
        figures[f"sliding.iterations_{name}"] = float(result.iterations.mean())
        figures[f"sliding.error_{name}_mm"] = result.raw.mean_mm
    return dict(sorted(figures.items()))


if __name__ == "__main__":
    sys.exit(main())
