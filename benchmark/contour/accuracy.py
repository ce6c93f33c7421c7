#!/usr/bin/env python3
"""How accurate the contour tracker is where truth is exact: on its own body, and on a person that is not its model.

``cones`` is the tracker's own model in motion: what is left is the method's error. ``mannequin_scaled_*`` is a skinned, dressed
body in captured motions, to which the model was scaled by a T-pose: what is left besides is the model's. Both are rendered by
another renderer than the tracker's, in a furnished room, with lens distortion, blur, noise and a shadow; 6 cameras of 640x480,
30 Hz.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

from tracker_node.errors import TrackerError
from tracker_node.evaluation.evaluate import Evaluation
from tracker_node.experiments.contour.clips import rendered, synthetic_clip, track_clip
from tracker_node.experiments.contour.errors import until_converged
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import Request, default_motions
from tracker_node.tracking.config import TrackerConfig

CONES_IMAGES = {"quick": 30, "full": 120}
CLIPS = {"quick": ("walk", "spinkick"), "full": ("walk", "cartwheel", "spinkick")}
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
            folder = rendered(job.name, job.request, args.cache)
            config = TrackerConfig()
            result = track(folder, job.name, config)
            figures |= _cone_figures(result) if job.name == "cones" else _mannequin_figures(result)
            if job.name == "cones":
                figures |= _sliding_figures(folder, config)
    except TrackerError as error:
        print(f"contour_accuracy: error: {error}", file=sys.stderr)
        return 2
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  python benchmark/contour/accuracy.py --quick --json out/benchmark/contour_accuracy.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="fewer and shorter sequences")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="only these sequences, e.g. cones mannequin_scaled_walk")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args()


def _jobs(size: str, motions: str | None) -> list[Job]:
    jobs = [Job("cones", Request(subject="model", motion="waves", n_images=CONES_IMAGES[size]))]
    if motions is None:
        missing = ", ".join(f"mannequin_scaled_{clip}" for clip in CLIPS[size])
        print(
            f"NOT MEASURED: {missing}. They need the captured clips (humanoid3d_walk.txt and so on): name their folder with"
            " --motions, or the folder that holds bullet_motions/ with TRACKER_SHARED_DATA. The procedural motion stands in.",
            file=sys.stderr,
        )
        return [*jobs, Job("mannequin_scaled_swing", Request(motion="swing", n_images=60))]
    return jobs + [Job(f"mannequin_scaled_{clip}", Request(motion=clip, motions=motions)) for clip in CLIPS[size]]


def track(folder: Path, name: str, config: TrackerConfig) -> Evaluation:
    """Track a recording from its first pose, and hold the states against its truth."""

    def show(done: int, total: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{name}: set {done} of {total}", end="", file=sys.stderr, flush=True)

    return track_clip(synthetic_clip(folder, name), config, show).evaluation


def _cone_figures(result: Evaluation) -> dict[str, float | int]:
    return {
        "cones.joint_error_mm": result.raw.mean_mm,
        "cones.joint_error_max_mm": float(1e3 * result.raw.errors_m[result.raw.valid].max()),
        "cones.iterations": float(result.iterations.mean()),
        "cones.residual_px": float(result.residual.mean()),
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
        "residual_px": float(result.residual.mean()),
        "sets": result.image_sets,
    }
    return {f"{result.name}.{key}": value for key, value in figures.items()}


def _sliding_figures(folder: Path, config: TrackerConfig) -> dict[str, float | int]:
    """The ablation: the same recording with and without the sliding of the contour generator in the Jacobian (chamfer).

    The optimizer may go on until it has converged, so that the numbers of iterations can differ.
    """
    figures: dict[str, float | int] = {}
    for sliding, name in ((True, "with"), (False, "without")):
        config = replace(config, modalities=("chamfer",))
        result = track(folder, f"sliding {name}", until_converged(config, sliding))
        figures[f"sliding.iterations_{name}"] = float(result.iterations.mean())
        figures[f"sliding.error_{name}_mm"] = result.raw.mean_mm
    return dict(sorted(figures.items()))


if __name__ == "__main__":
    sys.exit(main())
