"""Assessment of fits to contours: how far outline and silhouette agree, residuals by camera, covariance."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...objective import contour_residual as kernel
from ...objective.chamfer.correspondences import (
    BOUNDARY,
    ON_BOUNDARY,
    ON_OUTLINE,
    OUTLINE,
    CameraResiduals,
    ContourCorrespondences,
)
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..config import ChamferConfig
from ..engine import Judge
from ..estimate import Status
from .modality import ChamferModality

_NOISE = 0.15  # agreement below this is that of noise: a body that is merely off has more
_LEAST_SAMPLES = 20
_AS_BEFORE = 0.93  # fraction of the agreement of before a loss, from which a body is where it was
_RUNNING = 3  # image sets of such agreement in a row
_FORGIVING = 0.002  # the same of a body that was lost, while it does not agree as before
_LEVEL_RATE = 0.1  # weight of the newest image set in the agreement that is usual


class ChamferJudge(Judge):
    """Assesses fits of one body.

    Parameters
    ----------
    rig, config : as for the `Tracker`.
    modality : has the observations of the present set.
    """

    def __init__(self, rig: CameraRig, config: ChamferConfig, modality: ChamferModality):
        self._rig, self._config, self._modality = rig, config, modality
        self.restart()

    def reset(self) -> None:
        """How well contours agree is not known yet."""
        self.restart()

    def restart(self) -> None:
        """A state has been handed over; how well contours agree there is not known yet."""
        self._recovery = Recovery()

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """By how far outline and silhouette agree.

        The median camera decides (of an even number the better): half of the cameras may be covered before a body is called lost,
        and one that agrees by chance does not make it found.
        """
        contours, config = fit.correspondences, self._config
        assert isinstance(contours, ContourCorrespondences)
        counts = contours.agreement(fit.state, config.agreement_px, config.agreement_m)
        agreement = {
            o.camera: 0.0 if o.empty else agreement_of(own)
            for o, own in zip(self._modality.observations, counts, strict=True)
            if o is not None
        }
        if all(o is None or o.empty for o in self._modality.observations):
            reason = "no camera sees anything like the body where it is expected"
            return Assessment(*self._recovery.update(Status.LOST, reason, 0.0), noise=True)
        median = sorted(agreement.values())[len(agreement) // 2]
        status, reason = self._status(contours.residuals(fit.state), agreement, median, image_set)
        return Assessment(*self._recovery.update(status, reason, median), noise=median < _NOISE)

    def _status(
        self, residuals: list[CameraResiduals | None], agreement: dict[str, float], median: float, image_set: ImageSet
    ) -> tuple[Status, str]:
        config, stats = self._config, _total(residuals)
        residual = _rms(stats)
        if stats[kernel.COUNT] < _LEAST_SAMPLES:
            return Status.LOST, f"only {int(stats[kernel.COUNT])} contour samples find a boundary"
        metrics = f"residual {residual:.1f} px, outline and silhouette agree to {100 * median:.0f} %"
        if residual > config.lost_residual_px or median < config.lost_agreement:
            return Status.LOST, metrics
        if residual > config.degraded_residual_px or median < config.degraded_agreement:
            return Status.DEGRADED, metrics
        return assess_cameras(
            agreement, config.lost_agreement, image_set.cameras, len(self._rig), "outline and silhouette do not agree",
            "where the body is",
        )  # fmt: skip

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Distances of contour samples, pixels, and the covariance.

        The covariance is the inverse of the normal equations, which hold ``chamfer.residual_sigma_px`` and
        ``chamfer.correlation``; larger where the residuals are.
        """
        contours = fit.correspondences
        assert isinstance(contours, ContourCorrespondences)
        residuals = contours.residuals(fit.state)
        stats = [np.zeros(kernel.N_STATISTICS) if own is None else own.stats for own in residuals]
        cameras = camera_reports(self._rig, image_set, [_rms(own) for own in stats], [own[kernel.COUNT] for own in stats])
        rms = _rms(_total(residuals))
        variance = max(rms / self._config.residual_sigma_px, 1.0) ** 2
        return Report(cameras, rms, inverse_covariance(fit.equations.H, variance))


class Recovery:
    """After a loss a body is TRACKING again only once outline and silhouette agree as they did before it.

    A silhouette is found from farther away than a body: of one that lies beside it, or on another thing, much agrees as well.
    """

    def __init__(self) -> None:
        self._usual: float | None = None
        self._missing = 0  # image sets of good agreement that are still needed

    def update(self, status: Status, reason: str, agreement: float) -> tuple[Status, str]:
        """Status in the light of the image sets before.

        Parameters
        ----------
        status, reason : of this image set alone.
        agreement : of outline and silhouette in it, 0 to 1.

        Returns
        -------
        Status and reason.
        """
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


def agreement_of(counts: np.ndarray) -> float:
    """Harmonic mean of the shares of outline and silhouette's boundary that lie on each other; ``counts`` (`N_AGREEMENT`,)."""
    on_boundary = counts[ON_BOUNDARY] / max(counts[OUTLINE], 1.0)
    on_outline = counts[ON_OUTLINE] / max(counts[BOUNDARY], 1.0)
    return float(2.0 * on_boundary * on_outline / max(on_boundary + on_outline, 1e-9))


def _total(residuals: list[CameraResiduals | None]) -> np.ndarray:
    return sum((own.stats for own in residuals if own is not None), np.zeros(kernel.N_STATISTICS))


def _rms(stats: np.ndarray) -> float:
    return float(np.sqrt(stats[kernel.SQUARES] / stats[kernel.WEIGHT])) if stats[kernel.WEIGHT] > 0 else 0.0
