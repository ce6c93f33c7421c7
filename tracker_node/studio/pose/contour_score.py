"""How well the contours of a pose agree with the images of one instant: what the engine of regions would say of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.lines.objective import PartEvidence, RegionObjective, View
from ...observation.chamfer.observer import checked_plates
from ...observation.region.background import EmptyRoom
from ...observation.region.colors import RegionColors, color_classes, stated_densities, trust_stated_colors
from ...parallel import Workers
from ...render.raycast.raycaster import render_labels
from ...render.shape_arrays import ShapeArrays
from ...tracking.config import TrackerConfig
from ...tracking.region.engine import region_options
from .score import CameraScore, PoseScore

_LEAST_OUTLINE = 10  # samples of the outline of which a camera says something


class ContourScore:
    """Scores poses of one body in the images of one rig.

    Colors are learnt in the very pose that is scored, as an engine does that is started there, so a pose has one score, whatever
    was looked at before. Lines are drawn at the finest scale of the tracker's, whose parameters hold.

    Parameters
    ----------
    plates : images (h, w, 3) of the empty scene by camera, in the size of the rig's images.
    """

    name = "outline found"
    meaning = "share of the body's outline that lies on a change of colors, as the engine of contours looks for it"

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, plates: Mapping[str, np.ndarray]):
        self._rig, self._model, self._config = rig, model, config
        self._classes = color_classes(model)
        self._stated = stated_densities(model, self._classes)
        self._parallel = Workers(config.threads).map
        self._objective = RegionObjective(
            rig, model, ShapeArrays.from_model(model), self._classes, region_options(config), self._parallel
        )
        self._rooms, background = [], config.background
        for camera in rig:
            known = checked_plates(camera.name, camera.model.width, camera.model.height, plates.get(camera.name))
            self._rooms.append(EmptyRoom(known, background.sigma, background.learning_rate, background.body_margin_px))

    def score(self, state: State, images: Mapping[str, np.ndarray]) -> PoseScore:
        """Of a state in images (h, w, 3) uint8 BGR by camera; cameras without one say nothing."""
        close_px = self._config.region.inlier_px
        self._objective.set_views(self._views(state, images))
        self._objective.correspond(state, 1.0)
        return self._scored(self._objective.part_evidence(state, close_px))

    def _views(self, state: State, images: Mapping[str, np.ndarray]) -> list[View | None]:
        body, region = Configuration(self._model, state), self._config.region

        def learn(i: int) -> RegionColors | None:
            colors, camera = RegionColors(self._classes, self._stated, region.color_prior), self._rig.cameras[i]
            found = render_labels(body, camera, region.background_ring_px)
            if found is None or camera.name not in images:
                return None
            colors.learn(images[camera.name], *found, 1.0, region.margin_px, region.background_ring_px)
            return colors

        learnt = self._parallel(learn, list(range(len(self._rig))))
        trust_stated_colors([colors for colors in learnt if colors is not None])
        return [
            None if colors is None else View(images[camera.name], (colors.body, colors.scene), room.packed)
            for camera, colors, room in zip(self._rig, learnt, self._rooms, strict=True)
        ]

    def _scored(self, evidence: PartEvidence) -> PoseScore:
        expected, close = evidence.expected, evidence.close
        cameras = tuple(
            CameraScore(camera.name, _share(close[i].sum(), expected[i].sum()), int(expected[i].sum()))
            for i, camera in enumerate(self._rig)
        )
        parts = tuple(map(_share, close.sum(axis=0), expected.sum(axis=0)))
        return PoseScore(_share(close.sum(), expected.sum()), cameras, parts)


def _share(close: float, expected: float) -> float | None:
    return float(close / expected) if expected >= _LEAST_OUTLINE else None
