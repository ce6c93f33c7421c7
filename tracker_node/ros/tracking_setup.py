"""What the tracking thread works with, and what it counts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..camera.camera_rig import CameraRig
from ..model.configuration import State
from ..observation.image_set import ImageSet
from ..tracking.config import TrackerConfig
from ..tracking.estimate import CameraReport, Status, Timings, TrackEstimate

PAUSED, INACTIVE = "paused", "inactive"  # why images that have come are not used


class Steppable(Protocol):
    """What the worker needs of a tracker."""

    def step(self, image_set: ImageSet) -> TrackEstimate: ...
    def reset(self) -> None: ...
    def set_state(self, state: State) -> None: ...
    def look_anew(self) -> None: ...


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """What is tracked with, from one change of parameters to the next.

    ``cameras`` are those in use, and ``rig`` is of these alone; it and ``tracker`` are None where lenses are not known yet.
    """

    config: TrackerConfig
    cameras: tuple[str, ...]
    rig: CameraRig | None = None
    tracker: Steppable | None = None


@dataclass
class WorkerCounts:
    """What became of images and image sets; read by the diagnostics."""

    tracked: int = 0
    superseded: int = 0  # sets not tracked since a newer one was there
    lost: int = 0
    failed: int = 0  # sets at which the tracker raised an error
    refused: Counter[str] = field(default_factory=Counter)  # camera -> images that could not be used
    problems: dict[str, str] = field(default_factory=dict)  # camera -> why
    idle: dict[str, Counter[str]] = field(default_factory=lambda: {PAUSED: Counter(), INACTIVE: Counter()})
    # reason -> camera -> images that came while nothing was to be tracked


def unknown_estimate(stamp_ns: int, reason: str, state: State, cameras: tuple[str, ...], total_ms: float) -> TrackEstimate:
    """What is said when the tracker could not say anything: the last state, and that it is lost."""
    n = len(state.to_values())
    return TrackEstimate(
        stamp_ns=stamp_ns,
        status=Status.LOST,
        status_reason=reason,
        state=state,
        velocity=np.zeros(n),
        covariance=np.eye(n) * 1e6,
        score=0.0,
        residual_px=0.0,
        cameras=tuple(CameraReport(name, 0, 0.0, 0) for name in cameras),
        iterations=0,
        evaluations=0,
        timings=Timings(0.0, 0.0, total_ms),
    )
