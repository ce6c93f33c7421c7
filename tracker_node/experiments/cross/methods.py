"""The ways in which ``reproduce cross`` tracks: as published, and as well as the same score allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...model.configuration import N_ROOT, State
from ...objective.color.alignment import PhotometricOptions
from ...objective.color.asynchronous import AsynchronousObjective, AsynchronousPhotometricObjective
from ...objective.color.score import ColorObjective, ColorOptions
from ...observation.deinterlace import field_camera, first_line
from ...optimize.alignment import AlignmentOptions, align
from ...optimize.simplex import POLISH, search_simplex
from ...optimize.stepping import SEVEN_LOOPS, SteppingOptions, step_downhill
from ..rigid_tracking import FitResult, TrackedSequence, moved
from .scene import CrossScene, Footage
from .throw import FIELD_PERIOD_S, LATE_CAMERA, CrossTrial
from .video_tracking import estimate_delay, refine_video, track_video

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
    times : whether it is "known" how late a camera is, "estimated" from the video, or "ignored".
    fit : "stepping" on the fields as they are is the paper's. With the others noise is filtered out, and once the velocities are
        known every field is fitted again: "alignment", or "simplex" after stepping.
    backend : the renderer of the video.
    own_lines : score only the lines that a field has, instead of interpolating the missing ones.
    """

    key: str
    title: str
    rig: str = "true"
    times: str = "known"
    fit: str = "alignment"
    backend: str = "pyrender"
    own_lines: bool = False


BEST = Method("", "alignment")
AS_PUBLISHED = Method("published.", "stepping, DLT of seven parameters, times unknown", "dlt_centered", "ignored", "stepping")
METHODS = (
    BEST,
    Method("without_time.", "alignment, camera times unknown", times="ignored"),
    Method("estimated_time.", "alignment, camera time estimated", times="estimated"),
    Method("dlt.", "alignment, DLT cameras", "dlt"),
    Method("dlt_without_time.", "alignment, DLT cameras, times unknown", "dlt", times="ignored"),
    Method("dlt_estimated_time.", "alignment, DLT cameras, time estimated", "dlt", "estimated"),
    Method("dlt_square.", "alignment, DLT, square pixels", "dlt_square"),
    Method("dlt_centered.", "alignment, DLT of seven parameters", "dlt_centered"),
    Method("own_lines.", "alignment, no interpolated lines", own_lines=True),
    Method("same_backend.", "alignment, one renderer for all", backend="raycaster"),
    Method("simplex.", "stepping and simplex", fit="simplex"),
    Method("stepping.", "stepping", fit="stepping"),
    Method("stepping_without_time.", "stepping, camera times unknown", times="ignored", fit="stepping"),
    Method("stepping_dlt.", "stepping, DLT cameras", "dlt", fit="stepping"),
    Method("stepping_dlt_without_time.", "stepping, DLT cameras, times unknown", "dlt", "ignored", "stepping"),
    AS_PUBLISHED,
)


