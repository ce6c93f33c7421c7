"""The estimate that a tracker's messages were made from."""

from typing import Any

import numpy as np

from tracker_node.loaders.bag.message_types import stamp_ns_of
from tracker_node.model.configuration import State
from tracker_node.tracking.estimate import CameraReport, LimbReport, LimbStatus, Status, Timings, TrackEstimate


def estimate_of(message: Any, covariance: Any = None) -> TrackEstimate:
    """The estimate in messages of a graph or of a bag.

    The root's rotation comes from the rotation vector in ``values``, so ``state.to_values()`` agrees to rounding; for exact
    comparisons use the message's own ``values``.

    Parameters
    ----------
    message : TrackedState.
    covariance : StateCovariance with the same stamp; None: the covariance of the estimate is NaN.

    Returns
    -------
    estimate : without what no message holds.
    """
    n = len(message.values)
    reports = zip(message.cameras, message.camera_stamps, message.camera_residuals, message.camera_samples, strict=True)
    limbs = zip(message.limbs, message.limb_status, message.limb_reasons, message.limb_lost_probability, strict=True)
    velocity_covariance = () if covariance is None else covariance.velocity_covariance
    return TrackEstimate(
        stamp_ns=stamp_ns_of(message.header.stamp),
        status=Status(int(message.status)),
        status_reason=message.status_reason,
        state=State.from_values(np.array(message.values)),
        velocity=np.array(message.velocities),
        covariance=np.full((n, n), np.nan) if covariance is None else np.array(covariance.covariance).reshape(n, n),
        score=float(message.score),
        residual=float(message.residual),
        residual_unit=message.residual_unit,
        cameras=tuple(CameraReport(name, stamp_ns_of(stamp), float(rms), int(n)) for name, stamp, rms, n in reports),
        iterations=int(message.iterations),
        evaluations=int(message.evaluations),
        timings=Timings(float(message.observe_ms), float(message.optimize_ms), float(message.total_ms)),
        limbs=tuple(LimbReport(name, LimbStatus(int(status)), reason, float(p)) for name, status, reason, p in limbs),
        velocity_covariance=np.array(velocity_covariance).reshape(n, n) if len(velocity_covariance) else None,
    )
