"""The ways in which ``reproduce cross`` tracks: as published, and as well as the same score allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..evaluation.color_experiments import TrackedSequence, moved
from ..evaluation.video_tracking import refine_video, track_video
from ..model.configuration import State
from ..model.pose_variables import N_ROOT
from ..objective.color_score import ColorOptions
from ..objective.staggered_score import StaggeredObjective
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
    published : the paper's method: stepping on the fields as they are. Otherwise noise is filtered out, the stepping is
        followed by a simplex, and once the velocities are known every field is fitted again.
    backend : the renderer of the video.
    """

    key: str
    title: str
    rig: str = "true"
    knows_time: bool = True
    published: bool = False
    backend: str = "pyrender"


BEST = Method("", "best")
AS_PUBLISHED = Method("stepping_dlt_without_time.", "stepping, DLT cameras, times unknown", "dlt", False, True)
METHODS = (
    BEST,
    Method("without_time.", "best, camera times unknown", knows_time=False),
    Method("dlt.", "best, DLT cameras", "dlt"),
    Method("dlt_without_time.", "best, DLT cameras, times unknown", "dlt", knows_time=False),
    Method("same_backend.", "best, one renderer for all", backend="raycaster"),
    Method("stepping.", "stepping", published=True),
    Method("stepping_without_time.", "stepping, camera times unknown", knows_time=False, published=True),
    Method("stepping_dlt.", "stepping, DLT cameras", "dlt", published=True),
    AS_PUBLISHED,
)


def track(
    scene: CrossScene, trial: CrossTrial, footage: Footage, method: Method, done: Callable[[int], None] = lambda field: None
) -> TrackedSequence:
    """The estimates at every field."""
    late_s = scene.late_s if method.knows_time else (0.0,) * len(scene.late_s)
    colors = scene.picked_colors(trial, footage.interpolated(0))
    options = ColorOptions("normalized")
    objective = StaggeredObjective(scene.model, scene.rigs[method.rig], late_s, options, colors)

    def show(field: int, velocity: np.ndarray | None) -> None:
        images = footage.interpolated(field)
        objective.set_images(images if method.published else low_passed(images))
        objective.velocity = velocity

    def stepping(start: State) -> SearchResult:
        return step_downhill(objective, start, scene.model.chain, SteppingOptions(SEVEN_LOOPS), _RIGID)

    def finer(start: State) -> SearchResult:
        return polish(objective, start, scene.model.chain, active=_RIGID)

    def both(start: State) -> SearchResult:
        stepped = stepping(start)
        polished = finer(stepped.state)
        return replace(polished, evaluations=stepped.evaluations + polished.evaluations)

    start = moved(trial.state(0), np.array(START_ERROR))
    first = track_video(show, trial.n_fields, start, stepping if method.published else both, FIELD_PERIOD_S, done)
    if method.published or not method.knows_time:
        return first
    again = refine_video(show, first.states, finer, FIELD_PERIOD_S, done)
    return TrackedSequence(again.states, first.evaluations + again.evaluations)


def low_passed(images: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Images without the noise beyond the bandwidth of chroma."""
    along, across = LOW_PASS_PX
    return [cv2.GaussianBlur(image, (0, 0), sigmaX=along, sigmaY=across) for image in images]
