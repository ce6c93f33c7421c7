"""A rigid body by its colors: alignment over the moving mask, hypotheses where its score is too near to chance, and modes.

The mean over the mask does not tell a body from one that hides within its own color: a thing of one color, that one camera sees,
walks away. Where few cameras see a body, it is compared with poses beside it by what they cover (`ColorCoverage`), in colors over
intensity: light that nobody knows, and the side that it comes from, tell nothing of these. What covers as much is a mode of the
covariance, and directions in which coverage is flat make it wider; of things of one color whatever the number of cameras.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.color.alignment import PhotometricObjective, PhotometricOptions
from ...objective.color.score import ColorCoverage, ColorObjective, ColorOptions
from ...objective.constraints.prior import Prior
from ...optimize.alignment import align
from ...optimize.fitter import Fit
from ...optimize.levenberg_marquardt import OptimizerResult
from ...optimize.robust_fit import align_robustly
from ...optimize.robust_start import RobustStartOptions
from ...optimize.score_objective import ScoreObjective
from ...optimize.simplex import SimplexStage, search_simplex
from ...parallel import Workers
from ..assessment import inverse_covariance
from ..config import ColorConfig
from ..limbs.tree import Limb, thing_size
from ..modality import Images
from ..uncertainty.modes import FEW_CAMERAS, Modes, Posed
from .agreement import LEAST_CAMERA
from .modality import ColorModality, ColorScores, is_pictured
from .search import AlignmentSearch, ColorSearch, ended

_ANY_CAP = 20.0  # gray levels, until it is known how much surroundings differ
_LEAST_LEVELS, _LEAST_CONTRAST = 3.0, 3.0  # gray levels of a body's own colors; those of surroundings are so many times them
_ROW_STEP = 2
_POLISH = (SimplexStage(0.004, np.radians(1.5), 0.4, _ROW_STEP, 12),)
_POLISHED, _FIRST_POLISHED = 2, 6  # starts, of an image set
_SHARES = (0.06, 0.1, 0.2)  # of a difference in coverage that counts, by cameras: its errors are whole sides, not single pixels
_TAKEN = 3.0  # log odds of another pose against the fit
_MOVED, _FIRST_MOVED = 0.05, 0.2  # of the size, standard deviation of how far a body is from where it is expected
_WIDTHS = np.array([2.0, 4.0, 8.0, 16.0])  # standard deviations of a direction, at which it is asked how far it is flat


class RigidScores(ColorScores):
    """What compares the colors of a rigid body over its mask: a score, and least squares on a pyramid (`ColorScores`)."""

    def __init__(self, model: ArticulatedModel, rig: CameraRig, config: ColorConfig, workers: Workers):
        what = config.representation, config.normalized_weight
        self.score = ColorObjective(model, rig, ColorOptions(*what, gained=config.fit_gain), workers=workers)
        options = PhotometricOptions(*what, levels=config.levels, gained=config.fit_gain)
        self.pyramid = PhotometricObjective(model, rig, options, workers=workers)
        self.representation = "raw" if config.representation == "raw" else "normalized"
        self.covered = ColorObjective(model, rig, ColorOptions(self.representation, 1.0, cap=_ANY_CAP), workers=workers)
        self.blind = True

    def set_colors(self, learned: np.ndarray | None, rgb: np.ndarray) -> None:
        """Take the learned colors."""
        self.score.set_colors(learned)
        self.pyramid.set_colors(learned)
        self.covered.set_colors(learned)

    def set_images(self, images: Images, expected: State | None) -> None:
        """Take the images of a set."""
        self.blind = all(image is None for image in images)
        self.score.set_images(images)
        self.pyramid.set_images(images)
        self.covered.set_images(images)


@dataclass(frozen=True, eq=False)
class _Near:
    """A score, and what it costs a state to be far from where the body is expected (`ScoreObjective`)."""

    objective: ScoreObjective
    cost: Callable[[State], float]

    def score(self, state: State) -> float:
        return float(self.scores([state])[0])

    def scores(self, states: Sequence[State]) -> np.ndarray:
        return self.objective.scores(states) + np.array([self.cost(state) for state in states])

    def at_row_step(self, row_step: int) -> _Near:
        return _Near(self.objective.at_row_step(row_step), self.cost)


class ColorModes(Modes[Posed]):
    """The modes of one rigid body by what its colors cover; deterministic in the fits since the first one.

    Parameters
    ----------
    model, rig : body and cameras.
    modality, scores : have the present images.
    """

    def __init__(
        self, model: ArticulatedModel, rig: CameraRig, config: ColorConfig, modality: ColorModality, scores: RigidScores
    ):
        self._correlation, self._degraded = config.correlation, config.degraded_agreement
        self._modality, self._scores = modality, scores
        self._plain = not any(map(is_pictured, model.shapes)) and len({shape.color_rgb for shape in model.shapes}) == 1
        super().__init__(rig, model, thing_size(model), by_texture=True)

    def reset(self) -> None:
        """Nothing is followed, and the body's own colors are not known."""
        super().reset()
        self._own = np.zeros(len(self._rig))

    def look(self, fit: Fit, start: State, first: bool) -> Fit:
        """A fit with the modes beside it.

        Parameters
        ----------
        fit, start : of the present image set, and where the body was expected.
        first : of a first image set, whose start may be far off.

        Returns
        -------
        The fit, or the pose that is clearly better, with ``modes``.
        """
        if first:
            self.reset()
        n = int((self._modality.agreement(start).pixels.sum(axis=1) >= LEAST_CAMERA).sum())
        few = n <= FEW_CAMERAS
        if n == 0 or not (few or self._plain):
            self._followed = []
            return fit
        if first and few:
            if self._modality.agreement(start).median < self._degraded:
                self._modality.relight(fit.state)
            self._own = np.minimum(self._squares(fit.state), self._squares(start))
        coverage, tangents = self._coverage(start, n), None
        if coverage is None or not np.isfinite(coverage.score(fit.state)):  # it is behind all cameras
            self._followed = []
            return fit
        if few:
            fit, tangents = self._compared(fit, start, coverage, first)
        flat = self._flat(fit, coverage)
        return replace(fit, modes=flat if tangents is None else np.hstack([tangents, flat]))

    def _compared(self, fit: Fit, start: State, coverage: ColorCoverage, first: bool) -> tuple[Fit, np.ndarray | None]:
        """The fit, or what is clearly better, and the tangents to the modes beside it, (n_dof, n_modes)."""
        sigma = (_FIRST_MOVED if first else _MOVED) * self._size
        if self._modality.agreement(start).median <= self._degraded:
            sigma = np.inf  # it may be anywhere
        score = _Near(coverage, lambda state: 0.5 * self._unit * (self.moved(start, state.difference(start)) / sigma) ** 2)
        starts = [start, *self.followed(fit.state), *self.starts(fit.state), *(self.starts(start) if first else ())]
        order = np.argsort(score.at_row_step(_ROW_STEP).scores(starts), kind="stable")
        chosen = [starts[i] for i in order[: _FIRST_POLISHED if first else _POLISHED]]
        found: list[Posed] = [fit, *(search_simplex(score, each, self._model.chain, _POLISH) for each in chosen)]
        scores = score.scores([each.state for each in found])
        best = int(np.argmin(scores))
        if scores[0] - scores[best] < _TAKEN * self._unit:
            best = 0
        odds = (scores[best] - scores) / self._unit
        modes = self.beside(found[best], [(found[i], odds[i]) for i in range(len(found)) if i != best])
        if best:
            state, level = found[best].state, self._scores.pyramid.at_level(0)
            fit = ended(OptimizerResult(state, level.linearize(state), fit.iterations, fit.evaluations, True), level)
        if first:
            self._own = self._squares(fit.state)
        return fit, self.follow(fit.state, modes)

    def _squares(self, state: State) -> np.ndarray:
        """(n_cameras,) mean squared difference of a channel."""
        return self._modality.agreement_by(self._scores.representation, state).camera_rms ** 2

    def _coverage(self, start: State, n_cameras: int) -> ColorCoverage | None:
        """By how far the body's colors, at first, and those around it, where it is expected, are from those of the model.

        None where these hardly differ, as of gray things before gray walls. Cameras that see the body say it for all.
        """
        seen = self._modality.agreement_by(self._scores.representation, start)
        pixels = seen.pixels.sum(axis=1)
        seeing = pixels >= LEAST_CAMERA
        around = seen.chance.sum(axis=1) / np.maximum(3.0 * pixels, 1.0)
        self._own = np.where(self._own > 0.0, self._own, seen.camera_rms**2)
        if (around[seeing] < (_LEAST_CONTRAST * _LEAST_LEVELS) ** 2).all():
            return None
        around = np.maximum(around[seeing], (_LEAST_CONTRAST * _LEAST_LEVELS) ** 2)
        own = np.clip(self._own[seeing], _LEAST_LEVELS**2, around / _LEAST_CONTRAST**2)
        self._unit = 2.0 * float(own.mean()) * self._correlation / _SHARES[min(n_cameras, len(_SHARES)) - 1]
        # Two normal distributions of three channels are equal there
        least = 3.0 * np.log(around / own) * own / (1.0 - own / around)
        return ColorCoverage(self._scores.covered, float(least.mean()))

    def _flat(self, fit: Fit, coverage: ColorCoverage) -> np.ndarray:
        """(n_dof, n_dof) tangents along which more is covered as well than the equations of the fit say."""
        covariance = inverse_covariance(fit.correspondences.linearize(fit.state).H, self._modality.variance(fit.state))
        variance, directions = np.linalg.eigh(covariance)
        steps = np.concatenate([-_WIDTHS[::-1], [0.0], _WIDTHS])
        sigmas = np.sqrt(np.maximum(variance, 0.0))
        tangents = (steps[None, :, None] * (sigmas * directions).T[:, None, :]).reshape(-1, len(sigmas))
        scores = coverage.at_row_step(_ROW_STEP).scores([fit.state.retract(t) for t in tangents]).reshape(len(sigmas), -1)
        weights = np.exp(-np.maximum(scores - scores[:, len(_WIDTHS)][:, None], 0.0) / self._unit) * np.gradient(steps)
        more = np.maximum((weights @ steps**2) / weights.sum(axis=1) - 1.0, 0.0)
        return directions * sigmas * np.sqrt(more)


