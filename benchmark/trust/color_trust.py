#!/usr/bin/env python3
"""How far the color engine's own word can be trusted: `trust.py` for parts of known colors, in light that nobody knows.

``suit``: a body of cones with 40 degrees of freedom in a suit of parts of different colors. ``doll`` (that body, stiff),
``cross``, ``plate``: rigid things of several colors that go 8 mm and turn 2.5 degrees from set to set; a thing is lost once one
of six points, at its size along its axes, is more than 50 mm off. Drawn by another renderer than the tracker's, in lights that
the tracker does not know, each camera in an exposure of its own up to a third off, with noise. Parameters are the defaults, but
that nothing lost is searched (`color.search_states` 0): that costs seconds a set, and how it is found again is not asked here.
Clips, events and the meaning of the keys: see `trust.py`. Thresholds and scales were taken from other clips: `--fit` prints them.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tracker_node.errors import TrackerError
from tracker_node.experiments.somersault.scene import rigid_body
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.model.shapes.primitives import Box
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.subjects.cones import waves
from tracker_node.tracking.color.judge import LOST
from tracker_node.tracking.limbs.tree import thing_size

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.color._scene import POSTURE_DEG
from benchmark.color.articulated import SUIT_RGB
from benchmark.contour.box import box_states
from benchmark.trust import _clips as clips
from benchmark.trust._clips import N_SETS, RATE_HZ, Kind, record
from benchmark.trust._fit import coefficients, covariance_factor
from benchmark.trust._runs import Run, config_of, track_all
from benchmark.trust.trust import lost_figures, nees_figures
from benchmark.world.things import FAST, rigid

SCENE = replace(clips.SCENE, width=400, height=300, focal_px=350.0)  # a third of the work, and less to see
HEIGHT_M, LOST_M, LIGHT = 0.9, 0.05, 0.3
SUIT_COUNTS = {
    "fit": (10, {"occluded": 2, "exit": 1, "teleport": 2, "wrong_start": 2, "hidden": 4, "swapped": 4, "mirrored": 4}),
    "judge": (10, {"occluded": 3, "exit": 3, "teleport": 4, "wrong_start": 3, "hidden": 7, "swapped": 7, "mirrored": 7}),
    "quick": (2, {"occluded": 1, "hidden": 1, "mirrored": 1}),
}
THING_COUNTS = {
    "fit": (6, {"occluded": 2, "exit": 1, "teleport": 2, "wrong_start": 2}),
    "judge": (10, {"occluded": 6, "exit": 4, "teleport": 7, "wrong_start": 5}),
    "quick": (2, {"wrong_start": 1}),
}


def suit() -> ArticulatedModel:
    """A body of cones whose parts differ in color."""
    model = human_model()
    return replace(model, shapes=tuple(replace(shape, color_rgb=SUIT_RGB[shape.name]) for shape in model.shapes))


def _suit(seed: int) -> tuple[ArticulatedModel, list[State]]:
    model = suit()
    return model, waves(model, RATE_HZ, N_SETS, seed)


def _thing(make: Callable[[], ArticulatedModel]) -> Kind:
    def motion(seed: int) -> tuple[ArticulatedModel, list[State]]:
        model = make()
        reach = 0.5 * thing_size(model)
        ends = [(f"{sign}{axis}", model.chain.links[0], tuple((sign * reach * e).tolist()))
                for axis, e in enumerate(np.eye(3)) for sign in (-1, 1)]  # fmt: skip
        model = replace(model, landmarks=tuple(Landmark(*end) for end in ends))
        states = box_states(model, N_SETS, [seed, 11], *FAST)
        for state in states:
            state.T_world_root[2, 3] += HEIGHT_M
        return model, states

    return Kind(motion, THING_COUNTS, LOST_M, LIGHT)


def cross() -> ArticulatedModel:
    """Three arms of different lengths and colors."""
    sizes = ((0.7, 0.08, 0.08), (0.08, 0.5, 0.08), (0.08, 0.08, 0.4))
    colors = ((220, 40, 40), (40, 190, 60), (50, 90, 230))
    return rigid(tuple(Shape(f"arm{i}", "thing", Box(s), np.eye(4), colors[i]) for i, s in enumerate(sizes)), "cross")


def plate() -> ArticulatedModel:
    """Four quarters of different colors."""
    colors = ((225, 205, 50), (40, 120, 220), (200, 50, 160), (50, 180, 90))
    quarters = []
    for i, color in enumerate(colors):
        T = np.eye(4)
        T[:2, 3] = 0.15 * (2 * (i % 2) - 1), 0.11 * (2 * (i // 2) - 1)
        quarters.append(Shape(f"quarter{i}", "thing", Box((0.3, 0.22, 0.02)), T, color))
    return rigid(tuple(quarters), "plate")


BODIES = {
    "suit": Kind(_suit, SUIT_COUNTS, light=LIGHT), "doll": _thing(lambda: rigid_body(suit(), POSTURE_DEG)),
    "cross": _thing(cross), "plate": _thing(plate),
}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    size, config = "quick" if args.quick else "full", config_of(["color"])
    config = replace(config, color=replace(config.color, search_states=0))
    try:
        rig, others = record("fit", size, args.cache, BODIES, SCENE)
        if args.fit:
            return fit(track_all(others, rig, config, args.processes))
        _, judged = record("judge", size, args.cache, BODIES, SCENE)
        runs = track_all(judged, rig, config, args.processes)
        fitted = track_all([c for c in others if c.clip.kind == "sound"], rig, config, args.processes)
    except TrackerError as error:
        print(f"color_trust: error: {error}", file=sys.stderr)
        return 2
    figures = nees_figures(runs, fitted) | lost_figures(runs, LOST, args.picture)
    report_metrics({f"color_{key}": value for key, value in figures.items()}, args.json)
    return 0


def fit(runs: Sequence[Run]) -> int:
    """Print coefficients and scales."""
    print("COEFFICIENTS", np.round(coefficients(runs), 1).tolist())
    for body in dict.fromkeys(run.body for run in runs):
        sound = [run for run in runs if run.kind == "sound" and run.body == body and not run.lost.any()]
        print(f"covariances of the {body} are too small by a factor of", round(covariance_factor(sound), 2))
    return 0


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/trust/color_trust.py --quick --json out/color_trust.json",
        "fewer clips: too few for the definitions",
    )
    add = parser.add_argument
    add("--fit", action="store_true", help="print what the color engine's judge and configuration hold, from the other clips")
    add("--cache", type=Path, default=Path("out/synthetic/color_trust"), help="where clips are kept (default: %(default)s)")
    add("--picture", type=Path, default=Path("out/benchmark/color_trust_roc.png"), help="of the ROC (default: %(default)s)")
    add("--processes", type=int, default=len(os.sched_getaffinity(0)), help="side by side (default: %(default)s)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
