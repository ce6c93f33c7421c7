"""What is said of a fit: its status, what of it may be used, and the cameras that do not agree with it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..camera.rig import Camera
from ..observation.image_set import ImageSet
from .estimate import CameraReport, LimbReport, Status
from .uncertainty.covariance import ImageEvidence


@dataclass(frozen=True)
class Assessment:
    """Assessment of a fit.

    Attributes
    ----------
    status, reason : of the whole body; the reason is empty when it is TRACKING.
    noise : what was fitted is not the body at all, and the predicted state is the better answer.
    jumped : the body was found far from where it was expected, and how it got there says nothing of its velocity.
    limbs : one by one, where the modality assesses them; else empty.
    dof_weights : (n_dof,) factor of the information's square root, with ``limbs``.
    part_weights : (n_shapes,) how far each part is where the state says, with ``limbs``.
    log_ratio : log-likelihood of the images for this state against chance, by which states in the same images are compared; None
        where the modality has no such measure.
    doubt_rad : how well the turn of a body without limbs is known while it is in doubt, a standard deviation; 0 while it is not.
    support : (n_cameras,) the same of each camera, a sample of the outline; nan where it should not see any; None as above.
    shown : (n_cameras,) of `keypoints.judge.shares_found`; None where a detector finds the body in no camera.
    """

    status: Status
    reason: str
    noise: bool = False
    jumped: bool = False
    limbs: tuple[LimbReport, ...] = ()
    dof_weights: np.ndarray | None = None
    part_weights: np.ndarray | None = None
    log_ratio: float | None = None
    support: np.ndarray | None = None
    shown: np.ndarray | None = None
    doubt_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class Report:
    """Residuals and covariance of a fit.

    Attributes
    ----------
    cameras : each camera's part.
    residual : rms over all, in the modality's unit.
    covariance : (n_dof, n_dof) of the state in its tangent.
    images : what of it comes from the images, where the modality has it.
    second_order : (n_dof, n_dof) part of the covariance that is of second order, where it is known.
    """

    cameras: tuple[CameraReport, ...]
    residual: float
    covariance: np.ndarray
    images: ImageEvidence | None = None
    second_order: np.ndarray | None = None


def inverse_covariance(H: np.ndarray, variance: float) -> np.ndarray:
    """Covariance of a state by normal equations that are inverted as they are.

    Parameters
    ----------
    H : (n_dof, n_dof) Gauss-Newton matrix.
    variance : of one of its residuals, times how many of them share one error.

    Returns
    -------
    (n_dof, n_dof); directions that nothing tells get a large variance.
    """
    H = H.copy()
    H[np.diag_indices_from(H)] += 1e-6 * max(float(np.diag(H).max()), 1.0)
    covariance = variance * np.linalg.inv(H)
    return 0.5 * (covariance + covariance.T)


def camera_reports(
    rig: Iterable[Camera], image_set: ImageSet, rms: Sequence[float] | np.ndarray, samples: Sequence[int] | np.ndarray
) -> tuple[CameraReport, ...]:
    """Each camera's part in a fit.

    Parameters
    ----------
    rig, image_set : cameras, and their images; the stamp of one without an image is 0.
    rms, samples : of each camera's residuals, in the order of the rig.

    Returns
    -------
    In the order of the rig.
    """
    names = [camera.name for camera in rig]
    images = [image_set.get(name) for name in names]
    stamps_ns = [0 if image is None else image.stamp_ns for image in images]
    return tuple(map(CameraReport, names, stamps_ns, map(float, rms), map(int, samples)))


def assess_cameras(
    agreement: Mapping[str, float], least: float, present: Sequence[str], n_cameras: int, what: str, seen: str
) -> tuple[Status, str]:
    """Status of a body that is in place, by whether every camera sees it as it should.

    A camera in whose image the body is not expected is in order, as long as two others see it.

    Parameters
    ----------
    agreement : 0 to 1 by name of the cameras that see where the body is.
    least : a camera below it does not agree.
    present : cameras that gave an image.
    n_cameras : of the rig.
    what : says of cameras that do not agree what does not.
    seen : what a camera that sees the body sees.

    Returns
    -------
    TRACKING and "", or DEGRADED and the reason.
    """
    against = [f"{camera} ({100 * max(share, 0.0):.0f} %)" for camera, share in agreement.items() if share < least]
    if against:
        return Status.DEGRADED, f"{what} in {', '.join(against)}"
    if len(present) < n_cameras:
        return Status.DEGRADED, f"{len(present)} of {n_cameras} cameras"
    if len(agreement) < min(2, n_cameras):
        return Status.DEGRADED, f"only {', '.join(agreement) or 'no camera'} sees {seen}"
    return Status.TRACKING, ""
