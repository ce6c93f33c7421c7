"""What the tracking thread works with, and what it counts."""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ...camera.rig import CameraRig
from ...model.configuration import State
from ...runs.loop import StartRequest, Steppable
from ...tracking.config import TrackerConfig
from ...tracking.estimate import CameraReport, Status, Timings, TrackEstimate

PAUSED, INACTIVE, UNCALIBRATED = "paused", "inactive", "uncalibrated"  # why images that have come are not used
_IDLE = (PAUSED, INACTIVE, UNCALIBRATED)


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """What is tracked with, from one change of parameters to the next.

    ``cameras`` are those in use, and ``rig`` is of these alone; it and ``tracker`` are None where lenses are not known yet.
    """

    config: TrackerConfig
    cameras: tuple[str, ...]
    rig: CameraRig | None = None
    tracker: Steppable | None = None


class StartRequests:
    """Keeps the newest request, which comes from any thread, until an image set has been tracked as requested."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: StartRequest | None = None

    @property
    def asked(self) -> StartRequest | None:
        """The newest, until it has been followed."""
        return self._asked

    def ask(self, request: StartRequest) -> None:
        """A new one; it takes the place of an earlier one."""
        with self._lock:
            self._asked = request

    def followed(self, request: StartRequest | None) -> None:
        """An image set has been tracked as this one said; what has been asked since is kept."""
        with self._lock:
            if self._asked is request:
                self._asked = None


@dataclass
class WorkerCounts:
    """What became of images and image sets; read by the diagnostics."""

    tracked: int = 0
    skipped: int = 0  # sets not tracked since a newer one was there
    lost: int = 0
    failed: int = 0  # sets at which the tracker raised an error
    refused: Counter[str] = field(default_factory=Counter)  # camera -> images that could not be used
    problems: dict[str, str] = field(default_factory=dict)  # camera -> why
    idle: dict[str, Counter[str]] = field(default_factory=lambda: {reason: Counter() for reason in _IDLE})
    # reason -> camera -> images that came while nothing was to be tracked


def unknown_estimate(stamp_ns: int, reason: str, state: State, cameras: tuple[str, ...], total_ms: float) -> TrackEstimate:
    """What is said when the tracker could not say anything: the last state, and that it is lost.

    Parameters
    ----------
    stamp_ns : of the image set.
    reason : for people.
    state : the last one known.
    cameras : names, in the order of the rig.
    total_ms : that it took.

    Returns
    -------
    estimate : LOST, with a covariance that says nothing.
    """
    n = len(state.to_values())
    return TrackEstimate(
        stamp_ns=stamp_ns,
        status=Status.LOST,
        status_reason=reason,
        state=state,
        velocity=np.zeros(n),
        covariance=np.eye(n) * 1e6,
        score=0.0,
        residual=0.0,
        cameras=tuple(CameraReport(name, 0, 0.0, 0) for name in cameras),
        iterations=0,
        evaluations=0,
        timings=Timings(0.0, 0.0, total_ms),
    )
