"""Tracks a rigid body through video, each image set from an extrapolation of the two before (Trewartha, Yeadon & Knight).

Where cameras expose at different times, the objective needs a velocity: going through the video, it is that of the two image sets
before; once the video is done, it is that of the image sets before and after, and each image set can be fitted again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...errors import CalibrationError
from ...model.configuration import State, from_variables, to_variables
from ...objective.color.score import ColorObjective
from ..rigid_tracking import FitResult, TrackedSequence, sequence_of

Show = Callable[[int, np.ndarray | None], None]
"""Hands image set i, and the body's velocity (n_dof,) per second where it is known, to the objective."""
_STEP_S, _STEPS = 0.001, 12  # between the delays that are tried, and to either side
_NEAR = 4  # steps to either side of the lowest score through which the parabola is laid


def track_video(
    show: Show, n_images: int, start: State, fit: Callable[[State], FitResult], period_s: float,
    done: Callable[[int], None] = lambda image: None,
) -> TrackedSequence:  # fmt: skip
    """Track a video.

    Parameters
    ----------
    show : hands an image set to the objective of ``fit``.
    n_images : image sets.
    start : pose at the first one, as someone has laid the model over it.
    fit : from a start to an estimate.
    period_s : time between image sets.
    done : called with every image set that is finished.

    Returns
    -------
    An estimate for each image set.
    """
    found: list[FitResult] = []
    for image in range(n_images):
        states = [each.state for each in found[-2:]]
        show(image, states[1].difference(states[0]) / period_s if len(states) == 2 else None)
        found.append(fit(extrapolated(states) if states else start))
        done(image)
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


def estimate_delay(
    objective: ColorObjective, show: Callable[[int], None], states: Sequence[State], period_s: float
) -> float:
    """How much later a camera exposes than the images that the states come from.

    Parameters
    ----------
    objective : of a rig with this one camera.
    show : hands its image of image set i to the objective.
    states : the body at every image set, estimated without this camera.
    period_s : time between image sets.

    Returns
    -------
    Seconds; negative: earlier.

    Raises
    ------
    CalibrationError : the best delay lies at or beyond the largest that is tried.
    """
    delays = _STEP_S * np.arange(-_STEPS, _STEPS + 1)
    squares, pixels = np.zeros(len(delays)), np.zeros(len(delays))
    for image, (state, velocity) in enumerate(zip(states, velocities(states, period_s), strict=True)):
        show(image)
        for i, delay in enumerate(delays):
            score = objective.evaluate(state.retract(delay * velocity))
            if np.isfinite(score.rms):
                squares[i] += score.rms**2 * score.camera_pixels.sum()
                pixels[i] += score.camera_pixels.sum()
    mean = squares / np.maximum(pixels, 1.0)
    lowest = int(np.argmin(np.where(pixels > 0, mean, np.inf)))
    if lowest in (0, len(delays) - 1):
        within = f"{1e3 * _STEP_S * _STEPS:g} ms of the other cameras"
        raise CalibrationError(objective.rig.names[0], f"its delay is not within {within}, or nothing moves")
    near = slice(max(lowest - _NEAR, 0), lowest + _NEAR + 1)
    a, b, _ = np.polyfit(delays[near] / _STEP_S, mean[near], 2)
    return float(-0.5 * b / a * _STEP_S)
