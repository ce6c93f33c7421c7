#!/usr/bin/env python3
"""Whether a rigid thing tracked by its colors that may as well be elsewhere, or turned otherwise, is said to be so.

Things of one color. ``plate_1cam``, ``box_1cam``, ``cross_1cam``: one camera, clutter; the box has one of its colors.
``crosses``: two cameras, another cross of the same kind 0.3 m beside, the start 50 mm towards it and 5 degrees off;
``colored_crosses``: the same, each arm in a color of its own. ``equal_cross``: two cameras, three equal arms, right in each of
its 24 turns, the start 20 to 50 degrees off. ``starts``: see `ambiguity.py`. Clips are those of that program, their first 40
image sets (``starts``: 20), in lights that the tracker does not know: another direction, another share of light from all around,
each camera in an exposure of its own up to a third off. Parameters are the defaults. A set is right within 10 mm and 3 degrees.
``wrong_called_tracking``: fraction of the wrong sets; ``right_called_tracking``, ``right_called_lost``: of the right ones.
``trusted_within``: fraction of the sets called TRACKING whose error is within what the covariance says of 95 %;
``wrong_within``: of the wrong ones that are not called LOST. ``nees_factor``: squared errors against what is said, of the right
sets called TRACKING, mean. ``color_ambiguity.*`` are of all.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour.box import box_states, displaced, rig_around
from benchmark.world._arguments import Figures, reported, runs_of, seeded_parser
from benchmark.world.ambiguity import THREE_CAMERAS, Case, counted, cross, crosses, figures_of, of_scene, plate, started
from benchmark.world.things import FAST, Scene, cluttered_box, drawn_color, rigid, start_of
from tracker_node.camera.light import Light
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import so3
from tracker_node.model.articulated import Shape
from tracker_node.model.configuration import State
from tracker_node.model.shapes.primitives import Box
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

SETS, START_SETS, STARTS = 40, 20, 3
EXPOSURE, LIGHT_RAD = 0.3, np.radians(30.0)
WITHIN = float(chi2.ppf(0.95, 6))


def in_other_light(scene: Scene, seed: int) -> Scene:
    """The same scene as it is drawn, in lights and exposures that its rig does not state."""
    rng = np.random.default_rng([seed, 41])
    around, (ambient, sun) = rng.uniform(0.35, 0.65), scene.rig.lights
    axis, angle = rng.normal(size=3), rng.uniform(0.3, 1.0) * LIGHT_RAD
    direction = so3.exp(angle * axis / np.linalg.norm(axis)) @ np.asarray(sun.direction)
    lights = replace(ambient, intensity=(around,) * 3), Light("directional", (0.95 - around,) * 3, direction=tuple(direction))
    exposures = np.exp(EXPOSURE * rng.uniform(-1.0, 1.0, len(scene.rig)))
    cameras = tuple(replace(camera, gain=(float(e),) * 3) for camera, e in zip(scene.rig, exposures, strict=True))
    return replace(scene, rig=CameraRig(cameras, lights=lights))


def cross_alone(seed: int) -> Scene:
    rig, thing = rig_around([(20.0 * seed, 35.0)]), rigid(cross(seed), "cross")
    return Scene(rig, thing, (), box_states(thing, SETS, [seed, 11], *FAST), [cluttered_background(rig.cameras[0], seed + 160)])


def colored_crosses(seed: int) -> Case:
    case = crosses(seed)

    def colored(arms: tuple[Shape, ...]) -> tuple[Shape, ...]:
        return tuple(replace(arm, color_rgb=drawn_color(100 * seed + i)) for i, arm in enumerate(arms))

    thing = replace(case.scene.thing, shapes=colored(case.scene.thing.shapes))
    return replace(case, scene=replace(case.scene, thing=thing, with_it=colored(case.scene.with_it)))


def equal_cross(seed: int) -> Case:
    rng, color = np.random.default_rng([seed, 42]), drawn_color(seed)
    sizes = np.full((3, 3), 0.035) + np.diag(rng.uniform(0.18, 0.24, 1).repeat(3) - 0.035)
    arms = tuple(Shape(f"arm{i}", "thing", Box(tuple(map(float, s))), color_rgb=color) for i, s in enumerate(sizes))
    thing, rig = rigid(arms, "equal_cross"), rig_around(THREE_CAMERAS[:2])
    scene = Scene(rig, thing, (), box_states(thing, SETS, [seed, 11], *FAST), [cluttered_background(c, seed + 180) for c in rig])
    return Case(scene, displaced(scene.states[0], [seed, 17], 0.01, np.radians(rng.uniform(20.0, 50.0))))


CASES: dict[str, Callable[[int], list[Case]]] = {
    "plate_1cam": lambda seed: [plate(seed)],
    "box_1cam": of_scene(cluttered_box),
    "cross_1cam": lambda seed: [Case(made := cross_alone(seed), start_of(made, seed))],
    "crosses": lambda seed: [crosses(seed)],
    "colored_crosses": lambda seed: [colored_crosses(seed)],
    "equal_cross": lambda seed: [equal_cross(seed)],
    "starts": lambda seed: [started(seed, number) for number in range(STARTS)],
}
SIGNED = [np.array(rows) * np.array(signs)[:, None] for rows in itertools.permutations(np.eye(3)) for signs in
          itertools.product((-1.0, 1.0), repeat=3)]  # fmt: skip
TURNS = [turn for turn in SIGNED if np.linalg.det(turn) > 0.0]  # of three equal arms


def nearest_turned(truth: State, state: State) -> State:
    """The truth, turned so that three equal arms stay in place, nearest to a state."""
    def turned(turn: np.ndarray) -> State:
        T = truth.T_world_root.copy()
        T[:3, :3] = T[:3, :3] @ turn
        return State(T, truth.joint_positions)

    return min(map(turned, TURNS), key=lambda other: float(np.linalg.norm(state.difference(other)[3:6])))


def squares_of(estimate: TrackEstimate, truth: State) -> float:
    """Squared error, in those that the covariance says."""
    error = truth.difference(estimate.state)
    return float(error @ np.linalg.solve(estimate.covariance, error))


def tracked(case: Case, seed: int, n: int, config: TrackerConfig) -> dict[str, float]:
    scene = replace(case.scene, states=case.scene.states[:n])
    tracker, estimates, times = Tracker(scene.rig, scene.thing, config, None, case.start), [], []
    for one in in_other_light(scene, seed).sets():
        began = time.perf_counter()
        estimates.append(tracker.step(one))
        times.append(1e3 * (time.perf_counter() - began))
    truths = scene.states
    if scene.thing.name == "equal_cross":
        truths = [nearest_turned(truth, estimate.state) for truth, estimate in zip(truths, estimates, strict=True)]
    pairs = list(zip(estimates, truths, strict=True))
    alone = [counted([estimate], [truth]) for estimate, truth in pairs]
    squares = [squares_of(estimate, truth) for estimate, truth in pairs]
    within = np.array(squares) <= WITHIN
    trusted = np.array([e.status is Status.TRACKING for e in estimates])
    lost, right = np.array([e.status is Status.LOST for e in estimates]), np.array([each["right"] for each in alone]) > 0
    return {key: sum(each[key] for each in alone) for key in alone[0]} | {
        "trusted_within": int((trusted & within).sum()), "wrong_shown": int((~right & ~lost).sum()),
        "wrong_within": int((~right & ~lost & within).sum()), "nees": float(np.sum(squares, where=trusted & right)),
        "ms": float(np.median(times)),
    }  # fmt: skip


def all_figures(name: str, runs: list[dict[str, float]]) -> Figures:
    sums = {key: sum(run[key] for run in runs) for key in runs[0]}
    return figures_of(name, runs) | {
        f"{name}.trusted_within": sums["trusted_within"] / max(sums["wrong_tracking"] + sums["right_tracking"], 1),
        f"{name}.wrong_within": sums["wrong_within"] / max(sums["wrong_shown"], 1),
        f"{name}.nees_factor": sums["nees"] / (6.0 * max(sums["right_tracking"], 1)),
        f"{name}.set_ms_p50": float(np.median([run["ms"] for run in runs])),
    }


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)

    def measured(config: TrackerConfig) -> Figures:
        figures: Figures = {}
        every: list[dict[str, float]] = []

        def run(name: str, seed: int, show: Path | None) -> Iterator[dict[str, float]]:
            for case in CASES[name](seed):
                yield tracked(case, seed, START_SETS if name == "starts" else SETS, config)

        for name, runs in runs_of(args, args.only or CASES, run):
            figures |= all_figures(name, runs)
            every += runs
        return all_figures("color_ambiguity", every) | figures

    return reported("color_ambiguity", args, measured, modalities=["color"])


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = seeded_parser(__doc__, "color_ambiguity.py --only plate_1cam crosses --seeds 3", CASES)
    return parser.parse_args(arguments, argparse.Namespace(pictures=None))


if __name__ == "__main__":
    sys.exit(main())
