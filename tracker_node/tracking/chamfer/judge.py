"""How far an estimate can be trusted: per-camera residuals, covariance, status."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...camera.rig import CameraRig
from ...objective import contour_residual as kernel
from ...objective.chamfer.agreement import BOUNDARY, ON_BOUNDARY, ON_OUTLINE, OUTLINE
from ...objective.chamfer.objective import CameraSlot
from ...objective.normal_equations import NormalEquations
from ...observation.chamfer.observer import Observation
from ...observation.image_set import ImageSet
from ..config import ChamferConfig
from ..estimate import CameraReport, Status

NOTHING = 0.15  # agreement below this is that of noise: a body that is merely off has more
_AS_BEFORE = 0.93  # share of the agreement of before a loss, from which a body is where it was
_RUNNING = 3  # image sets of such agreement in a row
_FORGIVING = 0.002  # the same of a body that was lost, while it does not agree as before
_LEVEL_RATE = 0.1  # share of the newest image set in the agreement that is usual


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
    equations: NormalEquations, slots: Sequence[CameraSlot], observations: Sequence[Observation | None], config: ChamferConfig
) -> np.ndarray:
    """Covariance (n_dof, n_dof) of the state in its tangent.

    The inverse of the normal equations, which hold ``config.residual_sigma_px`` and ``config.correlation``; larger where the
    residuals are.
    """
    variance = max(_rms(_totals(slots, observations)) / config.residual_sigma_px, 1.0) ** 2
    H = equations.H.copy()
    H[np.diag_indices_from(H)] += 1e-6 * max(float(np.diag(H).max()), 1.0)
    covariance = variance * np.linalg.inv(H)
    return 0.5 * (covariance + covariance.T)


def judge(
    slots: Sequence[CameraSlot], observations: Sequence[Observation | None], image_set: ImageSet, config: ChamferConfig
) -> tuple[Status, str, float]:
    """Status, the reason for it ("" when TRACKING) and the agreement, once the slots hold it for the estimated state.

    The middle camera decides (of an even number the better): half of the cameras may be covered before a body is called lost,
    and one that agrees by chance does not make it found.
    """
    agreement = {
        o.camera: 0.0 if o.empty else _agreement(slot) for slot, o in zip(slots, observations, strict=True) if o is not None
    }
    if all(o is None or o.empty for o in observations):
        return Status.LOST, "no camera sees anything like the body where it is expected", 0.0
    stats = _totals(slots, observations)
    residual, middle = _rms(stats), sorted(agreement.values())[len(agreement) // 2]
    if stats[kernel.COUNT] < 20:
        return Status.LOST, f"only {int(stats[kernel.COUNT])} contour samples find a boundary", middle
    figures = f"residual {residual:.1f} px, outline and silhouette agree to {100 * middle:.0f} %"
    if residual > config.lost_residual_px or middle < config.lost_agreement:
        return Status.LOST, figures, middle
    if residual > config.degraded_residual_px or middle < config.degraded_agreement:
        return Status.DEGRADED, figures, middle
    return *_judge_cameras(agreement, image_set.cameras, len(slots), config), middle


class Recovery:
    """After a loss a body is TRACKING again only once outline and silhouette agree as they did before it.

    A silhouette is found from farther away than a body: of one that lies beside it, or on another thing, much agrees as well.
    """

    def __init__(self) -> None:
        self._usual: float | None = None
        self._missing = 0  # image sets of good agreement that are still asked for

    def update(self, status: Status, reason: str, agreement: float) -> tuple[Status, str]:
        """Status and reason of an image set, in the light of those before."""
        if status is Status.LOST:
            self._missing = _RUNNING if self._usual is not None else 0
        elif self._missing and self._usual is not None:
            if agreement >= _AS_BEFORE * self._usual:
                self._missing -= 1
            else:  # an image that has become worse for good, a camera that is gone, is usual in the end
                self._missing = _RUNNING
                self._usual += _FORGIVING * (agreement - self._usual)
            if self._missing:
                shares = f"{100 * agreement:.0f} %, before to {100 * self._usual:.0f} %"
                return Status.DEGRADED, reason or f"was lost; outline and silhouette agree to {shares}"
        elif status is Status.TRACKING:
            usual = agreement if self._usual is None else self._usual
            self._usual = usual + _LEVEL_RATE * (agreement - usual)
        return status, reason


def _agreement(slot: CameraSlot) -> float:
    """Harmonic mean of the shares of outline and silhouette's boundary that lie on each other, in one camera."""
    on_boundary = slot.agreement[ON_BOUNDARY] / max(slot.agreement[OUTLINE], 1.0)
    on_outline = slot.agreement[ON_OUTLINE] / max(slot.agreement[BOUNDARY], 1.0)
    return float(2.0 * on_boundary * on_outline / max(on_boundary + on_outline, 1e-9))


def _judge_cameras(
    agreement: dict[str, float], present: Sequence[str], n_cameras: int, config: ChamferConfig
) -> tuple[Status, str]:
    """A body that is well where it is seen: are there cameras that do not see it, or do not see as they should?

    A camera in whose image the body is not expected is in order, as long as two others see it.
    """
    against = [f"{camera} ({100 * share:.0f} %)" for camera, share in agreement.items() if share < config.lost_agreement]
    if against:
        return Status.DEGRADED, f"outline and silhouette do not agree in {', '.join(against)}"
    if len(present) < n_cameras:
        return Status.DEGRADED, f"{len(present)} of {n_cameras} cameras"
    if len(agreement) < min(2, n_cameras):
        return Status.DEGRADED, f"only {', '.join(agreement)} sees where the body is"
    return Status.TRACKING, ""
