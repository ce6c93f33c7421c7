#!/usr/bin/env python3
"""From how far off each optimizer finds a rigid body by its colors.

Random starts, each exactly so many millimeters and so many degrees off; the share that ends within 5 mm and 2 degrees of the
truth. ``default`` is what is shipped for rigid bodies. Three cameras of 768x576, before black as in the paper (``basin.*``), and
before cluttered rooms with noise (``basin.cluttered.*``), in images drawn by another renderer than the one that scores;
``basin.same_renderer.*`` is for images by that one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tracker_node.model.configuration import State
from tracker_node.optimize.robust_fit import Fitted
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.color._fits import contestants
from benchmark.color._scene import ColorScene, displaced, make_scene, root_error

START_ERRORS = ((60, 6), (100, 10), (150, 15), (200, 20), (300, 30))  # mm, degrees
TARGET = (200, 20)
ARRIVED_MM, ARRIVED_DEG = 5.0, 2.0
N_STATES = 11


def arrival_rate(
    scene: ColorScene, contestant: Callable[[Sequence[np.ndarray], State], Fitted], off_mm: float, off_deg: float, trials: int,
    seed: int = 0,
) -> float:  # fmt: skip
    """Share of starts, so far off, that arrive."""
    rng, arrived = np.random.default_rng(seed), 0
    for trial in range(trials):
        truth, images = scene.truth[trial % len(scene.truth)], scene.images[trial % len(scene.truth)]
        found = contestant(images, displaced(truth, 1e-3 * off_mm, np.radians(off_deg), rng))
        error_mm, error_deg = root_error(found.state, truth)
        arrived += error_mm < ARRIVED_MM and error_deg < ARRIVED_DEG
    return arrived / trials


def measure(
    prefix: str, scene: ColorScene, trials: int, errors: Sequence[tuple[int, int]], names: Sequence[str] | None = None
) -> dict[str, float]:
    """``<prefix>.<optimizer>_<mm>mm_<deg>deg`` of all optimizers, or those named."""
    return {
        f"{prefix}.{name}_{mm}mm_{deg}deg": arrival_rate(scene, contestant, mm, deg, trials)
        for name, contestant in contestants(scene).items()
        if names is None or name in names
        for mm, deg in errors
    }


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/color/basin.py --json out/color_basin.json", "a few starts only: shows that it runs"
    )
    parser.add_argument("--trials", type=int, default=66, help="starts of each kind (%(default)s)")
    args = parser.parse_args(arguments)
    n_states, trials, errors = (2, 4, (TARGET,)) if args.quick else (N_STATES, args.trials, START_ERRORS)
    metrics: dict[str, float] = {"basin.trials": trials}
    metrics |= measure("basin", make_scene(n_states), trials, errors)
    metrics |= measure("basin.cluttered", make_scene(n_states, clutter=True), trials, errors)
    metrics |= measure(
        "basin.same_renderer", make_scene(n_states, backend="raycaster"), trials, (TARGET,), ("stepping", "default")
    )  # fmt: skip
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