class RigidSearch(ColorSearch):
    """The `ColorSearch` of a body without joints; it has no parts to hide behind others, and no angles that nobody sees."""

    def __init__(
        self, model: ArticulatedModel, rig: CameraRig, config: ColorConfig, modality: ColorModality, scores: RigidScores
    ):
        self._model, self._config, self._scores = model, config, scores
        self._blind = AlignmentSearch(model, config, modality)
        self._modes = ColorModes(model, rig, config, modality, scores)

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> Fit:
        """Align, and search where the score is too near to chance.

        Of ``color.search_states`` a quarter is tried a round: there are several.
        """
        config, chain, scores = self._config, self._model.chain, self._scores
        if scores.blind:
            return self._blind.run(start, priors, first)
        if config.search_states == 0:
            result = align(scores.pyramid, start, chain)
        else:
            n = max(config.search_states // 4, 1)
            angle = float(np.deg2rad(config.search_angle_deg))
            around = RobustStartOptions(config.search_radius, angle, n, seed=config.seed)
            found = align_robustly(scores.score, scores.pyramid, start, chain, around)
            result = replace(found.best, evaluations=found.evaluations)
        return self._modes.look(ended(result, scores.pyramid.at_level(0)), start, first)

    def find_limb(self, limb: Limb, around: State, rng: np.random.Generator) -> State:
        """There is none."""
        return around
