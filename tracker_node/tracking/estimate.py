"""What the tracker says about one image set."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from .camera_fault import CameraFault


class Status(IntEnum):
    """Same numbers as tracker_msgs/TrackedState."""

    INITIALISING = 0
    TRACKING = 1
    DEGRADED = 2
    LOST = 3

    @property
    def has_state(self) -> bool:
        """False before a state is found: the estimate then holds the neutral state, which says nothing about the body."""
        return self is not Status.INITIALISING

    @property
    def known(self) -> bool:
        """Whether the state may be used: TRACKING or DEGRADED; messages that cannot say otherwise hold no other."""
        return self in (Status.TRACKING, Status.DEGRADED)


class LimbStatus(IntEnum):
    """Of one limb; same numbers as tracker_msgs/TrackedState. UNSEEN: hidden, or out of the images; its place is a guess."""

    UNSEEN = 0
    TRACKING = 1
    DEGRADED = 2
    LOST = 3


@dataclass(frozen=True)
class LimbReport:
    """How far one limb can be trusted; ``probability`` is that its end is not where the state says, ``reason`` for people."""

    name: str
    status: LimbStatus
    reason: str
    probability: float


@dataclass(frozen=True)
class CameraReport:
    """One camera's part in an estimate.

    ``stamp_ns`` of the image used, 0 when the camera gave none; ``residual_px`` rms over ``samples`` contour samples.
    """

    camera: str
    stamp_ns: int
    residual_px: float
    samples: int


@dataclass(frozen=True)
class Timings:
    """Wall-clock milliseconds; for reading only, nothing is decided by them."""

    observe_ms: float
    optimize_ms: float
    total_ms: float


@dataclass(frozen=True, eq=False)
class TrackEstimate:
    """Estimate of one instant.

    ``velocity`` (n_dof,) per second and ``covariance`` (n_dof, n_dof) are in the tangent of `model.configuration.State`
    (metres, radians). ``score`` is the robust cost (px^2) at the solution, ``residual_px`` the rms distance of the contour
    samples over all cameras. ``limbs`` is empty where the engine does not judge them: the trunk comes first, then the branches of
    the kinematic tree. ``velocity_covariance`` (n_dof, n_dof) is None where nothing is known of it. ``information``
    (n_dof, n_dof) is the inverse covariance that these images alone would give; None where they are not believed. ``pull``
    (n_dof,) is that times the tangent from ``state`` to where they alone would have it: what the prediction holds them from.
    ``arcs`` (n_dof, n_dof) is what of the covariance is not of errors along the tangent but of those that lead beside it.
    ``faults`` are cameras that the others contradict.
    """

    stamp_ns: int
    status: Status
    status_reason: str
    state: State
    velocity: np.ndarray
    covariance: np.ndarray
    score: float
    residual_px: float
    cameras: tuple[CameraReport, ...]
    iterations: int
    evaluations: int
    timings: Timings
    limbs: tuple[LimbReport, ...] = ()
    velocity_covariance: np.ndarray | None = None
    information: np.ndarray | None = None
    pull: np.ndarray | None = None
    arcs: np.ndarray | None = None
    faults: tuple[CameraFault, ...] = ()

    def landmark_covariances(self, model: ArticulatedModel) -> np.ndarray:
        """(n_landmarks, 3, 3), m^2 in world axes: the covariance of the state carried to every landmark of ``model``."""
        J = Configuration(model, self.state).landmark_jacobian()
        return J @ self.covariance @ np.swapaxes(J, 1, 2)
