"""A rigid body by its colors: alignment over the moving mask, and hypotheses where its score is not to be trusted."""

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
from ...objective.points.photometry import SurfacePhotometry
from ...optimize.alignment import align
from ...optimize.result import OptimizerResult
from ...optimize.robust_fit import RobustFitOptions, align_robustly
from ...optimize.robust_start import RobustStartOptions
from ..config import ColorConfig
from ..engine import Images
from .search import ColorSearch


class RigidSearch(ColorSearch):
    """`ColorSearch` of a body without joints; it has no parts to hide behind others, and no angles that nobody sees."""

    def __init__(self, model: ArticulatedModel, rig: CameraRig, config: ColorConfig, photometry: SurfacePhotometry, threads: int):
        self._blind = True
        what = config.representation, config.normalized_weight
        self._mask_score = ColorObjective(model, rig, ColorOptions(*what), threads=threads)
        super().__init__(model, config, photometry, self._mask_score)
        self._pyramid = PhotometricObjective(model, rig, PhotometricOptions(*what, levels=config.levels), threads=threads)

    def set_colors(self, colors_rgb: np.ndarray | None) -> None:
        """(n_cameras, n_shapes, 3), or None for those of the model."""
        self._mask_score.set_colors(colors_rgb)
        self._pyramid.set_colors(colors_rgb)

    def set_images(self, images: Images) -> None:
        """BGR images in the order of the rig; None for a camera that gave none."""
        self._blind = all(image is None for image in images)
        self._mask_score.set_images(images)
        self._pyramid.set_images(images)

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> OptimizerResult:
        """Priors are for joints, and have no part. Of ``config.search_states`` a quarter is tried a round: there are several."""
        config, chain = self._config, self._model.chain
        if self._blind:
            return super().run(start, priors, first)
        if config.search_states == 0:
            return align(self._pyramid, start, chain)
        around = RobustStartOptions(
            config.search_radius, float(np.deg2rad(config.search_angle_deg)), max(config.search_states // 4, 1), seed=config.seed
        )
        found = align_robustly(self._mask_score, self._pyramid, start, chain, RobustFitOptions(search=around))
        return replace(found.best, evaluations=found.evaluations)
