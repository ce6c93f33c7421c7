#!/usr/bin/env python3
"""The color engine on a real plate: a ChArUco board waved by hand before four webcams, tracked as a textured box.

The recording is that of Caliscope's tests (folder caliscope_board in TRACKER_SHARED_DATA): 57 image sets at about six a second,
each webcam with its own exposure and white balance, hands on the frame. The reference comes from the markers; the tracker
gets its first pose, the drawn picture of the board, and images. A set counts as right within 10 mm and 3 degrees. Harder cases:
only every third set, and jumps from one set to another, after which the plate must be found by a search.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from tracker_node.calibration.texture import BLACK, GRAY, WHITE, charuco_texture, framed, plate_model
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import so3
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.rig.calibration_toml import load_pose2sim
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.render.overlay import draw_overlay, masked_image
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import load_config
from tracker_node.runs.image_sets import SourceStream
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark._charuco import COLUMNS, DICTIONARY, MARKER_SHARE, ROWS, SQUARE_M, CharucoReference

FOLDER = "caliscope_board/post_optimization"
CONFIG = Path(__file__).resolve().parents[2] / "config/textured_plate.yaml"
TEXELS_PER_M = 1000.0
# Around the printed board, in millimeters as images show it: white paper, the rim of the sleeve, the black frame (left, right,
# top, bottom), gray level
BORDERS = ((6, 1, 5, 5, WHITE), (8, 7, 17, 10, GRAY), (25, 25, 31, 32, BLACK))
THICKNESS_M = 0.005
RIGHT_MM, RIGHT_DEG = 10.0, 3.0
JUMPS = ((0, 30), (10, 40), (20, 50), (56, 25), (45, 15), (35, 5), (5, 25), (30, 50), (50, 10), (25, 0))
PERIOD_NS = round(1e9 / 6.0)


@dataclass(frozen=True)
class Recording:
    """Image sets, and the poses that the board's markers say."""

    rig: CameraRig
    sets: list[ImageSet]
    truth: list[np.ndarray]
    fit_mm: float
    reprojection_px: float


def main() -> int:
    args = _arguments()
    folder = Path(os.environ.get("TRACKER_SHARED_DATA", "")) / FOLDER
    if not os.environ.get("TRACKER_SHARED_DATA") or not folder.is_dir():
        print("color_plate: skipped, needs the recording caliscope_board in the folder that TRACKER_SHARED_DATA names")
        return 0
    config = load_config(CONFIG)
    recording = read(folder, config)
    with tempfile.TemporaryDirectory() as scratch:  # by way of the files that a user would write
        dump_model(plate(), Path(scratch) / "plate.yaml")
        model = load_model(Path(scratch) / "plate.yaml")
    figures: dict[str, float | int] = {
        "plate.sets": len(recording.sets), "plate.reference_fit_mm": recording.fit_mm,
        "plate.reference_reprojection_px": recording.reprojection_px,
    }  # fmt: skip
    estimates = track(recording, model, config, range(len(recording.sets)))
    figures |= summary("plate", recording, estimates, range(len(recording.sets)))
    thinned = range(0, len(recording.sets), 3)
    figures |= summary("plate.every_third", recording, track(recording, model, config, thinned), thinned)
    figures |= jumps(recording, model, config, JUMPS[:3] if args.quick else JUMPS)
    report_metrics(figures, args.json)
    if args.pictures:
        write_pictures(args.pictures, recording, model, estimates)
    return 0


def plate() -> ArticulatedModel:
    """The board in its frame; the body's origin is the middle of the board."""
    board = charuco_texture(COLUMNS, ROWS, SQUARE_M, MARKER_SHARE, DICTIONARY, inverted=True, texels_per_m=TEXELS_PER_M)
    left, top = sum(border[0] for border in BORDERS), sum(border[2] for border in BORDERS)
    origin = left + board.shape[1] / 2.0, top + board.shape[0] / 2.0
    return plate_model("plate", framed(board, BORDERS), TEXELS_PER_M, origin, THICKNESS_M)


def read(folder: Path, config: TrackerConfig, at_most: int | None = None) -> Recording:
    """Images and reference of all sets, or of the first ones."""
    rig = load_pose2sim(folder / "camera_array.toml")
    rig = replace(rig, cameras=tuple(replace(camera, source=str(folder / f"{camera.name}.mp4")) for camera in rig))
    reference, sets, truth, fits = CharucoReference(rig), [], [], []
    for image_set in islice(SourceStream(rig, config.synchronizer), at_most):
        found = reference.pose([image_set.get(camera.name).bgr for camera in rig])
        if found is not None:
            sets.append(image_set)
            truth.append(found[0])
            fits.append(found[1:])
    fit, reprojection = np.sqrt(np.mean(np.square(fits), axis=0))
    return Recording(rig, sets, truth, 1e3 * float(fit), float(reprojection))


