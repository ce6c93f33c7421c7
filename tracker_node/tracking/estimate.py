"""What the tracker says about one image set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State


class Status(IntEnum):
    """Same numbers as tracker_msgs/TrackedState."""

    INITIALIZING = 0
    TRACKING = 1
    DEGRADED = 2
    LOST = 3

    @property
    def has_state(self) -> bool:
        """False before a state is found: the estimate then holds the neutral state, which says nothing about the body."""
        return self is not Status.INITIALIZING

    @property
    def known(self) -> bool:
        """Whether the state may be used: TRACKING or DEGRADED; messages that cannot say otherwise hold no other."""
        return self in (Status.TRACKING, Status.DEGRADED)


def known_sets(status_counts: Mapping[str, int]) -> int:
    """In how many image sets a body was known, by how many there were of each `Status`, by its name."""
    return sum(status_counts.get(status.name, 0) for status in Status if status.known)


class LimbStatus(IntEnum):
    """Of one limb; same numbers as the constants ``LIMB_...`` of tracker_msgs/TrackedState.

    UNSEEN: hidden, or out of the images; its place is a guess.
    """

    TRACKING = 1
    DEGRADED = 2
    LOST = 3
    UNSEEN = 4


TURNED, DELAYED, FROZEN = "turned", "delayed", "frozen"
BLIND, DEFOCUSED, NOISY, BUMPED = "blind", "defocused", "noisy", "bumped"
"""Kinds of faults of a camera."""

PX, GRAY_LEVELS = "px", "gray levels"
"""Units of residuals: of contours and points, and of colors and texture."""


@dataclass(frozen=True)
class LimbReport:
    """Assessment of one limb; ``probability`` is that its end is not where the state says, ``reason`` for people."""

    name: str
    status: LimbStatus
    reason: str
    probability: float

    def doubted(self, reason: str) -> LimbReport:
        """DEGRADED for a reason, if there is one, and it is TRACKING."""
        if not reason or self.status is not LimbStatus.TRACKING:
            return self
        return replace(self, status=LimbStatus.DEGRADED, reason=reason)


@dataclass(frozen=True)
class CameraReport:
    """One camera's part in an estimate.

    ``stamp_ns`` of the image used, 0 when the camera gave none; ``residual`` rms over ``samples`` image samples, in the unit of
    the estimate.
    """

    camera: str
    stamp_ns: int
    residual: float
    samples: int


_OF_PICTURES = {
    BLIND: "shows nothing of the body where the others see it: covered, upside down, or not where it was calibrated",
    DEFOCUSED: "is out of focus, and finds less of the body",
    NOISY: "is full of noise, and finds less of the body",
}


@dataclass(frozen=True)
class CameraFault:
    """A camera that the others contradict in one way.

    ``kind`` is `TURNED` (``size`` and ``sigma`` in radians: since the calibration, about its center), `DELAYED` (seconds by which
    its images are later than their stamps say; negative: earlier), `FROZEN` (seconds for which it has repeated its image),
    `BLIND`, `DEFOCUSED` or `NOISY` (what it finds of the body's outline, in shares of what is usual), `BUMPED` (radians: all that
    stands still in its picture has turned, since the start).
    ``rivals`` are cameras of which it might as well be one.
    """

    camera: str
    kind: str
    size: float
    sigma: float
    since_ns: int
    rivals: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """For people."""
        who = " or ".join((self.camera, *self.rivals))
        turn = f"{np.degrees(self.size):.1f} degrees (+- {np.degrees(self.sigma):.1f})"
        if self.kind == BUMPED:
            return f"{who} has been bumped: its picture of the room has turned by {turn} since the start"
        if self.kind == TURNED:
            return f"{who} is turned by {turn} from where its calibration has it"
        if self.kind == FROZEN:
            return f"{who} repeats its image of {1e3 * self.size:.0f} ms ago; it is left out"
        if self.kind in _OF_PICTURES:
            return f"{who} {_OF_PICTURES[self.kind]} ({100.0 * max(self.size, 0.0):.0f} % of what is usual)"
        when = "late" if self.size > 0 else "early"
        return f"images of {who} are {1e3 * abs(self.size):.0f} ms (+- {1e3 * self.sigma:.0f}) {when}"


@dataclass(frozen=True)
class Timings:
    """Wall-clock milliseconds; for reading only, nothing is decided by them."""

    observe_ms: float
    optimize_ms: float
    total_ms: float


@dataclass(frozen=True, eq=False)
class TrackEstimate:
    """Estimate of one time step.

    Parameters
    ----------
    velocity, covariance : (n_dof,) per second and (n_dof, n_dof), in the tangent of `State` (meters, radians).
    score : cost of the objective at the solution.
    residual, residual_unit : rms over all cameras; `PX`, or `GRAY_LEVELS` where colors or texture are compared alone.
    limbs : the trunk, then the branches of the kinematic tree; empty where the engine does not judge them.
    velocity_covariance : (n_dof, n_dof), None where it is not known.
    information : (n_dof, n_dof) inverse covariance from these images alone; None where they have no weight.
    innovation : (n_dof,) in information form: ``information`` times the tangent from ``state`` to where these images have it.
    second_order : (n_dof, n_dof) the second-order terms within ``covariance``.
    faults : cameras that the others contradict.
    surfaces : (n_shapes, 4) meters: where the surface of each part is beside its shape (`model.clothes`), for drawing;
        None where that is not followed.
    """

    stamp_ns: int
    status: Status
    status_reason: str
    state: State
    velocity: np.ndarray
    covariance: np.ndarray
    score: float
    residual: float
    cameras: tuple[CameraReport, ...]
    iterations: int
    evaluations: int
    timings: Timings
    limbs: tuple[LimbReport, ...] = ()
    velocity_covariance: np.ndarray | None = None
    information: np.ndarray | None = None
    innovation: np.ndarray | None = None
    second_order: np.ndarray | None = None
    faults: tuple[CameraFault, ...] = ()
    residual_unit: str = PX
    surfaces: np.ndarray | None = None

    def landmark_covariances(self, model: ArticulatedModel) -> np.ndarray:
        """(n_landmarks, 3, 3), m^2 in world axes: the covariance of the state carried to every landmark of ``model``."""
        J = Configuration(model, self.state).landmark_jacobian()
        return J @ self.covariance @ np.swapaxes(J, 1, 2)


def unknown_estimate(
    stamp_ns: int, reason: str, state: State, cameras: tuple[str, ...], total_ms: float, status: Status = Status.LOST
) -> TrackEstimate:
    """What is said of a body of which no tracker says anything.

    Parameters
    ----------
    stamp_ns : of the image set.
    reason : for people.
    state : the last one known.
    cameras : names, in the order of the rig.
    total_ms : that it took.
    status : LOST, or INITIALIZING.

    Returns
    -------
    estimate : with a covariance that says nothing.
    """
    n = len(state.to_values())
    return TrackEstimate(
        stamp_ns=stamp_ns,
        status=status,
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
