"""Assessment of fits to colors: by how far colors agree, against what they would by chance.

What agreements say of lost limbs is a logistic regression (see `benchmark/trust/color_trust.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, configured
from ...model.shapes.primitives import Ellipsoid, Primitive, TruncatedCone
from ...objective.points.photometry import SurfaceCorrespondences
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ...render.shape_arrays import bounding_spheres
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..config import ColorOverBackgroundConfig
from ..engine import Judge
from ..estimate import LimbReport, LimbStatus, Status
from ..limbs.judge import known_m
from ..limbs.tree import limbs_of, thing_size
from ..uncertainty.covariance import ImageEvidence, fit_covariance, limits_information
from ..uncertainty.modes import point_sigma
from .agreement import ColorAgreement
from .modality import ColorModality

_NOISE = 0.1  # agreement that a body has anywhere

MEASURES = ("agreement of the body in its median camera", "agreement of the limb", "agreement of its worst part")
COEFFICIENTS = np.array([4.8, -2.0, -3.5, -3.8])  # log odds of lost: the constant, and what each measure adds
LOST, _DOUBTFUL = 0.65, 0.3  # probabilities from which a limb is LOST and DEGRADED
# Parts of a body with joints are pixels off, where images have no slope. There squares grow with the distance, not its square
# as least squares have it: variances grow with the square of the share of colors that does not agree, and at this one are those
# of the residuals.
_DISAGREEMENT, _LEAST_DISAGREEMENT = 0.066, 0.03
_ROLL = 0.1  # what counts of the turn of a round part about its axis: that is told by its shading, in lights that nobody knows
_SHIFT_PX = 0.07  # of a body in all images alike, along either axis: light from above may lift it


class ColorLimbs:
    """How probable it is that each limb is elsewhere, by the colors of one image set.

    Attributes
    ----------
    limbs : the trunk first.
    jointed : whether the body has joints.
    shares : (n_limbs, n_measures) `MEASURES` of the last set; nan of a limb that is not seen.
    """

    def __init__(self, model: ArticulatedModel):
        self.limbs = limbs_of(model)
        self._model, self.jointed = model, len(model.chain.axes) > 0
        self._axes = _axes_of(model)
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
        certain = probability if not self.jointed else min(probability, _probability(shares[[0, 1, 1]]))
        status = LimbStatus.LOST if certain >= LOST else LimbStatus.DEGRADED
        return LimbReport(name, status, f"colors agree to {100 * max(float(shares[1:].min()), 0.0):.0f} %", probability)

    def covariance(
        self, normal: np.ndarray, variance: float, agreement: ColorAgreement, limbs: Sequence[LimbReport], body: Configuration
    ) -> tuple[np.ndarray, np.ndarray]:
        """Covariance by the images and the limits of joints: images say nothing of limbs that are elsewhere, or hidden.

        Parameters
        ----------
        normal : (n_links, 6, 6) information on the links' twists, in the unit of squared residuals.
        variance : of a residual.
        agreement, limbs : of the body's parts, and assessed by it.
        body : the model in the fitted state.

        Returns
        -------
        (n_dof, n_dof), and what of it is of second order.
        """
        chain, weights, normal = self._model.chain, np.ones(self._model.n_dof), normal.copy()
        for axis in self._axes:
            axis.weaken(normal, body)
        for limb, report in zip(self.limbs, limbs, strict=True):
            share = max(1.0 - agreement.of(limb.shapes), _LEAST_DISAGREEMENT)
            normal[limb.links] /= variance * (share / _DISAGREEMENT) ** 2
            if limb is not self.limbs[0] and report.status in (LimbStatus.LOST, LimbStatus.UNSEEN):
                weights[limb.dofs] = 0.0
        J = np.where(chain.link_moved_by[:, :, None], body.twists, 0.0)  # (n_links, n_dof, 6)
        H = (J @ normal @ np.swapaxes(J, 1, 2)).sum(axis=0)
        images = ImageEvidence(H, H, normal).weighted(weights, chain.link_moved_by)
        return fit_covariance(images.information + np.diag(limits_information(chain, np.ones(len(H)))), images, body)


@dataclass(frozen=True, eq=False)
class _Axis:
    """Of a round part: the ``link`` that it is on, a ``point`` (3,) of it and the ``direction`` (3,) in that link."""

    link: int
    point: np.ndarray
    direction: np.ndarray

    def weaken(self, normal: np.ndarray, body: Configuration) -> None:
        """Take from the information ``normal`` (n_links, 6, 6) what is about the turn around the axis, but for a trace."""
        T, own = body.Ts_world_link[self.link], normal[self.link]
        direction = T[:3, :3] @ self.direction
        twist = np.concatenate([np.cross(se3.apply(T, self.point), direction), direction])
        told = own @ twist
        whole = float(twist @ told)
        if whole > 0.0:
            own -= (1.0 - _ROLL) / whole * np.outer(told, told)


def _axes_of(model: ArticulatedModel) -> tuple[_Axis, ...]:
    """Of the largest part of each link, where that is round."""
    sizes, found = bounding_spheres(model)[:, 3], []
    for link in range(len(model.chain.links)):
        own = np.flatnonzero(model.shape_links == link)
        shape = own[np.argmax(sizes[own])] if len(own) else None
        along = None if shape is None else _along(model.shapes[shape].primitive)
        if along is not None:
            T = model.Ts_link_shape[shape]
            found.append(_Axis(link, T[:3, 3], T[:3, along]))
    return tuple(found)


def _along(primitive: Primitive) -> int | None:
    """Index of the axis of a round primitive; None of others."""
    if isinstance(primitive, Ellipsoid):
        return int(np.argmax(primitive.radii))
    return 2 if isinstance(primitive, TruncatedCone) else None


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
        self._known_m = known_m(model)
        self._reports: tuple[LimbReport, ...] = ()

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Assess the whole body, and its limbs."""
        agreement = self._modality.agreement(fit.state)
        found = assess_colors(agreement, self._model, self._rig, image_set.cameras, self._config)
        if self.limbs is None:
            return found
        found = with_limbs(found, self.limbs.reports(agreement))
        self._reports = found.limbs
        if found.status is Status.TRACKING and fit.modes is not None:
            size = thing_size(self._model)
            sigma_m = point_sigma(self._model, size, fit.state, self._covariance(fit, agreement)[0], by_texture=True)
            if sigma_m > self._known_m:
                found = replace(found, status=Status.DEGRADED, reason=f"{found.limbs[0].name} is known to {1e3 * sigma_m:.0f} mm")
        return found

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals in gray levels, samples in pixels of the mask."""
        agreement = self._modality.agreement(fit.state)
        pixels = [own.sum() for own in agreement.pixels]
        cameras = camera_reports(self._rig, image_set, agreement.camera_rms, pixels)
        if self.limbs is None or not self._reports:
            return Report(cameras, agreement.rms, inverse_covariance(fit.equations.H, self._modality.variance(fit.state)))
        covariance, second_order = self._covariance(fit, agreement)
        return Report(cameras, agreement.rms, covariance, second_order=second_order)

    def _covariance(self, fit: Fit, agreement: ColorAgreement) -> tuple[np.ndarray, np.ndarray | None]:
        """(n_dof, n_dof) of a fit, and what of it is of second order or beside it, (n_dof, n_dof).

        Priors hold the fit near the prediction, which errs as the images do: they do not count.
        """
        assert self.limbs is not None
        variance, points, second_order = self._modality.variance(fit.state), fit.correspondences, None
        if not self.limbs.jointed:
            covariance = inverse_covariance(points.linearize(fit.state).H, variance)
        else:
            assert isinstance(points, SurfaceCorrespondences)
            normal, body = points.link_information(fit.state), configured(self._model, fit.state)
            covariance, second_order = self.limbs.covariance(normal, variance, agreement, self._reports, body)
        shift = _common_shift(self._rig, fit.state.T_world_root[:3, 3])
        covariance[:3, :3] += shift @ shift.T
        if fit.modes is not None:
            second_order = fit.modes @ fit.modes.T
            covariance += second_order
        return covariance, second_order


def _common_shift(rig: CameraRig, place: np.ndarray) -> np.ndarray:
    """(3, 2) meters, world: how far a body at ``place`` (3,) goes when all images show it shifted along either of their axes."""
    moved = np.zeros((3, 2))
    for camera in rig:
        R, depth = camera.T_cam_world[:3, :3], float(camera.T_cam_world[2, :3] @ place + camera.T_cam_world[2, 3])
        moved += _SHIFT_PX * depth / len(rig) * R[:2].T / camera.model.params[:2]
    return moved


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
