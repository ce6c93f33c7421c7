"""The ways in which ``reproduce cross`` tracks: as published, and as well as the same score allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..evaluation.color_experiments import Found, TrackedSequence, moved
from ..evaluation.video_tracking import refine_video, track_video
from ..model.configuration import State
from ..model.pose_variables import N_ROOT
from ..objective.color_score import ColorOptions
from ..objective.photometric import PhotometricOptions
from ..objective.staggered_photometric import StaggeredPhotometricObjective
from ..objective.staggered_score import StaggeredObjective
from ..optimize.alignment import align
from ..optimize.result import OptimizerResult
from ..optimize.score_objective import SearchResult
from ..optimize.simplex import polish
from ..optimize.stepping import SEVEN_LOOPS, SteppingOptions, step_downhill
from ..synthesis.cross import FIELD_PERIOD_S, CrossTrial
from ..synthesis.cross_film import Footage
from ._cross_scene import CrossScene

START_ERROR = (30.0, -30.0, 26.5, 3.0, -3.0, 2.6)  # of the first field's start, mm and degrees: 50 mm and 5 degrees in all
LOW_PASS_PX = (3.0, 1.0)  # along and across the lines: chroma has no more bandwidth, so what this removes is noise
_RIGID = tuple(range(N_ROOT))


@dataclass(frozen=True)
class Method:
    """One way to track.

    Attributes
    ----------
    key : between the trial's name and the figure's; empty for the best.
    rig : which cameras are known, of `CrossScene.rigs`.
    knows_time : whether it is known that a camera is late.
    fit : "stepping" on the fields as they are is the paper's. With the others noise is filtered out, and once the velocities are
        known every field is fitted again: "simplex" after stepping, or "alignment" alone.
    backend : the renderer of the video.
    """

    key: str
    title: str
    rig: str = "true"
    knows_time: bool = True
    fit: str = "simplex"
    backend: str = "pyrender"


BEST = Method("", "best")
AS_PUBLISHED = Method("stepping_dlt_without_time.", "stepping, DLT cameras, times unknown", "dlt", False, "stepping")
METHODS = (
    BEST,
    Method("without_time.", "best, camera times unknown", knows_time=False),
    Method("dlt.", "best, DLT cameras", "dlt"),
    Method("dlt_without_time.", "best, DLT cameras, times unknown", "dlt", knows_time=False),
    Method("same_backend.", "best, one renderer for all", backend="raycaster"),
    Method("alignment.", "alignment", fit="alignment"),
    Method("alignment_dlt.", "alignment, DLT cameras", "dlt", fit="alignment"),
    Method("stepping.", "stepping", fit="stepping"),
    Method("stepping_without_time.", "stepping, camera times unknown", knows_time=False, fit="stepping"),
    Method("stepping_dlt.", "stepping, DLT cameras", "dlt", fit="stepping"),
    AS_PUBLISHED,
)


def track(
    scene: CrossScene, trial: CrossTrial, footage: Footage, method: Method, done: Callable[[int], None] = lambda field: None
) -> TrackedSequence:
    """The estimates at every field."""
    late_s = scene.late_s if method.knows_time else (0.0,) * len(scene.late_s)
    colors, rig, chain = scene.picked_colors(trial, footage.interpolated(0)), scene.rigs[method.rig], scene.model.chain
    score = StaggeredObjective(scene.model, rig, late_s, ColorOptions("normalized"), colors)
    aligned = StaggeredPhotometricObjective(scene.model, rig, late_s, PhotometricOptions("normalized"), colors)
    published = method.fit == "stepping"

    def show(field: int, velocity: np.ndarray | None) -> None:
        images = footage.interpolated(field)
        for objective in (score, aligned):
            objective.set_images(images if published else low_passed(images))
            objective.velocity = velocity

    def stepping(start: State) -> SearchResult:
        return step_downhill(score, start, chain, SteppingOptions(SEVEN_LOOPS), _RIGID)

    def finer(start: State) -> SearchResult:
        return polish(score, start, chain, active=_RIGID)

    def simplex(start: State) -> SearchResult:
        stepped = stepping(start)
        polished = finer(stepped.state)
        return replace(polished, evaluations=stepped.evaluations + polished.evaluations)

    def alignment(start: State) -> OptimizerResult:
        return align(aligned, start, chain)

    fits: dict[str, Callable[[State], Found]] = {"stepping": stepping, "simplex": simplex, "alignment": alignment}
    start = moved(trial.state(0), np.array(START_ERROR))
    first = track_video(show, trial.n_fields, start, fits[method.fit], FIELD_PERIOD_S, done)
    if published or not method.knows_time:
        return first
    again = refine_video(show, first.states, alignment if method.fit == "alignment" else finer, FIELD_PERIOD_S, done)
    return TrackedSequence(again.states, first.evaluations + again.evaluations)


def low_passed(images: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Images without the noise beyond the bandwidth of chroma."""
    along, across = LOW_PASS_PX
    return [cv2.GaussianBlur(image, (0, 0), sigmaX=along, sigmaY=across) for image in images]
