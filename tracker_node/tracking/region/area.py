"""Poses scored by the colors that they cover, in the images of a `RegionModality`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...objective.area.limb_score import LimbScore
from ..config import TrackerConfig
from ..poses import Poses
from .modality import RegionModality

_BODY_CELLS = 90.0  # across the body, in the small images in which limbs are searched


class RegionArea:
    """Scores poses in the present images; these are shrunk when they are first asked for."""

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, region: RegionModality,
        parallel: Callable[[Callable, list], list],
    ):  # fmt: skip
        self._region = region
        classes = region.appearance.classes
        self._score = LimbScore(rig, model, classes, config.background.shadow, config.region.max_log_ratio, parallel)
        self._views: list | None = None

    def gains(self, poses: Poses, shapes: np.ndarray) -> np.ndarray:
        """Log-likelihood that the colors of all cameras gain by some parts, and the cells in which they show.

        Parameters
        ----------
        poses : n poses.
        shapes : (n_shapes,) mask of the parts; the rest of the body is where the first pose has it.

        Returns
        -------
        (n, 2)
        """
        if self._views is not self._region.views:
            self._views, state = self._region.views, poses.state(0)
            self._score.look(self._views, state, max(1, round(self._region.size_px(state) / _BODY_CELLS)))
        return self._score.totals(shapes, poses.roots, poses.joints).sum(axis=1)
