"""How late a camera that is not genlocked exposes, from the video itself.

The other cameras alone give the motion; the delay is the one with which the late camera's images agree best with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...errors import CalibrationError
from ...model.configuration import State
from ...objective.color.score import ColorObjective
from .video_tracking import velocities

_NEAR = 4  # steps to either side of the lowest score through which the parabola is laid


def estimate_delay(
    objective: ColorObjective, show: Callable[[int], None], states: Sequence[State], period_s: float,
    longest_s: float = 0.012, step_s: float = 0.001,
) -> float:  # fmt: skip
    """Seconds by which the camera of ``objective`` is later than the images that ``states`` come from; negative: earlier.

    Parameters
    ----------
    objective : of a rig with this one camera.
    show : hands its image of image set i to the objective.
    states : the body at every image set, estimated without this camera.

    Raises
    ------
    CalibrationError : the best delay lies at or beyond ``longest_s``.
    """
    n = round(longest_s / step_s)
    delays = step_s * np.arange(-n, n + 1)
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
        name = objective.rig.names[0]
        raise CalibrationError(name, f"its delay is not within {1e3 * longest_s:g} ms of the other cameras, or nothing moves")
    near = slice(max(lowest - _NEAR, 0), lowest + _NEAR + 1)
    a, b, _ = np.polyfit(delays[near] / step_s, mean[near], 2)
    return float(-0.5 * b / a * step_s)
