#!/usr/bin/env python3
"""Cameras that are turned, or run late, while a body is tracked: are they named, how soon, and are others left in peace?

Clips without a picture of the empty scene: a figure of cones in fast motion, and a dancing mannequin that is not the
tracker's model. In each of them every camera in turn is turned by 1 degree about its vertical and its horizontal axis (its
images are warped as a turn warps them), or delayed by two images, from the 15th image set on. ``named``: the camera is
named within 5 s, alone or first of several that might as well be it; ``alone``: without others; ``wrong``: faults over
which at any time another camera was named first. Healthy runs of the same clips tell how often one is named without reason.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.color.articulated import recording
from benchmark.contour._runs import RATE_HZ, Clip, recorded
from benchmark.contour.figure import FIGURE_SCENE
from tracker_node.camera.rig import Camera
from tracker_node.errors import TrackerError
from tracker_node.geometry import so3
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import FIGURE_IMAGES, Request, default_motions
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import DELAYED, TURNED
from tracker_node.tracking.tracker import Tracker

ONSET, WITHIN_S, ANGLE_DEG, DELAY_IMAGES = 15, 5.0, 1.0, 2
CLIPS = ("figure", "dance_b")
TURNS = {"pan": (0.0, 1.0, 0.0), "tilt": (1.0, 0.0, 0.0)}


@dataclass(frozen=True)
class Outcome:
    """Of one fault: image sets until its camera was named first of all (None: never), whether alone, who was named wrongly."""

    sets: int | None
    alone: bool
    wrong: tuple[str, ...]
    size: float


def main() -> int:
    args = _arguments()
    figures: dict[str, float | int] = {}
    try:
        for name in args.only or (CLIPS if args.motions else CLIPS[:1]):
            figures |= measure(load(name, args), name, args)
    except TrackerError as error:
        print(f"contour_self_check: error: {error}", file=sys.stderr)
        return 2
    report_metrics(figures, args.json)
    return 0


def load(name: str, args: argparse.Namespace) -> Clip:
    """The figure of ten cones, or a mannequin in a motion, rendered if it is not there."""
    if name == "figure":
        return recorded("figure", Request(subject="figure", n_images=FIGURE_IMAGES, scene=FIGURE_SCENE), args.cache)
    return Clip.load(recording(name, args.motions, args.cache))


def measure(clip: Clip, name: str, args: argparse.Namespace) -> dict[str, float | int]:
    sets, key = list(clip.sets(limit=args.sets)), f"self_check_{name}"
    healthy = run(clip, sets, args)
    figures: dict[str, float | int] = {f"{key}.sets": len(sets), f"{key}.healthy_sets_with_alarm": sum(map(bool, healthy))}
    cameras = clip.rig.cameras[:1] if args.quick else clip.rig.cameras
    for kind in (*TURNS, DELAYED):
        outcomes = []
        for camera in cameras:
            told = run(clip, faulty(sets, camera, kind), args)
            outcomes.append(outcome(told, camera.name, DELAYED if kind == DELAYED else TURNED))
            print(f"{key}: {camera.name} {kind}: {outcomes[-1]}", file=sys.stderr)
        seconds = [o.sets / RATE_HZ for o in outcomes if o.sets is not None]
        figures[f"{key}.{kind}_named"] = sum(s <= WITHIN_S for s in seconds) / len(outcomes)
        figures[f"{key}.{kind}_alone"] = sum(o.alone for o in outcomes) / len(outcomes)
        figures[f"{key}.{kind}_wrong"] = sum(bool(o.wrong) for o in outcomes)
        figures[f"{key}.{kind}_after_s_max"] = max(seconds, default=float("nan"))
        unit = 1e3 if kind == DELAYED else float(np.degrees(1.0))
        sizes = [unit * o.size for o in outcomes if o.sets is not None]
        figures[f"{key}.{kind}_said_{'ms' if kind == DELAYED else 'deg'}"] = float(np.median(sizes)) if sizes else float("nan")
    return figures


def run(clip: Clip, sets: Iterable[ImageSet], args: argparse.Namespace) -> list[tuple]:
    """Faults after each set."""
    values: dict[str, object] = {}
    for change in args.set:
        key, _, text = change.partition("=")
        values[key] = type_of(text)
    backgrounds = load_backgrounds(clip.rig) if args.backgrounds else {}
    tracker = Tracker(clip.rig, clip.model, from_dict(values), backgrounds, clip.start)
    estimates = [tracker.step(image_set) for image_set in sets]
    counts = np.bincount([int(e.status) for e in estimates], minlength=4)
    print(f"    tracking, degraded, lost: {counts[1:]}", file=sys.stderr)
    return [e.faults for e in estimates]


def type_of(text: str) -> object:
    """A number where it is one."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text)


def faulty(sets: list[ImageSet], camera: Camera, kind: str) -> Iterable[ImageSet]:
    """The sets as they would be, had the camera been turned, or delayed, from `ONSET` on."""
    source = () if kind == DELAYED else turn_of_pixels(camera, np.radians(ANGLE_DEG) * np.array(TURNS[kind]))
    for k, one in enumerate(sets):
        image = one.get(camera.name)
        assert image is not None
        pixels = image.pixels
        if k >= ONSET and kind == DELAYED:
            delayed = sets[k - DELAY_IMAGES].get(camera.name)
            assert delayed is not None
            pixels = delayed.pixels
        elif k >= ONSET:
            pixels = cv2.remap(pixels, *source, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        yield ImageSet(one.stamp_ns, tuple(replace(i, pixels=pixels) if i.camera == camera.name else i for i in one.images))


def turn_of_pixels(camera: Camera, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where in its former image (u, v) a camera sees now what each pixel shows, turned about its center by ``rotation`` (3,),
    radians in its own axes."""
    height, width = camera.model.height, camera.model.width
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    rays, _ = camera.model.rays(np.stack([u, v], axis=-1).reshape(-1, 2))
    source, _ = camera.model.project(rays @ so3.exp(rotation).T)
    source = source.astype(np.float32).reshape(height, width, 2)
    return source[..., 0].copy(), source[..., 1].copy()


def outcome(told: list[tuple], camera: str, kind: str) -> Outcome:
    right = [k for k, faults in enumerate(told) if (camera, kind) in {(fault.camera, fault.kind) for fault in faults}]
    wrong = {fault.camera for faults in told for fault in faults} - {camera}
    if not right:
        return Outcome(None, False, tuple(sorted(wrong)), float("nan"))
    last = next(fault for fault in told[right[-1]] if fault.camera == camera and fault.kind == kind)
    return Outcome(right[0] - ONSET, not last.rivals, tuple(sorted(wrong)), abs(last.size))


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__, "", "only the first camera of each clip")
    add = parser.add_argument
    add("--only", nargs="+", metavar="CLIP", help=f"figure, or captured clips (default: {' '.join(CLIPS)})")
    add("--sets", type=int, metavar="N", help="only the first N image sets")
    add("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="parameters, e.g. self_check.window_s=3")
    add("--backgrounds", action="store_true", help="use the images of the background")
    add("--cache", type=Path, default=Path("out/synthetic"), metavar="FOLDER", help="recordings (default: %(default)s)")
    add("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args()


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
