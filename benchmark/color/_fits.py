"""The optimizers that the color benchmarks compare, each with the objectives that it looks at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmark.color._scene import ColorScene
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.objective.color.alignment import PhotometricObjective
from tracker_node.objective.color.score import ColorObjective
from tracker_node.optimize.alignment import align
from tracker_node.optimize.robust_fit import Fitted, align_robustly
from tracker_node.optimize.score_objective import ScoreObjective, SearchResult
from tracker_node.optimize.simplex import POLISH, search_simplex
from tracker_node.optimize.stepping import DECIMATED_LOOPS, FIVE_LOOPS, SEVEN_LOOPS, SteppingOptions, step_downhill
from tracker_node.parallel import Workers


@dataclass(frozen=True, eq=False)
class Contestant:
    """``show`` hands it an image set, ``fit`` finds the body in it from a start."""

    show: Callable[[Sequence[np.ndarray]], None]
    fit: Callable[[State], Fitted]

    def __call__(self, images: Sequence[np.ndarray], start: State) -> Fitted:
        self.show(images)
        return self.fit(start)


def contestants(scene: ColorScene, threads: int = 2) -> dict[str, Contestant]:
    """Name -> optimizer; ``stepping`` is the decimated schedule, ``default`` what is shipped for rigid bodies."""
    score = ColorObjective(scene.model, scene.rig, workers=Workers(threads))
    pyramid = PhotometricObjective(scene.model, scene.rig, workers=Workers(threads))
    chain = scene.model.chain

    def stepping(loops) -> Callable[[State], Fitted]:
        return lambda start: step_downhill(score, start, chain, SteppingOptions(loops))

    def show_both(images: Sequence[np.ndarray]) -> None:
        score.set_images(images)
        pyramid.set_images(images)

    return {
        "stepping": Contestant(score.set_images, stepping(DECIMATED_LOOPS)),
        "stepping_published": Contestant(score.set_images, stepping(FIVE_LOOPS)),
        "stepping_seven_loops": Contestant(score.set_images, stepping(SEVEN_LOOPS)),
        "simplex": Contestant(score.set_images, lambda start: search_simplex(score, start, chain)),
        "stepping_simplex": Contestant(score.set_images, lambda start: stepping_simplex(score, start, chain)),
        "alignment": Contestant(pyramid.set_images, lambda start: align(pyramid, start, chain)),
        "default": Contestant(show_both, lambda start: align_robustly(score, pyramid, start, chain)),
    }


def stepping_simplex(
    objective: ScoreObjective, start: State, chain: KinematicChain, *, active: Sequence[int] | None = None
) -> SearchResult:
    """Decimated stepping, then a fine simplex: as far as the score itself goes."""
    stepped = step_downhill(objective, start, chain, SteppingOptions(DECIMATED_LOOPS), active)
    polished = search_simplex(objective, stepped.state, chain, POLISH, active)
    return replace(
        polished, evaluations=stepped.evaluations + polished.evaluations,
        evaluations_per_variable=stepped.evaluations_per_variable + polished.evaluations_per_variable,
    )  # fmt: skip
