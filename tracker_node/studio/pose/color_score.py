"""How well the colors of a pose agree with the images of one instant: what the engine of colors would say of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...camera.rig import CameraRig
from ...loaders.json_values import finite
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.points.photometry import PhotometryOptions
from ...tracking.color.judge import agreement_of
from ...tracking.config import TrackerConfig
from .score import CameraScore, PoseScore


class ColorScore:
    """Scores poses of a body whose parts have stated colors."""

    name = "colors agree"
    meaning = "share of the body's mask whose colors are the model's, against chance, as the engine of colors judges"

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig):
        color = config.color
        self._rig, self._painted = rig, [model] * len(rig)
        self._options = PhotometryOptions(
            color.representation, color.normalized_weight, color.levels, robust_scale=color.robust_scale
        )

    def score(self, state: State, images: Mapping[str, np.ndarray]) -> PoseScore:
        """Of a state in images (h, w, 3) uint8 BGR by camera; the total is that of the middle camera, as for the engine."""
        found = agreement_of(self._painted, self._rig, [images.get(c.name) for c in self._rig], state, self._options)
        cameras = tuple(
            CameraScore(camera.name, finite(value), int(pixels))
            for camera, value, pixels in zip(self._rig, found.cameras, found.pixels.sum(axis=1), strict=True)
        )
        total = found.middle if np.isfinite(found.cameras).any() else None
        return PoseScore(total, cameras, tuple(map(finite, found.parts)))
