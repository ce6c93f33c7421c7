#!/usr/bin/env python3
"""How often a limb, or the body, is called lost that is where the tracker says.

Two bodies of cones in fast motion, a figure and a human, before four cameras of 640x480, drawn by another renderer. ``plain``:
before clutter. ``bars``: before upright bars of the color of one of its limbs. ``hidden``: a crate hides one limb from all
cameras for twenty sets; that limb is not counted then. 60 image sets, five seeds; from the true state, defaults, no backgrounds.
``demo``: the man of the Balancing clip (a real recording; only where it is installed), none of whose limbs is lost. A limb is
right whose end is within 150 mm of the truth. ``false_fraction``: of the right limbs, those that are called LOST;
``degraded_fraction``: DEGRADED; ``body_fraction``: image sets called LOST in which most limbs are right. ``alarms.*`` are of all.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour._balancing_clip import load_clip
from benchmark.contour.box import sensed
from benchmark.trust._clips import BODIES, SCENE
from benchmark.trust._lost_events import placed
from benchmark.trust._runs import tip_errors
from benchmark.world._arguments import Figures, add_pictures, reported, runs_of, seeded_parser, seeds_of, write_picture
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import TrackerError
from tracker_node.evaluation.metrics import LOST_LIMB_M
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.synthesis.scenes.scene import make_rig
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import LimbStatus, Status, TrackEstimate
from tracker_node.tracking.limbs.tree import Limb, limbs_of
from tracker_node.tracking.tracker import Tracker

CLIP_SETS = 30  # of the clips of `benchmark.trust`, of which two follow each other, the second one backwards
SETS = 2 * CLIP_SETS
HIDDEN = range(20, 40)
BAR_PX = 40  # wide, and as far apart
SAMPLE, DECODED = Path("out/demo/sample"), Path("out/benchmark/balancing")
CRATE_BGR = (96, 110, 122)
COUNTED = ("right", "lost", "degraded", "sets", "body_lost", "wrong")


@dataclass(frozen=True, eq=False)
class Scene:
    """A body's true states, what is behind it, and the limb that is hidden while it is; None: none is."""

    rig: CameraRig
    model: ArticulatedModel
    states: list[State]
    backgrounds: list[np.ndarray]
    hidden: Limb | None = None

    def sets(self) -> Iterator[ImageSet]:
        with TargetStudio(self.rig) as studio:
            for number, state in enumerate(self.states):
                body = Configuration(self.model, state)
                images = studio.images(body, self.backgrounds)
                if self.hidden is not None and number in HIDDEN:
                    for camera, image in zip(self.rig, images, strict=True):
                        points, seen = camera.project(_corners(body, self.hidden))
                        cv2.fillConvexPoly(image, cv2.convexHull(np.rint(points[seen]).astype(np.int32)), CRATE_BGR)
                yield sensed(self.rig, images, number)


