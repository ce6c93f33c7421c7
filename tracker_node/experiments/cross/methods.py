"""The ways in which ``reproduce cross`` tracks a rigid body through video: as published, and as well as the score allows.

Each image set is fitted from an extrapolation of the two before (Trewartha, Yeadon & Knight). Where cameras expose at different
times, the objective needs a velocity: going through the video, it is that of the two image sets before; once the video is done,
it is that of the image sets before and after, and each image set can be fitted again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...errors import CalibrationError
from ...model.configuration import N_ROOT, State, from_variables, to_variables
from ...objective.color.alignment import PhotometricOptions
from ...objective.color.asynchronous import AsynchronousObjective, AsynchronousPhotometricObjective
from ...objective.color.score import ColorOptions
from ...observation.deinterlace import field_camera, first_line
from ...optimize.alignment import AlignmentOptions, align
from ...optimize.simplex import POLISH, search_simplex
from ...optimize.stepping import SEVEN_LOOPS, SteppingOptions, step_downhill
from ..rigid_tracking import FitResult, TrackedSequence, moved, sequence_of
from .scene import SHUTTER_S, CrossScene, Footage
from .throw import FIELD_PERIOD_S, LATE_CAMERA, CrossTrial

Show = Callable[[int, np.ndarray | None], None]
"""Hands image set i, and the body's velocity (n_dof,) per second where it is known, to the objective."""
_STEP_S, _STEPS = 0.004, 3  # between the delays that are tried, and to either side


def track_video(
    show: Show, n_images: int, start: State, fit: Callable[[State], FitResult], period_s: float
) -> TrackedSequence:
    """Track a video.

    Parameters
    ----------
    show : hands an image set to the objective of ``fit``.
    n_images : image sets.
    start : pose at the first one, as someone has laid the model over it.
    fit : from a start to an estimate.
    period_s : time between image sets.

    Returns
    -------
    An estimate for each image set.
    """
    found: list[FitResult] = []
    for image in range(n_images):
        states = [each.state for each in found[-2:]]
        show(image, states[1].difference(states[0]) / period_s if len(states) == 2 else None)
        found.append(fit(extrapolated(states) if states else start))
    return sequence_of(found)


def refine_video(show: Show, states: Sequence[State], fit: Callable[[State], FitResult], period_s: float) -> TrackedSequence:
    """Fit every image set again from its own estimate, with the velocity from the estimates around it.

    Parameters
    ----------
    show : hands an image set to the objective of ``fit``.
    states : estimates.
    fit : from a start to an estimate.
    period_s : time between image sets.

    Returns
    -------
    An estimate for each image set.
    """
    found = []
    for image, velocity in enumerate(velocities(states, period_s)):
        show(image, velocity)
        found.append(fit(states[image]))
    return sequence_of(found)


def extrapolated(states: Sequence[State]) -> State:
    """The next state, its variables being linear in time from the last two states; after one state: the same."""
    if len(states) < 2:
        return states[-1]
    before = to_variables(states[-2])
    last = to_variables(states[-1], before)
    return from_variables(2.0 * last - before)


def velocities(states: Sequence[State], period_s: float) -> list[np.ndarray]:
    """Velocities from the difference of the neighbors; at the ends, of the next one.

    Parameters
    ----------
    states : in order of time.
    period_s : time between them.

    Returns
    -------
    (n_dof,) tangent a second, for each state.
    """
    result = []
    for i in range(len(states)):
        before, after = max(i - 1, 0), min(i + 1, len(states) - 1)
        result.append(states[after].difference(states[before]) / (max(after - before, 1) * period_s))
    return result


def estimate_delay(mean_square: Callable[[float], float], name: str) -> float:
    """How much later a camera exposes than the others: where the score of a whole video is lowest.

    Parameters
    ----------
    mean_square : of the color differences, once every image set has been fitted with the delay in seconds.
    name : of the camera, for messages.

    Returns
    -------
    Seconds, from the parabola through the lowest score and its neighbors; negative: earlier.

    Raises
    ------
    CalibrationError : the best delay is the largest that is tried.
    """
    delays = _STEP_S * np.arange(-_STEPS, _STEPS + 1)
    scores = np.array([mean_square(float(delay)) for delay in delays])
    lowest = int(np.argmin(scores))
    if lowest in (0, len(delays) - 1):
        within = f"{1e3 * _STEP_S * _STEPS:g} ms of the other cameras"
        raise CalibrationError(name, f"its delay is not within {within}, or nothing moves")
    before, here, after = scores[lowest - 1 : lowest + 2]
    return float(delays[lowest] + 0.5 * _STEP_S * (before - after) / (before - 2.0 * here + after))


START_ERROR = (30.0, -30.0, 26.5, 3.0, -3.0, 2.6)  # of the first field's start, mm and degrees: 50 mm and 5 degrees in all
LOW_PASS_PX = (2.0, 0.5)  # along and across the lines: chroma has no more bandwidth, so what this removes is noise
_RIGID = tuple(range(N_ROOT))