def track(recording: Recording, model: ArticulatedModel, config: TrackerConfig, indices) -> list[TrackEstimate]:
    """The product's tracker over some of the sets, from the first one's reference pose."""
    start = State(recording.truth[indices[0]], np.zeros(0))
    tracker = Tracker(recording.rig, model, config, initial_state=start)
    return [tracker.step(recording.sets[i]) for i in indices]


def errors(estimate: TrackEstimate, truth: np.ndarray) -> tuple[float, float]:
    """Millimeters between the centers, and degrees."""
    T = estimate.state.T_world_root
    turn = so3.log(T[:3, :3] @ truth[:3, :3].T)
    return 1e3 * float(np.linalg.norm(T[:3, 3] - truth[:3, 3])), float(np.rad2deg(np.linalg.norm(turn)))


def summary(key: str, recording: Recording, estimates: list[TrackEstimate], indices) -> dict[str, float | int]:
    """Errors, what the status said, and how often it was wrong."""
    off = np.array([errors(e, recording.truth[i]) for e, i in zip(estimates, indices, strict=True)])
    right = (off[:, 0] < RIGHT_MM) & (off[:, 1] < RIGHT_DEG)
    status = np.array([e.status for e in estimates])
    again = sum("found again" in e.status_reason for e in estimates)
    return {
        f"{key}.fraction_10mm_3deg": float(right.mean()),
        f"{key}.position_median_mm": float(np.median(off[:, 0])), f"{key}.position_p95_mm": float(np.percentile(off[:, 0], 95)),
        f"{key}.angle_median_deg": float(np.median(off[:, 1])), f"{key}.angle_p95_deg": float(np.percentile(off[:, 1], 95)),
        f"{key}.reacquired": again, f"{key}.degraded": int((status == Status.DEGRADED).sum()),
        f"{key}.lost": int((status == Status.LOST).sum()),
        f"{key}.wrong_but_tracking": int((~right & (status == Status.TRACKING)).sum()),
        f"{key}.ms": float(np.median([e.timings.total_ms for e in estimates])),
    }  # fmt: skip


def jumps(recording: Recording, model: ArticulatedModel, config: TrackerConfig, pairs) -> dict[str, float | int]:
    """Three sets from one time, then three from another, as if no time had passed: the plate must be found again."""
    found, lost, distances = [], 0, []
    for before, after in pairs:
        before, after = (min(i, len(recording.sets) - 3) for i in (before, after))
        order = [*range(before, before + 3), *range(after, after + 3)]
        tracker = Tracker(recording.rig, model, config, initial_state=State(recording.truth[before], np.zeros(0)))
        for n, i in enumerate(order):
            stamp_ns = n * PERIOD_NS
            images = tuple(replace(image, stamp_ns=stamp_ns) for image in recording.sets[i].images)
            estimate = tracker.step(ImageSet(stamp_ns, images))
        position, angle = errors(estimate, recording.truth[order[-1]])
        found.append(position < RIGHT_MM and angle < RIGHT_DEG)
        lost += estimate.status is Status.LOST and not found[-1]
        distances.append(np.linalg.norm(recording.truth[after][:3, 3] - recording.truth[before + 2][:3, 3]))
    return {
        "plate.jumps": len(pairs), "plate.jump_median_mm": 1e3 * float(np.median(distances)),
        "plate.jumps_found": int(np.sum(found)), "plate.jumps_lost_and_said_so": int(lost),
    }  # fmt: skip


def write_pictures(folder: Path, recording: Recording, model: ArticulatedModel, estimates: list[TrackEstimate]) -> None:
    """Contact sheets: overlays, and targets through the mask, of every camera in six sets."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in (("overlays", draw_overlay), ("through_mask", masked_image)):
        rows = []
        for i in np.linspace(0, len(estimates) - 1, 6).astype(int):
            configuration = Configuration(model, estimates[i].state)
            views = [draw(recording.sets[i].get(camera.name).bgr, configuration, camera) for camera in recording.rig]
            rows.append(np.hstack([cv2.resize(view, (480, 270), interpolation=cv2.INTER_AREA) for view in views]))
        cv2.imwrite(str(folder / f"plate_{name}.png"), np.vstack(rows))


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__, "", "fewer jumps")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write contact sheets here")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