def _corners(body: Configuration, limb: Limb) -> np.ndarray:
    """(n, 3) corners of boxes around the last parts of a limb, meters, with a margin."""
    moved = body.model.chain.link_moved_by.sum(axis=1)[body.model.shape_links]
    parts = np.flatnonzero(limb.shapes & (moved == moved[limb.shapes].max()))
    ends = np.concatenate([_ends(body, i) for i in parts])
    return np.concatenate([ends + 0.1 * np.array([x, y, z]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def _ends(body: Configuration, i: int) -> np.ndarray:
    """(2, 3) where the axis of a shape begins and ends."""
    T, cone = body.Ts_world_shape[i], body.model.shapes[i].primitive
    z = np.array([getattr(cone, "z1", 0.0), getattr(cone, "z2", 0.0)])
    return T[:3, 3] + z[:, None] * T[:3, 2]


def barred(background: np.ndarray, color_rgb: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
    """The background with upright bars of a color, each a little lighter or darker."""
    image = background.copy()
    first = int(rng.integers(2 * BAR_PX))
    for x in range(first - 2 * BAR_PX, image.shape[1], 2 * BAR_PX):
        tone = np.clip(np.array(color_rgb[::-1]) * rng.uniform(0.85, 1.15), 0, 255).astype(np.uint8)
        image[:, max(x, 0) : max(x + BAR_PX, 0)] = tone
    return image


def drawn(kind: str, body: str, seed: int) -> Scene:
    model, states = BODIES[body].motion(700 + seed)
    states = placed(states, np.random.default_rng([seed, 41]))
    states, rig, rng = [*states, *states[::-1]], make_rig(SCENE), np.random.default_rng([seed, 42])
    limbs = limbs_of(model)
    limb = limbs[1 + int(rng.integers(len(limbs) - 1))]
    backgrounds = [cluttered_background(camera, seed + 160) for camera in rig]
    if kind == "bars":
        own = [shape.color_rgb for shape, mine in zip(model.shapes, limb.shapes, strict=True) if mine]
        backgrounds = [barred(background, own[-1], rng) for background in backgrounds]
    return Scene(rig, model, states, backgrounds, limb if kind == "hidden" else None)


def counted(scene: Scene, estimates: list[TrackEstimate]) -> dict[str, int]:
    """Limbs that are right, by what is said of them, and the same of bodies."""
    limbs, found = limbs_of(scene.model), dict.fromkeys(COUNTED, 0)
    for number, (estimate, state) in enumerate(zip(estimates, scene.states, strict=True)):
        off = np.array(tip_errors(scene.model, limbs, estimate.state, state))
        hidden = [scene.hidden is not None and number in HIDDEN and limb.name == scene.hidden.name for limb in limbs]
        right = off <= LOST_LIMB_M
        for i, report in enumerate(estimate.limbs):
            if right[i] and not hidden[i]:
                found["right"] += 1
                found["lost"] += report.status is LimbStatus.LOST
                found["degraded"] += report.status is LimbStatus.DEGRADED
            found["wrong"] += not right[i] and not hidden[i]
        if 2 * int(right.sum()) > len(limbs):
            found["sets"] += 1
            found["body_lost"] += estimate.status is Status.LOST
    return found


def tracked(scene: Scene, config: TrackerConfig, show: Path | None = None) -> dict[str, int]:
    tracker, estimates = Tracker(scene.rig, scene.model, config, None, scene.states[0]), []
    for number, one in enumerate(scene.sets()):
        estimates.append(tracker.step(one))
        if show is not None and number in (0, HIDDEN[0]):
            write_picture(one, Path(f"{show}_{number:03d}.png"))
    return counted(scene, estimates)


def demo(config: TrackerConfig) -> Iterator[dict[str, int]]:
    """The same of the Balancing clip, none of whose limbs is lost; nothing where it is not installed."""
    try:
        clip = load_clip(SAMPLE, DECODED)
    except TrackerError as error:
        print(f"demo: left out, {error}", file=sys.stderr)
        return
    found, tracker = dict.fromkeys(COUNTED, 0), Tracker(clip.rig, clip.model, config, None, clip.start)
    for one in clip.sets:
        estimate = tracker.step(one)
        found["sets"] += 1
        found["body_lost"] += estimate.status is Status.LOST
        found["right"] += len(estimate.limbs)
        found["lost"] += sum(limb.status is LimbStatus.LOST for limb in estimate.limbs)
        found["degraded"] += sum(limb.status is LimbStatus.DEGRADED for limb in estimate.limbs)
    yield found


KINDS = ("plain", "bars", "hidden")
SCENES: dict[str, Callable[[int], Scene]] = {
    f"{kind}.{body}": lambda seed, kind=kind, body=body: drawn(kind, body, seed) for kind in KINDS for body in BODIES
}


def figures_of(name: str, runs: list[dict[str, int]]) -> Figures:
    sums = {key: sum(run[key] for run in runs) for key in runs[0]}
    right, sets = max(sums["right"], 1), max(sums["sets"], 1)
    return {
        f"{name}.limb_sets": sums["right"], f"{name}.wrong": sums["wrong"], f"{name}.false_fraction": sums["lost"] / right,
        f"{name}.degraded_fraction": sums["degraded"] / right, f"{name}.body_fraction": sums["body_lost"] / sets,
    }  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)

    def measured(config: TrackerConfig) -> Figures:
        figures: Figures = {}
        every: list[dict[str, int]] = []

        def run(name: str, seed: int, show: Path | None) -> Iterator[dict[str, int]]:
            if name != "demo":
                yield tracked(SCENES[name](seed), config, show)
            elif seed == next(iter(seeds_of(args))):  # there is but one
                yield from demo(config)

        for name, runs in runs_of(args, args.only or (*SCENES, "demo"), run):
            figures |= figures_of(name, runs) if runs else {}
            every += runs
        return figures_of("alarms", every) | figures

    return reported("alarms", args, measured)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = seeded_parser(__doc__, "alarms.py --only bars.figure --seeds 3", (*SCENES, "demo"))
    add_pictures(parser)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
