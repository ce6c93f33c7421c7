#!/usr/bin/env python3
"""How accurately the color engine follows a whole body whose parts are colored: walking and dancing, seen by four cameras.

The skinned mannequin wears a suit in the colors of the parts of the tracker's model, which was scaled to it by a T-pose. It is
rendered by another renderer than the tracker's, in a furnished room with lights that the tracker does not know, lens distortion,
blur, noise and a shadow. The displayed colors of the parts are learned from the first image set.

``articulated.joint_error_mm`` is the mean distance of joints from truth after one constant offset per joint, in the frame of its
segment, has been removed, as for the contour engine; ``joint_error_raw_mm`` without that. Both over all clips.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from tracker_node.errors import TrackerError
from tracker_node.evaluation.evaluate import Evaluation, EvaluationOptions, evaluate
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.render.overlay import draw_overlay, masked_image
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.data import RunData
from tracker_node.runs.image_sets import SourceStream
from tracker_node.synthesis.motions.motion import PROCEDURAL
from tracker_node.synthesis.recording import Request, default_motions, produce, show_progress
from tracker_node.synthesis.scenes.scene import SceneConfig
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.tracker import Tracker

CLIPS = {"quick": ("walk",), "full": ("walk", "dance_a", "dance_b")}
OPTIMIZERS = ("alignment", "stepping", "simplex")
COLOR = {"learn_colors": True}
DEFAULT_CACHE = Path("out/synthetic")
PICTURED = 0.5  # which image set of a clip is drawn, as a fraction of its length

# Neighbors differ in hue, and so do left and right; the mannequin has no skin on its collar bones, so theirs is the torso's color
SUIT_RGB = {
    "pelvis": (150, 40, 170), "abdomen": (235, 225, 50), "torso": (30, 90, 220), "neck": (235, 235, 235), "head": (240, 70, 190),
    "left_clavicle": (30, 90, 220), "left_upper_arm": (220, 30, 40), "left_forearm": (40, 215, 215), "left_hand": (120, 20, 220),
    "right_clavicle": (30, 90, 220), "right_upper_arm": (30, 190, 50), "right_forearm": (245, 110, 200),
    "right_hand": (20, 40, 150),
    "left_thigh": (0, 150, 140), "left_shank": (240, 40, 120), "left_foot": (60, 60, 230),
    "right_thigh": (200, 30, 200), "right_shank": (90, 225, 40), "right_foot": (200, 20, 30),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Run:
    """A clip tracked in one way: its evaluation, and milliseconds per image set."""

    evaluation: Evaluation
    ms: np.ndarray


def main() -> int:
    args = _arguments()
    size = "quick" if args.quick else "full"
    figures: dict[str, float | int] = {}
    clips = args.only or CLIPS[size]
    if args.motions is None and clips != [PROCEDURAL]:
        print(
            f"NOT MEASURED: {', '.join(clips)}. Name the folder of the captured clips with --motions, or the folder that holds"
            " bullet_motions/ with TRACKER_SHARED_DATA. The procedural motion stands in.",
            file=sys.stderr,
        )
        clips = [PROCEDURAL]
    try:
        runs = []
        for clip in clips:
            folder = recording(clip, args.motions, args.cache, args.max_sets if clip == PROCEDURAL else None)
            runs.append(track(folder, clip, {"optimizer": args.optimizer}, args.max_sets, args.pictures))
            figures |= _figures(f"articulated.{clip}", [runs[-1]])
        figures = _figures("articulated", runs) | figures
    except TrackerError as error:
        print(f"color_articulated: error: {error}", file=sys.stderr)
        return 2
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  python benchmark/color/articulated.py --quick --json out/benchmark/color_articulated.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="the walk alone")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--only", nargs="+", metavar="CLIP", help="only these clips, e.g. walk dance_a")
    parser.add_argument("--optimizer", choices=OPTIMIZERS, default=OPTIMIZERS[0], help="default: %(default)s")
    parser.add_argument("--max-sets", type=int, metavar="N", help="stop each clip after so many image sets")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write overlays and targets through the mask there")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args()


def recording(clip: str, motions: str | None, cache: Path, n_images: int | None = None) -> Path:
    """Folder of the recording, rendered if it is not there."""
    cache.mkdir(parents=True, exist_ok=True)
    suit = human_model()
    suit = replace(suit, shapes=tuple(replace(shape, color_rgb=SUIT_RGB[shape.name]) for shape in suit.shapes))
    dump_model(suit, cache / "suit.yaml", comment="The human in the colors of the suit that the mannequin wears.")
    folder = cache / f"suit_{clip}"
    request = Request(
        motion=clip, n_images=n_images, motions=motions, model=str(cache / "suit.yaml"), colors="parts",
        scene=SceneConfig(n_cameras=4),
    )  # fmt: skip
    made = produce(request, folder, progress=show_progress)
    print(f"{clip}: {'rendered into' if made else 'found in'} {folder}", file=sys.stderr)
    return folder


def track(folder: Path, name: str, color: dict, max_sets: int | None = None, pictures: Path | None = None) -> Run:
    """Track a recording from its first pose, and hold the states against its truth."""
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    config = from_dict({"modalities": ["color"], "color": {**COLOR, **color}})
    tracker = Tracker(rig, model, config, None, load_state(folder / "state.yaml", model))
    stream = SourceStream(rig, config.synchronizer, SourceOptions())
    truth = load_truth(folder / "truth.csv")
    n_sets = min(len(truth.stamps_ns), max_sets or len(truth.stamps_ns))
    estimates = []
    for image_set in stream:
        estimates.append(tracker.step(image_set))
        if sys.stderr.isatty():
            print(f"\r{name}: set {len(estimates)}", end="", file=sys.stderr, flush=True)
        if pictures is not None and len(estimates) == max(1, round(PICTURED * n_sets)):
            _draw(pictures / f"articulated_{name}.png", image_set, Configuration(model, estimates[-1].state), rig)
        if len(estimates) == n_sets:
            break
    if stream.errors:
        raise TrackerError(f"{folder}: {'; '.join(map(str, stream.errors))}")
    run = RunData.of_estimates(folder, model, rig, estimates)
    options = EvaluationOptions(name, lag_images=0.0, align="stamp", image_sets=n_sets)
    return Run(evaluate(run, model, truth, options), np.array([e.timings.total_ms for e in estimates]))


def _draw(path: Path, image_set, configuration: Configuration, rig) -> None:
    """Above, the images with the body drawn over them; below, what they show through its mask."""
    path.parent.mkdir(parents=True, exist_ok=True)
    images = [(image_set.get(camera.name).bgr, camera) for camera in rig]
    above = [draw_overlay(image, configuration, camera) for image, camera in images]
    below = [masked_image(image, configuration, camera) for image, camera in images]
    cv2.imwrite(str(path), np.vstack([np.hstack(above), np.hstack(below)]))


def _figures(prefix: str, runs: list[Run]) -> dict[str, float | int]:
    """Means over the joints of all image sets of all runs."""
    sets = np.array([run.evaluation.image_sets for run in runs], dtype=float)

    def mean(values: list[float]) -> float:
        return float(np.average(values, weights=sets))

    figures: dict[str, float | int] = {
        "joint_error_mm": mean([run.evaluation.offset_free.mean_mm for run in runs]),
        "joint_error_world_mm": mean([run.evaluation.offset_free_world.mean_mm for run in runs]),
        "joint_error_raw_mm": mean([run.evaluation.raw.mean_mm for run in runs]),
        "lost_limbs": sum(len(run.evaluation.lost_limbs) for run in runs),
        "lost_sets": sum(int(run.evaluation.lost.sum()) + run.evaluation.missing_sets for run in runs),
        "iterations": mean([float(run.evaluation.iterations.mean()) for run in runs]),
        "step_ms": float(np.median(np.concatenate([run.ms for run in runs]))),
        "sets": int(sets.sum()),
    }
    return {f"{prefix}.{key}": value for key, value in figures.items()}


if __name__ == "__main__":
    sys.exit(main())
