"""How far an estimate can be trusted: per-camera residuals, covariance, status."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..camera.camera_rig import CameraRig
from ..objective import contour_residual as kernel
from ..objective.contour_objective import CameraSlot
from ..objective.normal_equations import NormalEquations
from ..observation.image_set import ImageSet
from ..observation.observer import Observation
from .config import StatusConfig
from .estimate import CameraReport, Status


def _totals(slots: Sequence[CameraSlot], observations: Sequence[Observation | None]) -> np.ndarray:
    total = np.zeros(kernel.N_STATISTICS)
    for slot, observation in zip(slots, observations, strict=True):
        if observation is not None and not observation.empty:
            total += slot.stats
    return total


def _rms(stats: np.ndarray) -> float:
    return float(np.sqrt(stats[kernel.SQUARES] / stats[kernel.WEIGHT])) if stats[kernel.WEIGHT] > 0 else 0.0


def reports_of(
    rig: CameraRig, slots: Sequence[CameraSlot], observations: Sequence[Observation | None], image_set: ImageSet
) -> tuple[tuple[CameraReport, ...], float]:
    """Each camera's report, and the rms residual (px, robustly weighted) over all."""
    reports = []
    for camera, slot, observation in zip(rig, slots, observations, strict=True):
        image = image_set.get(camera.name)
        used = observation is not None and not observation.empty
        stats = slot.stats if used else np.zeros(kernel.N_STATISTICS)
        reports.append(CameraReport(camera.name, 0 if image is None else image.stamp_ns, _rms(stats), int(stats[kernel.COUNT])))
    return tuple(reports), _rms(_totals(slots, observations))


def covariance_of(
    equations: NormalEquations, slots: Sequence[CameraSlot], observations: Sequence[Observation | None], config: StatusConfig
) -> np.ndarray:
    """Covariance (n_dof, n_dof) of the state in its tangent.

    The inverse of the normal equations times the variance of one sample; neighbouring samples see the same pixels, so only
    one in ``config.correlation`` counts as independent.
    """
    stats = _totals(slots, observations)
    variance = max(_rms(stats), config.residual_sigma_px) ** 2 * config.correlation
    H = equations.H.copy()
    H[np.diag_indices_from(H)] += 1e-6 * max(float(np.diag(H).max()), 1.0)
    covariance = variance * np.linalg.inv(H)
    return 0.5 * (covariance + covariance.T)


def judge(
    slots: Sequence[CameraSlot],
    observations: Sequence[Observation | None],
    image_set: ImageSet,
    waiting: bool,
    config: StatusConfig,
) -> tuple[Status, str]:
    """Status and the reason for it ("" when TRACKING)."""
    if waiting:
        return Status.INITIALISING, "no initial state has been given"
    useful = [o for o in observations if o is not None and not o.empty]
    if not useful:
        return Status.LOST, "no camera sees anything like the body where it is expected"
    stats = _totals(slots, observations)
    support = stats[kernel.COUNT] / max(stats[kernel.N_CANDIDATES], 1.0)
    residual = _rms(stats)
    if stats[kernel.COUNT] < 20:
        return Status.LOST, f"only {int(stats[kernel.COUNT])} contour samples find a boundary"
    if residual > config.lost_residual_px or support < config.lost_support:
        return Status.LOST, f"residual {residual:.1f} px, {100 * support:.0f} % of the contour supported"
    if residual > config.degraded_residual_px or support < config.degraded_support:
        return Status.DEGRADED, f"residual {residual:.1f} px, {100 * support:.0f} % of the contour supported"
    missing = [o.camera for o in observations if o is not None and o.empty]
    if missing:
        return Status.DEGRADED, f"empty silhouette in {', '.join(missing)}"
    if len(useful) < len(slots):
        return Status.DEGRADED, f"{len(useful)} of {len(slots)} cameras"
    return Status.TRACKING, ""
