"""Assessment of fits to colors: by how far colors agree, against what they would by chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..config import ColorOverBackgroundConfig
from ..engine import Judge
from ..estimate import Status
from .agreement import ColorAgreement
from .modality import ColorModality

_NOISE = 0.1  # agreement that a body has anywhere


class ColorJudge(Judge):
    """Assesses fits of one body; the median camera decides, and cameras and parts that do not agree are named.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    modality : has the present images.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: ColorOverBackgroundConfig, modality: ColorModality):
        self._rig, self._model, self._config, self._modality = rig, model, config, modality

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Assess the whole body."""
        return assess_colors(self._modality.agreement(fit.state), self._model, self._rig, image_set.cameras, self._config)

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals in gray levels, samples in pixels of the mask."""
        agreement = self._modality.agreement(fit.state)
        pixels = [own.sum() for own in agreement.pixels]
        cameras = camera_reports(self._rig, image_set, agreement.camera_rms, pixels)
        covariance = inverse_covariance(fit.equations.H, self._modality.variance(fit.state))
        return Report(cameras, agreement.rms, covariance)


def assess_colors(
    agreement: ColorAgreement, model: ArticulatedModel, rig: CameraRig, present: Sequence[str], config: ColorOverBackgroundConfig
) -> Assessment:
    """Status by colors.

    Parameters
    ----------
    agreement : of the fitted state.
    model, rig : name the parts and cameras.
    present : cameras that gave an image.
    config : thresholds.

    Returns
    -------
    Of the whole body.
    """
    pixels, median = int(agreement.pixels.sum()), agreement.median
    if pixels < config.min_pixels:
        few = "no camera sees where the body is expected" if pixels == 0 else f"the body covers only {pixels} pixels"
        return Assessment(Status.LOST, few, noise=True)
    metrics = f"colors differ by {agreement.rms:.0f} gray levels, and agree to {100 * median:.0f} %"
    if median < config.lost_agreement:
        return Assessment(Status.LOST, metrics, noise=median < _NOISE)
    if median < config.degraded_agreement:
        return Assessment(Status.DEGRADED, metrics)
    cameras = {name: float(s) for name, s in zip(rig.names, agreement.cameras, strict=True) if np.isfinite(s)}
    status, reason = assess_cameras(cameras, config.lost_agreement, present, len(rig), "colors do not agree", "where the body is")
    if status is not Status.TRACKING:
        return Assessment(status, reason)
    parts = zip(model.shapes, agreement.parts, strict=True)
    against = [f"{shape.name} ({100 * max(s, 0.0):.0f} %)" for shape, s in parts if s < config.lost_agreement]
    if against:
        return Assessment(Status.DEGRADED, f"colors do not agree of {', '.join(against)}")
    if pixels < config.few_pixels:
        return Assessment(Status.DEGRADED, f"the body covers only {pixels} pixels")
    return Assessment(Status.TRACKING, "")