@dataclass(frozen=True)
class Method:
    """One way to track.

    Attributes
    ----------
    key : between the trial's name and the figure's; empty for the best.
    rig : which cameras are known, of `CrossScene.rigs`.
    times : whether it is "known" how late a camera is, "estimated" from the video (by the best method), or "ignored".
    fit : "stepping" on the fields as they are is the paper's. With the others noise is filtered out, and once the velocities are
        known every field is fitted again: "alignment", or "simplex" after stepping.
    colors : "normalized", "raw", or "gained": raw, in each camera's best gain.
    shutter_s : exposure of the video's fields.
    own_lines : score only the lines that a field has, instead of interpolating the missing ones.
    """

    key: str
    title: str
    rig: str = "dlt_radial"
    times: str = "estimated"
    fit: str = "alignment"
    colors: str = "normalized"
    shutter_s: float = SHUTTER_S
    own_lines: bool = False


BEST = Method("", "alignment, DLT with distortion, time estimated")
AS_PUBLISHED = Method("published.", "stepping, DLT of seven parameters, times unknown", "dlt_centered", "ignored", "stepping")
METHODS = (
    BEST,
    Method("true_cameras.", "same, true cameras and time", "true", "known"),
    Method("known_time.", "same, true time", times="known"),
    Method("without_time.", "same, times unknown", times="ignored"),
    Method("dlt.", "same, DLT of eleven parameters", "dlt"),
    Method("dlt_centered.", "same, DLT of seven parameters", "dlt_centered"),
    Method("sharp.", "same, video without motion blur", shutter_s=0.0),
    Method("own_lines.", "same, no interpolated lines", own_lines=True),
    Method("raw.", "same, raw RGB, lights as measured", colors="raw"),
    Method("gained.", "same, raw RGB in the best gains", colors="gained"),
    Method("lit.", "same, raw RGB, all of cameras and lights known", "lit", "known", colors="raw"),
    Method("simplex.", "stepping and simplex", fit="simplex"),
    Method("stepping.", "stepping", fit="stepping"),
    Method("stepping_without_time.", "stepping, times unknown", times="ignored", fit="stepping"),
    Method("stepping_dlt.", "stepping, DLT of eleven parameters, times unknown", "dlt", "ignored", "stepping"),
    Method("stepping_raw.", "as published, raw RGB", "dlt_centered", "ignored", "stepping", "raw"),
    AS_PUBLISHED,
)


class _Fitter:
    """Fits the cross to one field at a time, with each of the optimizers."""

    def __init__(
        self, scene: CrossScene, trial: CrossTrial, footage: Footage, method: Method, late_s: Sequence[float]
    ):
        self._footage, self._method, self._chain = footage, method, scene.model.chain
        rig = scene.rigs[method.rig]
        rigs = [rig, rig]
        if method.own_lines:
            rigs = [replace(rig, cameras=tuple(field_camera(camera, line) for camera in rig)) for line in (0, 1)]
        raw, gained = method.colors != "normalized", method.colors == "gained"
        colors = scene.picked_colors(trial, footage.interpolated(0), rig if raw else None)
        representation = "raw" if raw else "normalized"
        compared = ColorOptions(representation, gained=gained), PhotometricOptions(representation, gained=gained)
        self._of_line = [
            (
                AsynchronousObjective(scene.model, known, late_s, compared[0], colors),
                AsynchronousPhotometricObjective(scene.model, known, late_s, compared[1], colors),
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
        self._score, self._aligned = self._of_line[first_line(field)]
        for objective in (self._score, self._aligned):
            objective.set_images(pictures)
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

    def mean_square(self, states: Sequence[State]) -> float:
        """Of the color differences in the whole video, once every field has been aligned from its estimate."""
        cost, count = 0.0, 0
        for field, velocity in enumerate(velocities(states, FIELD_PERIOD_S)):
            self.show(field, velocity)
            found = align(self._aligned, states[field], self._chain, AlignmentOptions(coarsest=1)).equations
            cost, count = cost + found.cost, count + found.count
        return cost / count if count else np.inf


def track(scene: CrossScene, trial: CrossTrial, footage: Footage, method: Method, late_s: Sequence[float]) -> TrackedSequence:
    """Track a throw by one method.

    Parameters
    ----------
    scene : what is known of cameras, lights and colors.
    trial : the throw.
    footage : its video.
    method : how to track.
    late_s : how late each camera exposes, as far as is known.

    Returns
    -------
    Estimates at every field.
    """
    fitter = _Fitter(scene, trial, footage, method, late_s)
    first = track_video(fitter.show, trial.n_fields, _start(trial), fitter.first, FIELD_PERIOD_S)
    if method.fit == "stepping" or method.times == "ignored":
        return first
    again = refine_video(fitter.show, first.states, fitter.again, FIELD_PERIOD_S)
    return TrackedSequence(again.states, first.evaluations + again.evaluations)


def estimated_times(scene: CrossScene, trial: CrossTrial, footage: Footage) -> tuple[float, ...]:
    """How late each camera exposes, estimated from a video.

    Parameters
    ----------
    scene : what is known of cameras, lights and colors.
    trial : the throw.
    footage : its video.

    Returns
    -------
    Seconds, in the order of the rig.
    """
    at_once = (0.0,) * len(scene.late_s)
    rough = track(scene, trial, footage, replace(BEST, times="ignored"), at_once).states

    def times(late_s: float) -> tuple[float, ...]:
        return tuple(late_s if name == LATE_CAMERA else 0.0 for name in scene.rig.names)

    def mean_square(late_s: float) -> float:
        return _Fitter(scene, trial, footage, BEST, times(late_s)).mean_square(rough)

    return times(estimate_delay(mean_square, LATE_CAMERA))


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
