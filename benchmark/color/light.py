#!/usr/bin/env python3
"""How colors find a rigid body in light that its model does not know: exposures, and white balances.

The ellipsoid human in three cameras of 768x576, from starts 60 mm and 6 degrees off, before black and before cluttered rooms; the
share that ends within 5 mm and 2 degrees (``light.<lit>.<way>``). The images' levels are multiplied by .5 (``half``), by 1.5
(``bright``), by .5 in one camera alone (``one``), or by .6, .5 and .45 in red, green and blue (``tinted``). ``raw``: levels as
they are; ``gained``: in each camera's best gain, in closed form (`objective.gains`), as is shipped; ``normalized`` by intensity.
``light.<lit>.gained_mm``: median error of those that arrived.

``color_light.arrived_fraction``: ``gained`` from the farther starts of ``basin.default_200mm_20deg``, in ``half`` and ``bright``
together; ``color_light.raw.arrived_fraction``: ``raw``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.color._scene import ColorScene, displaced, make_scene, root_error
from benchmark.color.basin import ARRIVED_DEG, ARRIVED_MM, N_STATES, TARGET, arrival_rate
from tracker_node.model.configuration import State
from tracker_node.objective.color.alignment import PhotometricObjective, PhotometricOptions
from tracker_node.objective.color.score import ColorObjective, ColorOptions
from tracker_node.optimize.robust_fit import Fitted, align_robustly
from tracker_node.parallel import Workers
from tracker_node.report.metrics_file import report_metrics

OFF_MM, OFF_DEG = 60, 6
FAR_TRIALS = 66  # of each light, as many as `basin.py` has
LIT: dict[str, Sequence[Sequence[float]]] = {  # factors of blue, green and red, by camera
    "as_known": [(1.0, 1.0, 1.0)] * 3, "half": [(0.5, 0.5, 0.5)] * 3, "bright": [(1.5, 1.5, 1.5)] * 3,
    "one": [(1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0)], "tinted": [(0.45, 0.5, 0.6)] * 3,
}  # fmt: skip
WAYS = {"raw": ("raw", False), "gained": ("raw", True), "normalized": ("normalized", False), "blend_gained": ("blend", True)}


def lit(images: Sequence[np.ndarray], factors: Sequence[Sequence[float]]) -> list[np.ndarray]:
    """Images in other light; what is too bright is white."""
    return [np.clip(np.rint(image * np.array(f)), 0, 255).astype(np.uint8) for image, f in zip(images, factors, strict=True)]


def fitter(scene: ColorScene, representation: str, gained: bool) -> Callable[[Sequence[np.ndarray], State], Fitted]:
    """What is shipped for rigid bodies, with a comparison."""
    workers = Workers(2)
    score = ColorObjective(scene.model, scene.rig, ColorOptions(representation, gained=gained), workers=workers)
    options = PhotometricOptions(representation, gained=gained)
    pyramid = PhotometricObjective(scene.model, scene.rig, options, workers=workers)

    def fit(images: Sequence[np.ndarray], start: State) -> Fitted:
        score.set_images(images)
        pyramid.set_images(images)
        return align_robustly(score, pyramid, start, scene.model.chain)

    return fit


def measure(prefix: str, scene: ColorScene, trials: int, ways: Sequence[str]) -> dict[str, float]:
    figures: dict[str, float] = {}
    for light, factors in LIT.items():
        for way in ways:
            fit, rng, errors = fitter(scene, *WAYS[way]), np.random.default_rng(7), []
            for trial in range(trials):
                truth = scene.truth[trial % len(scene.truth)]
                start = displaced(truth, 1e-3 * OFF_MM, np.radians(OFF_DEG), rng)
                errors.append(root_error(fit(lit(scene.images[trial % len(scene.truth)], factors), start).state, truth))
            arrived = [mm for mm, deg in errors if mm < ARRIVED_MM and deg < ARRIVED_DEG]
            figures[f"{prefix}.{light}.{way}"] = len(arrived) / trials
            if way == "gained":
                figures[f"{prefix}.{light}.gained_mm"] = float(np.median(arrived)) if arrived else float("nan")
            print(f"{prefix}.{light}.{way}: {len(arrived)} of {trials}", file=sys.stderr, flush=True)
    return figures


def from_afar(scene: ColorScene, trials: int) -> dict[str, float]:
    """Shares that arrive from the starts of ``basin.default_200mm_20deg`` in both exposures; ``trials`` of each."""

    def arrived(way: str) -> float:
        fit = fitter(scene, *WAYS[way])
        rates = []
        for light in ("half", "bright"):

            def exposed(images: Sequence[np.ndarray], start: State, factors=LIT[light]) -> Fitted:
                return fit(lit(images, factors), start)

            rates.append(arrival_rate(scene, exposed, *TARGET, trials))
            print(f"color_light.{way}.{light}: {rates[-1]:.3f}", file=sys.stderr, flush=True)
        return float(np.mean(rates))

    return {"color_light.arrived_fraction": arrived("gained"), "color_light.raw.arrived_fraction": arrived("raw")}


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/color/light.py --json out/color_light.json", "a few starts only: shows that it runs"
    )
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS), metavar="WAY", help=f"of {', '.join(WAYS)}")
    args = parser.parse_args(arguments)
    trials, states = (2, 2) if args.quick else (2 * N_STATES, N_STATES)
    scene = make_scene(states)
    figures = from_afar(scene, 2 if args.quick else FAR_TRIALS) | measure("light", scene, trials, args.ways)
    figures |= measure("light.cluttered", make_scene(states, clutter=True), trials, args.ways)
    report_metrics(figures, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
