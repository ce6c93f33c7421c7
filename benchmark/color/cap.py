#!/usr/bin/env python3
"""The color score's cap, chosen where the somersault has no say: other postures, places and lights, drawn by a seed.

The ellipsoids nearest to the surfaces of the lofted body are fitted to images of that body, three cameras of 768x576, before
black, under ambient light and two suns of random directions. ``cap.<gray levels>.position_mm`` and ``angle_deg``: rms distance
and angle of the score's minimum, searched from the truth, from the truth; ``along_light_mm``: its mean displacement the way the
light shines, which is what a hard mask without a cap (``cap.none``) suffers from. ``cap.<gray levels>.arrived``: share of starts
60 mm and 6 degrees off from which stepping (seven loops) ends within 15 mm: a low cap makes the valley narrow.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.color._scene import displaced, root_error
from tracker_node.camera.light import Light
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.somersault.scene import POSTURE_DEG, rigid_body, somersault_rig, surface_ellipsoids
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State, from_variables
from tracker_node.model.humans.segments18 import nurbs_human
from tracker_node.objective.color.score import ColorObjective, ColorOptions
from tracker_node.optimize.simplex import SimplexStage, search_simplex
from tracker_node.optimize.stepping import SEVEN_LOOPS, SteppingOptions, step_downhill
from tracker_node.parallel import Workers
from tracker_node.report.metrics_file import report_metrics

CAPS = (math.inf, 100.0, 80.0, 60.0, 45.0, 30.0, 20.0)
SEED, N_CASES, N_STARTS = 7, 12, 3
POSTURES = {  # degrees, drawn evenly; the same on both sides
    "hip_flexion": (0, 60), "knee_flexion": (0, 60), "elbow_flexion": (0, 110), "shoulder_elevation_front": (0, 90),
    "ankle_dorsiflexion": (-45, 10),
}  # fmt: skip
OFF_MM, OFF_DEG, ARRIVED_MM = 60.0, 6.0, 15.0
STAGES = tuple(SimplexStage(1e-3 * mm, math.radians(0.1 * mm), 0.03, max_evaluations=80) for mm in 2 * (10, 5, 2, 1))


@dataclass(frozen=True, eq=False)
class Case:
    """A body to fit in a scene, its true state, images, and the mean direction (3,) of the light."""

    tracked: ArticulatedModel
    rig: CameraRig
    truth: State
    images: Sequence[np.ndarray]
    light: np.ndarray


def cases(n: int) -> Iterator[Case]:
    """Random ones."""
    rng, lofted = np.random.default_rng(SEED), nurbs_human()
    ellipsoids = surface_ellipsoids(lofted)
    for _ in range(n):
        drawn = {axis: rng.uniform(*ends) for axis, ends in POSTURES.items()}
        posture = POSTURE_DEG | {f"{side}_{axis}": angle for side in ("left", "right") for axis, angle in drawn.items()}
        place, angles = rng.uniform([0.2, -0.1, 1.5], [0.8, 0.1, 2.0]), rng.uniform([0.0, -0.3, 0.0], [6.28, 0.3, 6.28])
        directions = rng.standard_normal((2, 3))
        directions[:, 2] = -np.abs(directions[:, 2])  # from above
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        suns = [Light("directional", (i,) * 3, direction=tuple(d)) for i, d in zip((0.45, 0.3), directions, strict=True)]
        rig = replace(somersault_rig(), lights=(Light("ambient", (0.35,) * 3), *suns))
        truth, light = from_variables(np.concatenate([place, angles])), directions.T @ [0.45, 0.3]
        with TargetStudio(rig) as studio:
            images = studio.images(Configuration(rigid_body(lofted, posture), truth))
        yield Case(rigid_body(ellipsoids, posture), rig, truth, images, light / np.linalg.norm(light))


def measure(drawn: Sequence[Case], cap: float, starts: int) -> dict[str, float]:
    """Figures of one cap."""
    rng, off, along, arrived = np.random.default_rng(SEED), [], [], []
    for case in drawn:
        chain = case.tracked.chain
        score = ColorObjective(case.tracked, case.rig, ColorOptions(cap=cap), workers=Workers(1))
        score.set_images(case.images)
        found = search_simplex(score, case.truth, chain, STAGES).state
        off.append(root_error(found, case.truth))
        along.append(1e3 * (found.T_world_root[:3, 3] - case.truth.T_world_root[:3, 3]) @ case.light)
        for _ in range(starts):
            start = displaced(case.truth, 1e-3 * OFF_MM, math.radians(OFF_DEG), rng)
            stepped = step_downhill(score, start, chain, SteppingOptions(SEVEN_LOOPS)).state
            arrived.append(root_error(stepped, case.truth)[0] < ARRIVED_MM)
    position, angle = np.sqrt(np.mean(np.square(off), axis=0)).tolist()
    prefix = "cap.none" if math.isinf(cap) else f"cap.{cap:.0f}"
    print(f"{prefix}: {position:.2f} mm, {angle:.3f} degrees", file=sys.stderr, flush=True)
    return {
        f"{prefix}.position_mm": position, f"{prefix}.angle_deg": angle, f"{prefix}.along_light_mm": float(np.mean(along)),
        f"{prefix}.arrived": float(np.mean(arrived)),
    }  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(__doc__, "python benchmark/color/cap.py --json out/color_cap.json", "two scenes and two caps")
    args = parser.parse_args(arguments)
    drawn = list(cases(2 if args.quick else N_CASES))
    metrics: dict[str, float] = {}
    for cap in (math.inf, 30.0) if args.quick else CAPS:
        metrics |= measure(drawn, cap, 1 if args.quick else N_STARTS)
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
