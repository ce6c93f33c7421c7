"""A body by the textures on its faces: aligned in each camera's own brightness, and searched where it is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import NormalEquations
from ...objective.points.texture import TextureLevel, TextureObjective, TextureScore
from ...observation.image_set import ImageSet
from ...optimize.alignment import AlignmentOptions, align
from ...optimize.fitter import Fit
from ...optimize.robust_fit import ReacquireOptions, reacquire
from ...optimize.robust_start import RobustStartOptions
from ...parallel import Workers
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..config import TextureConfig
from ..engine import Judge, Solver
from ..estimate import Status
from ..modality import Images, Modality, Persons
from ..motion.model import ExposureDelays
from .search import ended

_TRIED, _ALIGNED = 3, 40  # times the states of a round, all in one round; so many of them are aligned
_WIDEN, _WIDEST = 0.5, 2.0  # the search grows by this share with every set that it fails in, up to so many times


class TextureModality(Modality):
    """The `Modality` of textured boxes: nothing is learned, brightness is found anew in every image.

    Parameters
    ----------
    rig, model : as for the `Tracker`.
    config : what errors of gray levels are taken for.
    workers : threads that share states.

    Attributes
    ----------
    objective : of the present images.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TextureConfig, workers: Workers):
        self._n_cameras, self._config = len(rig), config
        self.objective = TextureObjective(model, rig, workers=workers)
        self._scores: dict[State, TextureScore] = {}  # of the present images

    def reset(self) -> None:
        """Nothing is learned."""
        self._scores.clear()

    def set_images(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, persons: Persons = ()
    ) -> None:
        """Halve the images again and again."""
        self._scores.clear()
        self.objective.set_images([None] * self._n_cameras if expected is None else images)

    def correspond(self, state: State, detail: int) -> TextureLevel:
        """Points of the textures that are seen in a state."""
        level = self.objective.at_level(detail)
        level.linearize(state)
        return level

    def score(self, state: State) -> TextureScore:
        """How far the present images show the textures; found once for each state."""
        if state not in self._scores:
            self._scores[state] = self.objective.evaluate(state)
        return self._scores[state]

    def score_of(self, state: State) -> float:
        """From 0, images show the textures as they are, to 1."""
        return self.score(state).score

    def information_of(self, state: State) -> np.ndarray:
        """(n_dof, n_dof) inverse covariance of a state by the points seen in it, on the finest level."""
        equations = self.objective.at_level(0).linearize(state)
        return (1.0 / self.variance(equations)) * equations.H

    def variance(self, equations: NormalEquations) -> float:
        """Gray levels squared of one color channel at the end of a fit, times how many neighboring points share one error."""
        rms = float(np.sqrt(equations.cost / equations.count)) if equations.count else 0.0
        return max(rms, self._config.residual_sigma) ** 2 * self._config.correlation


class TextureSolver(Solver):
    """Alignment from coarse to fine, and a search where that has not led to the body (`Solver`).

    Parameters
    ----------
    model : the body.
    config : parameters.
    modality : of the textures.
    """

    def __init__(self, model: ArticulatedModel, config: TextureConfig, modality: TextureModality):
        self._chain, self._config, self._modality = model.chain, config, modality
        self._alignment = AlignmentOptions(modality.objective.n_levels - 1, tolerance=1e-4)
        self.reset()

    def reset(self) -> None:
        """The width of the search begins anew."""
        self._lost = 0  # image sets in a row

    def remember(self, fit: Fit, assessment: Assessment) -> None:
        """The longer the body is lost, the wider it is searched."""
        self._lost = self._lost + 1 if assessment.status is Status.LOST else 0

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """Align; where the images do not agree, search."""
        objective, config = self._modality.objective, self._config
        fit = ended(align(objective, start, self._chain, self._alignment), objective.at_level(0))
        score = self._modality.score(fit.state)
        searches = config.search_states > 0 and objective.sees
        if median_agreement(score) >= config.degraded_agreement or not searches:
            return fit
        wider = min(1.0 + _WIDEN * max(self._lost - 1, 0), _WIDEST)
        radius, angle = wider * config.search_radius, wider * np.deg2rad(config.search_angle_deg)
        around = RobustStartOptions(
            radius, angle, _TRIED * config.search_states, rounds=1, keep=_ALIGNED,
            row_step=1 << (objective.n_levels - 1), seed=config.seed,
        )  # fmt: skip
        found = reacquire(objective, start, self._chain, ReacquireOptions(around, self._alignment))
        if found is None:
            return fit
        if not self._modality.score(found.state).score < score.score:
            return replace(fit, evaluations=fit.evaluations + found.evaluations)
        better = ended(found, objective.at_level(0))
        return replace(better, evaluations=fit.evaluations + found.evaluations, jumped=True)


class TextureJudge(Judge):
    """By the share of the textures' contrast that the images show, in the median camera (`Judge`).

    Parameters
    ----------
    rig : the cameras.
    config : thresholds.
    modality : of the textures.
    """

    def __init__(self, rig: CameraRig, config: TextureConfig, modality: TextureModality):
        self._rig, self._config, self._modality = rig, config, modality

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Status by the contrast of the textures that the images show."""
        score, config = self._modality.score(fit.state), self._config
        if not np.isfinite(score.score):
            return Assessment(Status.LOST, "no camera sees a texture of the body where it is expected", noise=True)
        agreement = median_agreement(score)
        metrics = f"images show {100 * agreement:.0f} % of the textures' contrast"
        if agreement < config.lost_agreement:
            return Assessment(Status.LOST, metrics, noise=True)
        if fit.jumped:
            return Assessment(Status.DEGRADED, f"found again by a search; {metrics}", jumped=True)
        if agreement < config.degraded_agreement:
            return Assessment(Status.DEGRADED, metrics)
        shares = zip(self._rig.names, 1.0 - score.camera_scores, strict=True)
        cameras = {name: float(share) for name, share in shares if np.isfinite(share)}
        return Assessment(
            *assess_cameras(
                cameras, config.lost_agreement, image_set.cameras, len(self._rig), "textures do not agree",
                "a texture of the body",
            )
        )  # fmt: skip

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals in gray levels of the textures."""
        score, equations = self._modality.score(fit.state), fit.equations
        cameras = camera_reports(self._rig, image_set, score.camera_rms, score.camera_points)
        rms = float(np.sqrt(equations.cost / equations.count)) if equations.count else 0.0
        return Report(cameras, rms, inverse_covariance(equations.H, self._modality.variance(equations)))


def median_agreement(score: TextureScore) -> float:
    """Share of the textures' contrast that the median camera shows, of an even number the better; 0 where none sees one."""
    seen = np.sort(1.0 - score.camera_scores[np.isfinite(score.camera_scores)])
    return float(seen[len(seen) // 2]) if len(seen) else 0.0
