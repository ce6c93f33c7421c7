#!/usr/bin/env python3
"""Whether a rigid thing that may as well be elsewhere, or turned otherwise, is said to be so.

``plate_1cam``, ``box_1cam``, ``mesh_1cam``: one camera, clutter; the box has one of its colors. ``crosses``: two cameras, another
cross of the same kind 0.3 m beside, the start 50 mm towards it and 5 degrees off. ``starts``: one to three cameras, a box, 20 mm
and 10 to 20 degrees off. ``hidden``: three cameras, nothing shows the box for fifteen sets, in which it turns on. 90 image sets
(``starts``: 30, two starts a seed and number of cameras); sizes, colors, ways and pictures are drawn by seed, by another renderer
than the tracker's; parameters are the defaults. A set is right within 10 mm and 3 degrees, turned by more than 90 degrees.
``wrong_called_tracking``: fraction of the wrong sets; ``right_called_tracking``, ``right_called_lost``: of the right ones.
``ambiguity.*`` are of all.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour.box import box_states, displaced, rig_around
from benchmark.world._arguments import Figures, add_pictures, reported, runs_of, seeded_parser, write_picture
from benchmark.world.things import (
    FAST,
    SETS,
    Scene,
    cluttered_box,
    drawn_box,
    drawn_color,
    hollow_mesh,
    judged,
    moved,
    rigid,
    start_of,
)
from tracker_node.model.articulated import Shape
from tracker_node.model.configuration import State
from tracker_node.model.shapes.primitives import Box
from tracker_node.observation.image_set import ImageSet
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

STARTS, START_SETS = 6, 30
HIDDEN = range(30, 45)  # image sets
BESIDE_M = 0.3
TURNED_RAD = np.radians(90.0)
THREE_CAMERAS = [(0.0, 30.0), (75.0, 30.0), (150.0, 30.0)]


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, where its tracking starts, and the image sets in which nothing shows the thing."""

    scene: Scene
    start: State
    hidden: range = range(0)

    def sets(self) -> Iterator[ImageSet]:
        for number, one in enumerate(self.scene.sets()):
            if number in self.hidden:
                pairs = zip(one.images, self.scene.backgrounds, strict=True)
                one = replace(one, images=tuple(replace(image, pixels=background) for image, background in pairs))
            yield one


def plate(seed: int) -> Case:
    rng = np.random.default_rng([seed, 31])
    size = np.array([0.24, 0.17, 0.006]) * rng.uniform(0.85, 1.15, 3)
    thing = rigid((Shape("plate", "thing", Box(tuple(map(float, size))), color_rgb=drawn_color(seed)),), "plate")
    rig = rig_around([(20.0 * seed, 35.0)])
    scene = Scene(rig, thing, (), box_states(thing, SETS, [seed, 11], *FAST), [cluttered_background(rig.cameras[0], seed + 100)])
    return Case(scene, start_of(scene, seed))


def cross(seed: int) -> tuple[Shape, ...]:
    """Three arms of different lengths."""
    rng, color = np.random.default_rng([seed, 32]), drawn_color(seed)
    sizes = np.array([[0.26, 0.03, 0.03], [0.03, 0.18, 0.03], [0.03, 0.03, 0.14]]) * rng.uniform(0.9, 1.1, (3, 1))
    return tuple(Shape(f"arm{i}", "thing", Box(tuple(map(float, size))), moved(0.04 * i), color) for i, size in enumerate(sizes))


def crosses(seed: int) -> Case:
    arms, rig = cross(seed), rig_around(THREE_CAMERAS[:2])
    direction = np.random.default_rng([seed, 33]).normal(size=3)
    aside = BESIDE_M * direction / np.linalg.norm(direction)
    T = np.eye(4)
    T[:3, 3] = aside
    twin = tuple(replace(arm, name=f"twin_{arm.name}", T_link_shape=T @ arm.T_link_shape) for arm in arms)
    thing = rigid(arms, "cross")
    states = box_states(thing, SETS, [seed, 11], *FAST)
    start = displaced(states[0], [seed, 17], 0.0, np.radians(5.0))
    start.T_world_root[:3, 3] += 0.05 * states[0].T_world_root[:3, :3] @ aside / BESIDE_M
    return Case(Scene(rig, thing, twin, states, [cluttered_background(c, seed + 120) for c in rig]), start)


