"""Assessment of fits to colors: by how far colors agree, against what they would by chance.

What agreements say of lost limbs is a logistic regression (see `benchmark/trust/color_trust.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.kinematic_chain import N_ROOT_DOF
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..config import ColorOverBackgroundConfig
from ..engine import Judge
from ..estimate import LimbReport, LimbStatus, Status
from ..limbs.tree import limbs_of
from .agreement import ColorAgreement
from .modality import ColorModality

_NOISE = 0.1  # agreement that a body has anywhere

MEASURES = ("agreement of the body in its median camera", "agreement of the limb", "agreement of its worst part")
COEFFICIENTS = np.array([4.8, -2.0, -3.5, -3.8])  # log odds of lost: the constant, and what each measure adds
LOST, _DOUBTFUL = 0.65, 0.3  # probabilities from which a limb is LOST and DEGRADED
# By what squared errors of bodies with joints exceed those that colors say: lights that are not the model's turn round parts
# about their axes. A rigid body averages over its sides: 1.0.
_JOINTED = 17.5


class ColorLimbs:
    """How probable it is that each limb is elsewhere, by the colors of one image set.

    Attributes
    ----------
    shares : (n_limbs, n_measures) `MEASURES` of the last set; nan of a limb that is not seen.
    """

    def __init__(self, model: ArticulatedModel):
        self.limbs = limbs_of(model)
        self._ranges = model.chain.upper - model.chain.lower
        self.shares = np.full((len(self.limbs), len(MEASURES)), np.nan)

    def reports(self, agreement: ColorAgreement) -> tuple[LimbReport, ...]:
        """Assess the limbs, the trunk first."""
        parts = agreement.parts
        for limb, shares in zip(self.limbs, self.shares, strict=True):
            own, told = agreement.of(limb.shapes), parts[limb.shapes][np.isfinite(parts[limb.shapes])]
            median = agreement.median
            # Without a part that is not of the colors around it, nothing but the body tells where the limb is
            shares[:] = (median, own, min(own, told.min())) if len(told) else (median, median, median)
            if not np.isfinite(own):
                shares[:] = np.nan
        return tuple(map(self._report, range(len(self.limbs))))

    def _report(self, index: int) -> LimbReport:
        name, shares = self.limbs[index].name, self.shares[index]
        if np.isnan(shares).any():
            return LimbReport(name, LimbStatus.UNSEEN, "hidden, or out of the images", _DOUBTFUL)
        probability = _probability(shares)
        if probability < _DOUBTFUL:
            return LimbReport(name, LimbStatus.TRACKING, "", probability)
        # Suits are not cut where the model's parts end, and things are as their models: the worst part of a body with joints
        # makes a limb doubtful, not LOST
        certain = probability if not len(self._ranges) else min(probability, _probability(shares[[0, 1, 1]]))
        status = LimbStatus.LOST if certain >= LOST else LimbStatus.DEGRADED
        return LimbReport(name, status, f"colors agree to {100 * max(float(shares[1:].min()), 0.0):.0f} %", probability)

    def covariance(self, H: np.ndarray, variance: float, limbs: Sequence[LimbReport]) -> np.ndarray:
        """Covariance by the images and the limits of joints: images say nothing of limbs that are elsewhere, or hidden.

        Parameters
        ----------
        H : (n_dof, n_dof) Gauss-Newton matrix of the images alone.
        variance : of its residuals.
        limbs : assessed.

        Returns
        -------
        (n_dof, n_dof).
        """
        weights = np.ones(len(H))
        for limb, report in zip(self.limbs[1:], limbs[1:], strict=True):
            if report.status in (LimbStatus.LOST, LimbStatus.UNSEEN):
                weights[limb.dofs] = 0.0
        H, joints = weights[:, None] * H * weights, np.arange(N_ROOT_DOF, len(H))
        variance *= _JOINTED if len(joints) else 1.0
        H[joints, joints] += variance * 12.0 / self._ranges**2
        return inverse_covariance(H, variance)


def _probability(shares: np.ndarray) -> float:
    """That a limb with these `MEASURES` is elsewhere."""
    return float(1.0 / (1.0 + np.exp(-COEFFICIENTS[0] - COEFFICIENTS[1:] @ np.clip(shares, -1.0, 1.0))))


class ColorJudge(Judge):
    """Assesses fits of one body; the median camera decides, and cameras and parts that do not agree are named.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    modality : has the present images.
    limbs : assesses limbs one by one; None: they are not.
    """

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, config: ColorOverBackgroundConfig, modality: ColorModality,
        limbs: ColorLimbs | None = None,
    ):  # fmt: skip
        self._rig, self._model, self._config, self._modality, self.limbs = rig, model, config, modality, limbs
        self._reports: tuple[LimbReport, ...] = ()

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Assess the whole body, and its limbs."""
        agreement = self._modality.agreement(fit.state)
        found = assess_colors(agreement, self._model, self._rig, image_set.cameras, self._config)
        if self.limbs is None:
            return found
        found = with_limbs(found, self.limbs.reports(agreement))
        self._reports = found.limbs
        return found

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals in gray levels, samples in pixels of the mask."""
        agreement = self._modality.agreement(fit.state)
        pixels = [own.sum() for own in agreement.pixels]
        cameras = camera_reports(self._rig, image_set, agreement.camera_rms, pixels)
        variance = self._modality.variance(fit.state)
        if self.limbs is None or not self._reports:
            return Report(cameras, agreement.rms, inverse_covariance(fit.equations.H, variance))
        # Priors hold the fit near the prediction, which errs as the images do
        H = fit.correspondences.linearize(fit.state).H
        return Report(cameras, agreement.rms, self.limbs.covariance(H, variance, self._reports))


def with_limbs(body: Assessment, limbs: tuple[LimbReport, ...]) -> Assessment:
    """The assessment of a body with that of its limbs.

    Parameters
    ----------
    body : without limbs.
    limbs : the trunk first.

    Returns
    -------
    LOST with its trunk, and DEGRADED with a limb that is not TRACKING; the trunk is LOST with the body.
    """
    trunk = limbs[0]
    if body.status is Status.LOST and trunk.status is not LimbStatus.LOST:
        limbs = (replace(trunk, status=LimbStatus.LOST, reason=body.reason, probability=1.0), *limbs[1:])
    elif trunk.status is LimbStatus.LOST and body.status is not Status.LOST:
        body = replace(body, status=Status.LOST, reason=trunk.reason)
    against = [f"{limb.name} ({limb.reason})" for limb in limbs if limb.status is not LimbStatus.TRACKING]
    if body.status is Status.TRACKING and against:
        body = replace(body, status=Status.DEGRADED, reason=", ".join(against))
    return replace(body, limbs=limbs)


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
