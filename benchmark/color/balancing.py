#!/usr/bin/env python3
"""A real person by the colors of the first image set: the Balancing clip, four cameras, without contours.

The colors of 18 parts in four cameras are learned in the first image set; then the body is fitted so that it explains what the
images have that images of the background have not. The truth are joints triangulated from 2D detections, good to 3 to 5 cm. A
second run starts half a meter beside the person: its status has to say that this is not the body.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from tracker_node.cli.sample import prepare, run_verb
from tracker_node.errors import TrackerError
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.render.overlay import draw_overlay, masked_image
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import load_config
from tracker_node.runs.image_sets import SourceStream
from tracker_node.runs.offline import OfflineRun, run_together
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

CONFIG = Path(__file__).resolve().parents[2] / "config/balancing_color.yaml"
NAME, N_SETS, N_QUICK, N_WRONG = "balancing_color", 100, 20, 5
ASIDE_M = 0.5
LAG_IMAGES = 0.9  # of the images behind the joints, as whole runs find it
KEPT_QUICK = ("mpjpe_mm", "mpjpe_offset_free_mm", "lag_images", "lost_limbs")
KEPT = (*KEPT_QUICK, "mpjpe_no_lag_correction_mm", "lost_sets", "judged_sets")


def main() -> int:
    args = _arguments()
    try:
        status = prepare(args.sample)
    except TrackerError as error:
        print(f"color_balancing: skipped, the sample recording is not to be had: {error}")
        return 0
    if status != 0:
        return status
    n = N_QUICK if args.quick else N_SETS
    rig, model = load_rig(args.sample / "rig_refined.yaml"), load_model(args.sample / "person.yaml")
    start, config = load_state(args.sample / "initial_state.yaml", model), load_config(CONFIG)
    estimates: list[TrackEstimate] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = args.output or Path(scratch) / "run"
        keep = args.output is not None
        run_together(
            {model.name: OfflineRun(rig, model, config, start, max_sets=n, masks=keep, masked_images=keep)},
            {model.name: folder},
            lambda done, total, estimate: estimates.append(estimate),
        )
        files = ("--truth", args.sample / "truth.trc", "--model", args.sample / "person.yaml", "--output", folder)
        how = ("--lag", str(LAG_IMAGES)) if args.quick else ("--image-sets", str(N_SETS))  # a few sets do not tell the lag
        if run_verb("evaluate", folder, *files, "--name", NAME, "--pictures", "0", *how) != 0:
            return 1
        found = json.loads((folder / "report.json").read_text())["metrics"]
    counts = Counter(estimate.status for estimate in estimates)
    figures: dict[str, float | int] = {f"{NAME}.sets": len(estimates)}
    figures |= {f"{NAME}.{key}": found[f"{NAME}.{key}"] for key in (KEPT_QUICK if args.quick else KEPT)}
    figures |= {f"{NAME}.{status.name.lower()}": counts[status] for status in (Status.TRACKING, Status.DEGRADED, Status.LOST)}
    figures[f"{NAME}.ms"] = float(np.median([estimate.timings.total_ms for estimate in estimates]))
    sets = _first_sets(rig, config, n)
    tracker = Tracker(rig, model, config, load_backgrounds(rig), start.retract(_aside(model.n_dof)))
    wrong = [tracker.step(image_set).status for image_set in sets[:N_WRONG]]
    figures[f"{NAME}.beside_sets"] = len(wrong)
    figures[f"{NAME}.beside_but_tracking"] = sum(status is Status.TRACKING for status in wrong)
    report_metrics(figures, args.json)
    if args.pictures:
        _write_pictures(args.pictures, rig, model, sets, estimates)
    return 0


def _aside(n_dof: int) -> np.ndarray:
    """A step to the side."""
    tangent = np.zeros(n_dof)
    tangent[1] = ASIDE_M
    return tangent


def _first_sets(rig, config, n: int) -> list[ImageSet]:
    return list(islice(SourceStream(rig, config.synchronizer), n))


def _write_pictures(folder: Path, rig, model, sets: list[ImageSet], estimates: list[TrackEstimate]) -> None:
    """Contact sheets: overlays, and targets through the mask, of every camera at five instants."""
    folder.mkdir(parents=True, exist_ok=True)
    states: dict[int, State] = {estimate.stamp_ns: estimate.state for estimate in estimates}
    for name, draw in (("overlays", draw_overlay), ("through_mask", masked_image)):
        columns = []
        for i in np.linspace(0, len(sets) - 1, 5).astype(int):
            configuration = Configuration(model, states[sets[i].stamp_ns])
            views = [draw(sets[i].get(camera.name).bgr, configuration, camera) for camera in rig]
            columns.append(np.hstack([cv2.resize(view, (216, 384), interpolation=cv2.INTER_AREA) for view in views]))
        cv2.imwrite(str(folder / f"balancing_{name}.png"), np.vstack(columns))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=f"{N_QUICK} image sets")
    parser.add_argument("--sample", type=Path, default=Path("out/demo/sample"), metavar="FOLDER", help="made if it is not there")
    parser.add_argument("--output", type=Path, metavar="FOLDER", help="keep the run, with its masks and targets through them")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write contact sheets here")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here too")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