def around(seed: int, n_cameras: int, sets: int = SETS) -> Scene:
    thing = rigid((Shape("box", "thing", drawn_box(seed), color_rgb=drawn_color(seed)),), "box")
    rig = rig_around(THREE_CAMERAS[:n_cameras])
    return Scene(rig, thing, (), box_states(thing, sets, [seed, 11], *FAST), [cluttered_background(c, seed + 140) for c in rig])


def started(seed: int, number: int) -> Case:
    scene = around(seed, 1 + number % len(THREE_CAMERAS), START_SETS)
    off_rad = np.radians(np.random.default_rng([seed, 34, number]).uniform(10.0, 20.0))
    return Case(scene, displaced(scene.states[0], [seed, 35, number], 0.02, off_rad))


def hidden(seed: int) -> Case:
    scene = around(seed, len(THREE_CAMERAS))
    return Case(scene, start_of(scene, seed), HIDDEN)


def of_scene(scene: Callable[[int], Scene]) -> Callable[[int], list[Case]]:
    return lambda seed: [Case(made := scene(seed), start_of(made, seed))]


CASES: dict[str, Callable[[int], list[Case]]] = {
    "plate_1cam": lambda seed: [plate(seed)],
    "box_1cam": of_scene(cluttered_box),
    "mesh_1cam": of_scene(lambda seed: hollow_mesh(seed, (20.0 * seed,))),
    "crosses": lambda seed: [crosses(seed)],
    "starts": lambda seed: [started(seed, number) for number in range(STARTS)],
    "hidden": lambda seed: [hidden(seed)],
}


def counted(estimates: list[TrackEstimate], states: list[State], hidden: range = range(0)) -> dict[str, int]:
    """Right and wrong sets by what is said of them, and those that are turned; without those that show nothing."""
    shown = [k for k in range(len(states)) if k not in hidden]
    estimates, states = [estimates[k] for k in shown], [states[k] for k in shown]
    found = judged(estimates, states)
    turned = [float(np.linalg.norm(e.state.difference(s)[3:6])) > TURNED_RAD for e, s in zip(estimates, states, strict=True)]
    said = int(found["right_called_lost"] + found["right_called_degraded"])
    tracking = sum(e.status is Status.TRACKING for e in estimates)
    return {
        "right": int(found["right"]), "wrong": len(states) - int(found["right"]), "turned": sum(turned),
        "wrong_tracking": int(found["unsaid"]), "right_tracking": tracking - int(found["unsaid"]),
        "right_lost": int(found["right_called_lost"]), "right_degraded": said - int(found["right_called_lost"]),
    }  # fmt: skip


def tracked(case: Case, config: TrackerConfig, show: Path | None = None) -> dict[str, int]:
    tracker, estimates = Tracker(case.scene.rig, case.scene.thing, config, None, case.start), []
    for number, one in enumerate(case.sets()):
        estimates.append(tracker.step(one))
        if show is not None and number in (0, len(case.scene.states) // 2):
            write_picture(one, Path(f"{show}_{number:03d}.png"))
    return counted(estimates, case.scene.states, case.hidden)


def figures_of(name: str, runs: list[dict[str, int]]) -> Figures:
    """Of all runs together: counts, and fractions of what is right and wrong."""
    sums = {key: sum(run[key] for run in runs) for key in runs[0]}
    found: dict[str, float | int] = {"sets": sums["right"] + sums["wrong"], "wrong": sums["wrong"], "turned": sums["turned"]}
    found["wrong_called_tracking"] = sums["wrong_tracking"] / max(sums["wrong"], 1)
    found["right_called_tracking"] = sums["right_tracking"] / max(sums["right"], 1)
    found["right_called_lost"] = sums["right_lost"] / max(sums["right"], 1)
    return {f"{name}.{key}": value for key, value in found.items()}


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)

    def measured(config: TrackerConfig) -> Figures:
        figures: Figures = {}
        every: list[dict[str, int]] = []

        def run(name: str, seed: int, show: Path | None) -> Iterator[dict[str, int]]:
            for number, case in enumerate(CASES[name](seed)):
                yield tracked(case, config, show and Path(f"{show}_{number}"))

        for name, runs in runs_of(args, args.only or CASES, run):
            figures |= figures_of(name, runs)
            every += runs
        return figures_of("ambiguity", every) | figures

    return reported("ambiguity", args, measured)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = seeded_parser(__doc__, "ambiguity.py --only plate_1cam hidden --seeds 3", CASES)
    add_pictures(parser)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
