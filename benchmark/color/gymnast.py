#!/usr/bin/env python3
"""How accurately a gymnast in a suit of colored parts is followed through a double somersault, from start to landing.

The skinned mannequin of `_gymnast_clip.py` in a volume of 4 m: interlaced video of 50 fields a second, 4:2:0 chroma with noise;
two cameras, and a third that exposes 11 ms later, as ``rig.yaml`` says; a furnished room with lights that the tracker does not
know. The tracker's model is scaled by a T-pose and starts from the first pose; every field is an image set.

``gymnast.*`` is by colors alone (``modalities: [color]``), whose displayed colors are learned from the first field;
``gymnast.region_*`` by contours alone, ``gymnast.both_*`` by both in one problem. Errors as those of `articulated.py`.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.color import _gymnast_clip
from benchmark.color._gymnast_clip import FIELD_S, DoubleSomersault, film
from benchmark.color.articulated import DEFAULT_CACHE, SUIT_RGB
from tracker_node.errors import TrackerError
from tracker_node.evaluation.evaluate import Evaluation, EvaluationOptions, evaluate
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.render.overlay import draw_overlay
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.data import RunData
from tracker_node.runs.image_sets import SourceStream
from tracker_node.synthesis.dataset import digest
from tracker_node.synthesis.recording import show_progress
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.tracker import Tracker

TRAINING, HELD_OUT = (1, 2, 3, 4), (11, 12, 13, 14)  # settings are chosen on the first
SYNCHRONIZER = {"image_period_s": FIELD_S, "tolerance": 0.6}  # the late camera's fields are 0.55 of a period late
COLOR = {"learn_colors": True}
ENGINES = {
    "": {"modalities": ["color"], "color": COLOR},
    "region_": {"modalities": ["region"]},
    "both_": {"modalities": ["color", "region"], "color": COLOR},
}


def main() -> int:
    args = _arguments()
    seeds = args.seeds or (TRAINING[:1] if args.quick else HELD_OUT if args.held_out else TRAINING)
    figures: dict[str, float | int] = {}
    try:
        folders = [recording(seed, args.cache) for seed in seeds]
        for key in args.engines or [key for key in ENGINES if not (args.quick and key == "region_")]:
            results = [track(folder, key, args) for folder in folders]
            figures |= _figures(f"gymnast.{key}", results)
    except TrackerError as error:
        print(f"gymnast: error: {error}", file=sys.stderr)
        return 2
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__, "python benchmark/color/gymnast.py --quick", "one clip, without contours alone")
    add = parser.add_argument
    add("--held-out", action="store_true", help="the clips on which no setting was chosen")
    add("--seeds", nargs="+", type=int, metavar="SEED", help="only these clips")
    add("--engines", nargs="+", choices=tuple(ENGINES), metavar="KEY", help="'' for colors, region_, both_; default: all")
    add("--unstated", action="store_true", help="rig.yaml says nothing of the late camera")
    add("--max-sets", type=int, metavar="N", help="only the first N fields")
    add("--pictures", type=Path, metavar="FOLDER", help="write overlays there, at the time of the genlocked cameras")
    add("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER", help="recordings (default: %(default)s)")
    return parser.parse_args()


def recording(seed: int, cache: Path) -> Path:
    """Folder of a clip, filmed if it is not there."""
    drawn_by = digest(np.frombuffer(Path(_gymnast_clip.__file__).read_bytes(), np.uint8))
    folder = cache / f"gymnast_{seed}_{drawn_by}"
    if not (folder / "rig.yaml").exists():
        suit = human_model()
        suit = replace(suit, shapes=tuple(replace(shape, color_rgb=SUIT_RGB[shape.name]) for shape in suit.shapes))
        film(DoubleSomersault(seed, SUIT_RGB), suit, folder)
    return folder


def track(folder: Path, key: str, args: argparse.Namespace) -> Evaluation:
    """Track a clip from its first pose, and compare with its truth."""
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    if args.unstated:
        rig = replace(rig, cameras=tuple(replace(camera, time_offset_ns=0) for camera in rig))
    config = from_dict({**ENGINES[key], "synchronizer": SYNCHRONIZER})
    tracker = Tracker(rig, model, config, None, load_state(folder / "state.yaml", model))
    stream = SourceStream(rig, config.synchronizer, SourceOptions(rate_hz=1.0 / FIELD_S))
    truth = load_truth(folder / "truth.csv")
    n_sets = min(len(truth.stamps_ns), args.max_sets or len(truth.stamps_ns))
    estimates = []
    for image_set in stream:
        estimates.append(tracker.step(image_set))
        if sys.stderr.isatty():
            show_progress(len(estimates), n_sets)
        if args.pictures is not None and len(estimates) % 10 == 0:
            _draw(args.pictures / f"{folder.name}_{key}{len(estimates):03d}.png", image_set, estimates[-1].state, model, rig)
        if len(estimates) == n_sets:
            break
    if stream.errors:
        raise TrackerError(f"{folder}: {'; '.join(map(str, stream.errors))}")
    run = RunData.of_estimates(folder, model, rig, estimates)
    result = evaluate(run, model, truth, EvaluationOptions(folder.name, lag_images=0.0, align="stamp", image_sets=n_sets))
    lost = ", ".join(result.lost_limbs) or "none"
    print(f"{folder.name} {key}: {result.offset_free.mean_mm:.1f} mm, lost limbs: {lost}", file=sys.stderr)
    return result


def _draw(path: Path, image_set, state, model, rig) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    images = [draw_overlay(image.bgr, Configuration(model, state), rig[image.camera]) for image in image_set.images]
    cv2.imwrite(str(path), np.hstack(images))


def _figures(prefix: str, results: list[Evaluation]) -> dict[str, float | int]:
    """Means over the joints of all image sets of all clips."""
    sets = [result.image_sets for result in results]
    return {
        f"{prefix}joint_error_mm": float(np.average([result.offset_free.mean_mm for result in results], weights=sets)),
        f"{prefix}joint_error_raw_mm": float(np.average([result.raw.mean_mm for result in results], weights=sets)),
        f"{prefix}lost_limbs": sum(len(result.lost_limbs) for result in results),
        f"{prefix}lost_sets": sum(int(result.lost.sum()) + result.missing_sets for result in results),
        f"{prefix}sets": sum(sets),
    }


if __name__ == "__main__":
    sys.exit(main())
