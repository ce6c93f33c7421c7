"""What the tracking thread works with, and what it counts."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ...camera.rig import CameraRig
from ...model.configuration import State
from ...observation.image_set import ImageSet
from ...tracking.config import TrackerConfig
from ...tracking.estimate import CameraReport, Status, Timings, TrackEstimate

PAUSED, INACTIVE, UNCALIBRATED = "paused", "inactive", "uncalibrated"  # why images that have come are not used
_IDLE = (PAUSED, INACTIVE, UNCALIBRATED)


class Steppable(Protocol):
    """What the worker needs of a tracker."""

    def step(self, image_set: ImageSet) -> TrackEstimate: ...
    def reset(self) -> None: ...
    def set_state(self, state: State) -> None: ...
    def look_anew(self) -> None: ...
    def take_over(self, other: Any, image_set: ImageSet) -> None: ...


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """What is tracked with, from one change of parameters to the next.

    ``cameras`` are those in use, and ``rig`` is of these alone; it and ``tracker`` are None where lenses are not known yet.
    """

    config: TrackerConfig
    cameras: tuple[str, ...]
    rig: CameraRig | None = None
    tracker: Steppable | None = None


@dataclass(frozen=True, eq=False)
class StartRequest:
    """How the tracker is to begin with the next image set, and the state at which; None: not at a given one."""

    tell: Callable[[Steppable], None]
    state: State | None = None


class StartRequests:
    """Keeps a request, whatever else changes, until an image set has been tracked as asked.

    Requests come from any thread, and reach the tracker in the tracking thread, later.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: StartRequest | None = None
        self.told: StartRequest | None = None  # to the tracker, which has not tracked since

    @property
    def asked(self) -> StartRequest | None:
        """The newest, until it has been followed."""
        return self._asked

    def ask(self, request: StartRequest) -> None:
        """A new one; it takes the place of an earlier one."""
        with self._lock:
            self._asked = request

    def followed(self) -> None:
        """An image set has been tracked as the tracker was told; what has been asked since is kept."""
        with self._lock:
            if self._asked is self.told:
                self._asked = None
            self.told = None


@dataclass
class WorkerCounts:
    """What became of images and image sets; read by the diagnostics."""

    tracked: int = 0
    superseded: int = 0  # sets not tracked since a newer one was there
    lost: int = 0
    failed: int = 0  # sets at which the tracker raised an error
    refused: Counter[str] = field(default_factory=Counter)  # camera -> images that could not be used
    problems: dict[str, str] = field(default_factory=dict)  # camera -> why
    idle: dict[str, Counter[str]] = field(default_factory=lambda: {reason: Counter() for reason in _IDLE})
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
