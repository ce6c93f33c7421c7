"""A rigid body by its colors: alignment over the moving mask, and hypotheses where its score is too near to chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.color.alignment import PhotometricObjective, PhotometricOptions
from ...objective.color.score import ColorObjective, ColorOptions
from ...objective.constraints.prior import Prior
from ...optimize.alignment import align
from ...optimize.fitter import Fit
from ...optimize.robust_fit import RobustFitOptions, align_robustly
from ...optimize.robust_start import RobustStartOptions
from ...parallel import Workers
from ..config import ColorConfig
from ..limbs.tree import Limb
from ..modality import Images
from .modality import ColorModality, ColorScores
from .search import AlignmentSearch, ColorSearch, ended


class RigidScores(ColorScores):
    """What compares the colors of a rigid body over its mask: a score, and least squares on a pyramid (`ColorScores`)."""

    def __init__(self, model: ArticulatedModel, rig: CameraRig, config: ColorConfig, workers: Workers):
        what = config.representation, config.normalized_weight
        self.score = ColorObjective(model, rig, ColorOptions(*what, gained=config.fit_gain), workers=workers)
        options = PhotometricOptions(*what, levels=config.levels, gained=config.fit_gain)
        self.pyramid = PhotometricObjective(model, rig, options, workers=workers)
        self.blind = True

    def set_colors(self, learned: np.ndarray | None, rgb: np.ndarray) -> None:
        """Take the learned colors."""
        self.score.set_colors(learned)
        self.pyramid.set_colors(learned)

    def set_images(self, images: Images, expected: State | None) -> None:
        """Take the images of a set."""
        self.blind = all(image is None for image in images)
        self.score.set_images(images)
        self.pyramid.set_images(images)


class RigidSearch(ColorSearch):
    """The `ColorSearch` of a body without joints; it has no parts to hide behind others, and no angles that nobody sees."""

    def __init__(self, model: ArticulatedModel, config: ColorConfig, modality: ColorModality, scores: RigidScores):
        self._model, self._config, self._scores = model, config, scores
        self._blind = AlignmentSearch(model, config, modality)

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
            found = align_robustly(scores.score, scores.pyramid, start, chain, RobustFitOptions(search=around))
            result = replace(found.best, evaluations=found.evaluations)
        return ended(result, scores.pyramid.at_level(0))

    def find_limb(self, limb: Limb, around: State, rng: np.random.Generator) -> State:
        """There is none."""
        return around
