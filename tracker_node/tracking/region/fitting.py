"""Fits to correspondence lines: from coarse to fine lines, with the priors of the motion model and of the neutral pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ...objective.keypoints.correspondences import KeypointCorrespondences
from ...objective.lines.correspondences import LineCorrespondences
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ..config import TrackerConfig
from ..constraints import constraints_of, resting, staying
from ..keypoints.modality import KeypointModality
from ..modality import Modality
from ..parameters import numbers
from .modality import LineDetail, RegionModality

_SETTLED_PX = 0.7  # a step that moves no part farther is the last
_SETTLED_SIGMAS = 0.75  # or, by this, of what the model's contours are off
_DAMPING = 1e-3  # of a step, relative to the diagonal
_FINE_DAMPING = 1e-5  # the same of joints on the finest lines, which priors hold where images hardly do
_FIRST_RATE = 0.9  # weight of the first image set in how well contours fit; later ones follow at a falling rate
_USUAL_SPREAD = 0.7  # of residuals beside what they are taken to have, on rendered clips and on recorded ones
_LEAST_SHARE = 0.5  # what is left for kernels so narrow that most residuals are outliers
_ALONE = 0.05  # what lines of one camera count for beside points: see `RegionFitting.share`
_OWN_STEPS = 4  # on the finest lines, from clothes to the model's own surfaces
_PART_SCALES = (4.0, 2.0, 1.0)  # pixels from place to place on the lines by which single limbs are fitted
_PART = LevenbergMarquardtOptions(max_iterations=3, tolerance=1e-3)


@dataclass(frozen=True, eq=False)
class LineFit(Fit):
    """A fit to lines.

    Attributes
    ----------
    correspondences : the lines last drawn, at the state before the last step.
    model_sigma_px : standard deviation of contours beyond what their lines say, by this fit and those before.
    """

    correspondences: LineCorrespondences
    model_sigma_px: float = field(default=0.0, kw_only=True)


class RegionFitting:
    """How bodies are fitted to the lines of a `RegionModality`, beside which there may be another modality.

    Parameters
    ----------
    model, config : as for the `Tracker`.
    region : draws the lines.
    beside : another modality in information units, and the detail of its correspondences, which are added to the lines; None:
        there are lines alone.
    points : of a detector, which see something else than contours and count in full; None: there are none.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        config: TrackerConfig,
        region: RegionModality,
        beside: tuple[Modality, Any] | None = None,
        points: KeypointModality | None = None,
    ):
        self._model, self._config, self.region, self._beside, self._points = model, config, region, beside, points
        self._fitter = Fitter(model, constraints_of(model, config, region.others))
        self._rest, self._finest = resting(model, config.motion), numbers(config.region.scales)[-1]
        self._curvature = curvature_share(config.region.robust_sigmas)
        self._fine_damping = np.full(model.n_dof, _FINE_DAMPING)
        self._fine_damping[:N_ROOT_DOF] = _DAMPING

    @property
    def share(self) -> float:
        """What the lines count for in the fit: another modality sees the same contours.

        To one camera alone a body in wide clothes is a near one, with limbs bent towards it: there points lead all the way.
        """
        return (1.0 if self._beside is None else 0.5) * self._share_beside_points

    @property
    def _share_beside_points(self) -> float:
        has_points = self._points is not None and self._points.has_points
        return _ALONE if has_points and sum(view is not None for view in self.region.views) == 1 else 1.0

    def fit(self, start: State, scales: Sequence[float], prior: Prior | None, model_sigma_px: float) -> LineFit:
        """The body fitted to lines of these scales.

        Parameters
        ----------
        start : state to begin at.
        scales : pixels from place to place on the lines, from coarse to fine, for a body of 300 pixels.
        prior : in information units; None: the start, as `motion.stay_position` and `motion.stay_angle` say.
        model_sigma_px : standard deviation of contours beyond what their lines say, as it is taken to be.

        Returns
        -------
        The fit, with lines of the last scale.
        """
        others = [] if self._beside is None else [self._beside[0].correspond(start, self._beside[1])]
        priors = [prior or staying(start, self._config.motion), *self._resting]
        points = self.points_at(start)
        stages = self._stages(start, scales, prior, model_sigma_px)
        found = self._fitter.fit(start, self.region, stages, priors, others, points, self._share_beside_points)
        return self._as_line_fit(found, self._adapted(found, model_sigma_px))

    def fit_part(self, start: State, dofs: np.ndarray, model_sigma_px: float) -> LineFit:
        """A part of the body fitted to lines alone, without a prediction.

        Parameters
        ----------
        start : state to begin at.
        dofs : (n_dof,) mask of what moves.
        model_sigma_px : standard deviation of contours beyond what their lines say.

        Returns
        -------
        The fit, with lines of the last scale.
        """
        zoom = self.region.zoom(start)
        stages = [Stage(LineDetail(max(scale * zoom, 1.0), model_sigma_px), _PART, dofs=dofs) for scale in _PART_SCALES]
        found = self._fitter.fit(start, self.region, stages, self._resting, independent=self.points_at(start))
        return self._as_line_fit(found, model_sigma_px)

    def redrawn(self, fit: LineFit) -> LineFit:
        """The same with lines drawn anew about its state."""
        lines = self.region.correspond(fit.state, LineDetail(self._finest, fit.model_sigma_px))
        objective = fit.objective.exchanged(fit.correspondences, lines)
        return LineFit(
            fit.state, objective.linearize(fit.state), fit.iterations, fit.evaluations, fit.converged, lines, objective,
            fit.comparison, model_sigma_px=fit.model_sigma_px,
        )  # fmt: skip

    def finds_own_surfaces(self, state: State) -> bool:
        """Whether surfaces turn out to be the model's own, not a clothed body's: a fit with them leaves little."""
        beliefs = self.region.surface_filter
        own = None if beliefs is None else beliefs.rival
        if beliefs is None or own is None:
            return False
        stages = [Stage(LineDetail(self._finest, self._config.region.model_sigma_px, own))] * _OWN_STEPS
        priors = [staying(state, self._config.motion), *self._resting]
        fit = self._fitter.fit(state, self.region, stages, priors, independent=self.points_at(state))
        lines = fit.correspondences
        assert isinstance(lines, LineCorrespondences)
        spread = lines.at(fit.state).spread_px
        beliefs.compare(np.inf if spread is None else spread / self.region.size(fit.state)[1])
        return beliefs.are_own

    def points_at(self, start: State) -> list[KeypointCorrespondences]:
        """The detected points of the present set, if there are any."""
        if self._points is None or not self._points.has_points:
            return []
        return [self._points.correspond(start, 1.0)]

    @property
    def _resting(self) -> list[Prior]:
        return [self._rest] if self._rest.information.any() else []

    def _stages(self, start: State, scales: Sequence[float], prior: Prior | None, model_sigma_px: float) -> list[Stage]:
        region = self._config.region
        _, px_per_m = self.region.size(start)
        settled_m = max(_SETTLED_PX, _SETTLED_SIGMAS * model_sigma_px) / px_per_m
        zoom, stages = self.region.zoom(start), []
        # Whether residuals are as the kernel takes them. Of others, the weights' own steps, which never climb, are better
        as_taken = model_sigma_px < region.model_sigma_px
        for i, scale in enumerate(scales):
            fine, last = scale <= 1.0, i == len(scales) - 1
            free = fine and (as_taken or prior is not None)  # first fits, which may begin far off, are held back
            stages.append(
                Stage(
                    LineDetail(scale if fine else max(scale * zoom, 1.0), model_sigma_px),
                    damping=self._fine_damping if free else _DAMPING,
                    curvature=self._curvature if fine and as_taken else 1.0,
                    compares=i == 0,
                    repeats=region.repeats if last else 0,
                    settled_m=settled_m,
                )
            )
        return stages

    def _adapted(self, fit: Fit, model_sigma_px: float) -> float:
        """How well the model's contours fit, followed: weights, robustness and covariance go by it."""
        region, lines = self._config.region, fit.correspondences
        assert isinstance(lines, LineCorrespondences)
        spread = lines.at(fit.state).spread_px
        if spread is None or region.sigma_rate <= 0.0:
            return model_sigma_px
        rate = max(region.sigma_rate, _FIRST_RATE / (1.0 + self.region.n_learned))
        variance = (1.0 - rate) * model_sigma_px**2 + rate * spread**2
        return float(np.clip(np.sqrt(variance), region.least_sigma_px, region.model_sigma_px))

    @staticmethod
    def _as_line_fit(fit: Fit, model_sigma_px: float) -> LineFit:
        lines = fit.correspondences
        assert isinstance(lines, LineCorrespondences)
        return LineFit(
            fit.state, fit.equations, fit.iterations, fit.evaluations, fit.converged, lines, fit.objective, fit.comparison,
            model_sigma_px=model_sigma_px,
        )  # fmt: skip


def curvature_share(robust_sigmas: float, spread: float = _USUAL_SPREAD) -> float:
    """How steeply the gradient of robust residuals grows, as a fraction of what their weights say.

    A Gauss-Newton step takes the weights for fixed. Yet those of residuals that it makes larger fall: the gradient r w(r) of the
    Geman-McClure kernel, w = (1 + x)^-2 with x = (r / (c sigma))^2, has the slope w (1 - 3 x) / (1 + x). Steps by the weights
    alone fall short, by a quarter for residuals as wide as they are taken for and c = 3; the sum of the slopes makes them
    Newton's.

    Parameters
    ----------
    robust_sigmas : c, the kernel's scale in standard deviations that residuals are taken to have.
    spread : their own standard deviation, in the same unit.

    Returns
    -------
    Sum of the slopes over the sum of the weights, of normal residuals; 1 for a kernel that is wide.
    """
    r = np.linspace(-5.0, 5.0, 201)
    density, x = np.exp(-0.5 * r * r), (spread * r / robust_sigmas) ** 2
    weights = density / (1.0 + x) ** 2
    return max(float((weights * (1.0 - 3.0 * x) / (1.0 + x)).sum() / weights.sum()), _LEAST_SHARE)