class _Fitter:
    """Fits the cross to one field at a time, with each of the optimizers."""

    def __init__(
        self, scene: CrossScene, footage: Footage, method: Method, colors_rgb: np.ndarray, late_s: Sequence[float],
        without: int | None = None,
    ):  # fmt: skip
        self._footage, self._method, self._chain, self._without = footage, method, scene.model.chain, without
        rig = scene.rigs[method.rig]
        rigs = [rig, rig]
        if method.own_lines:
            rigs = [replace(rig, cameras=tuple(field_camera(camera, line) for camera in rig)) for line in (0, 1)]
        normalized = ColorOptions("normalized"), PhotometricOptions("normalized")
        self._of_line = [
            (
                AsynchronousObjective(scene.model, known, late_s, normalized[0], colors_rgb),
                AsynchronousPhotometricObjective(scene.model, known, late_s, normalized[1], colors_rgb),
            )
            for known in rigs
        ]
        self._score, self._aligned = self._of_line[0]

    def show(self, field: int, velocity: np.ndarray | None) -> None:
        """What the fits that follow are to."""
        own = self._method.own_lines
        pictures = self._footage.own_lines(field) if own else self._footage.interpolated(field)
        if self._method.fit != "stepping":
            pictures = [low_passed(picture, LOW_PASS_PX[0], LOW_PASS_PX[1] / (2.0 if own else 1.0)) for picture in pictures]
        images = [None if i == self._without else picture for i, picture in enumerate(pictures)]
        self._score, self._aligned = self._of_line[first_line(field)]
        for objective in (self._score, self._aligned):
            objective.set_images(images)
            objective.velocity = velocity

    def first(self, start: State) -> FitResult:
        """A fit from an extrapolation."""
        if self._method.fit == "alignment":
            return align(self._aligned, start, self._chain)
        stepped = step_downhill(self._score, start, self._chain, SteppingOptions(SEVEN_LOOPS), _RIGID)
        if self._method.fit == "stepping":
            return stepped
        polished = search_simplex(self._score, stepped.state, self._chain, POLISH, _RIGID)
        return replace(polished, evaluations=stepped.evaluations + polished.evaluations)

    def again(self, start: State) -> FitResult:
        """A fit from an earlier one."""
        if self._method.fit == "alignment":
            return align(self._aligned, start, self._chain, AlignmentOptions(coarsest=1))
        return search_simplex(self._score, start, self._chain, POLISH, _RIGID)


def track(scene: CrossScene, trial: CrossTrial, footage: Footage, method: Method, late_s: Sequence[float]) -> TrackedSequence:
    """Track a throw by one method.

    Parameters
    ----------
    scene : what is known of cameras, lights and colors.
    trial : the throw.
    footage : its video.
    method : how to track.
    late_s : how late each camera exposes, as far as is known, see `camera_times`.

    Returns
    -------
    Estimates at every field.
    """
    fitter = _Fitter(scene, footage, method, scene.picked_colors(trial, footage.interpolated(0)), late_s)
    first = track_video(fitter.show, trial.n_fields, _start(trial), fitter.first, FIELD_PERIOD_S)
    if method.fit == "stepping" or method.times == "ignored":
        return first
    again = refine_video(fitter.show, first.states, fitter.again, FIELD_PERIOD_S)
    return TrackedSequence(again.states, first.evaluations + again.evaluations)


def camera_times(scene: CrossScene, trial: CrossTrial, footage: Footage, method: Method) -> tuple[float, ...]:
    """How late each camera exposes: the truth, nothing, or an estimate from the video.

    Parameters
    ----------
    scene : what is known of cameras, lights and colors.
    trial : the throw.
    footage : its video.
    method : says which of the three.

    Returns
    -------
    Seconds, in the order of the rig.
    """
    if method.times == "known":
        return scene.late_s
    if method.times == "ignored":
        return (0.0,) * len(scene.late_s)
    late = scene.rig.names.index(LATE_CAMERA)
    colors = scene.picked_colors(trial, footage.interpolated(0))
    fitter = _Fitter(scene, footage, method, colors, (0.0,) * len(scene.late_s), without=late)
    states = track_video(fitter.show, trial.n_fields, _start(trial), fitter.first, FIELD_PERIOD_S).states
    rig = scene.rigs[method.rig].subset([LATE_CAMERA])
    objective = ColorObjective(scene.model, rig, ColorOptions("normalized"), colors[late : late + 1])

    def show(field: int) -> None:
        objective.set_images([low_passed(footage.interpolated(field)[late])])

    delay = estimate_delay(objective, show, states, FIELD_PERIOD_S)
    return tuple(delay if i == late else 0.0 for i in range(len(scene.late_s)))


def _start(trial: CrossTrial) -> State:
    return moved(trial.state(0), np.array(START_ERROR))


def low_passed(image: np.ndarray, along_px: float = LOW_PASS_PX[0], across_px: float = LOW_PASS_PX[1]) -> np.ndarray:
    """An image without the noise beyond the bandwidth of chroma.

    Parameters
    ----------
    image : (h, w, 3) uint8 BGR.
    along_px, across_px : standard deviations of the filter, along and across the lines.

    Returns
    -------
    The same shape.
    """
    return cv2.GaussianBlur(image, (0, 0), sigmaX=along_px, sigmaY=across_px)
