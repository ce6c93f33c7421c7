"""Contours by the colors on either side of them: lines for the joint fit of bodies and rigs, without plates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.lines import table
from ...objective.lines.correspondences import LineCorrespondences, LineDrawer, View
from ...objective.shape_jacobian import ContourLines, normalized
from ...observation.image_set import ImageSet
from ...observation.region.background import EmptyRoom
from ...observation.region.colors import RegionColors, color_classes, stated_densities
from ...render.contour.samples import SHAPE
from ...render.raycast.raycaster import render_labels
from ...render.shape_arrays import ShapeArrays
from ...tracking.config import TrackerConfig
from ...tracking.region.modality import line_options
from .lines import joined

_LEAST_REGION_PX = 8  # a body of which less is in view is not looked for


class RegionEvidence:
    """Contours where colors change from those of the body to those of its surroundings.

    Colors are learnt in all image sets together, one camera at a time, so that a limb that is off in one set does not spoil them.

    Parameters
    ----------
    plates : images of the empty scene, where there are some, as for the tracker.
    """

    def __init__(
        self,
        sets: Sequence[ImageSet],
        config: TrackerConfig,
        plates: Mapping[str, np.ndarray | list] | None = None,
    ):
        self._sets, self._config, self._region = list(sets), config, config.region
        self._plates = dict(plates or {})
        self._seen: list[tuple[RegionColors, EmptyRoom]] = []
        self._drawer: tuple[ArticulatedModel, CameraRig, LineDrawer] | None = None
        self._scale, self._model_sigma_px = 1.0, 0.5

    def look(self, model: ArticulatedModel, rig: CameraRig, states: Sequence[Sequence[State]], robust_px: float) -> None:
        region, classes = self._region, color_classes(model)
        stated = stated_densities(model, classes)
        self._scale, self._model_sigma_px = max(1.0, robust_px / 3.0), robust_px / 6.0

        def learn(i: int) -> tuple[RegionColors, EmptyRoom]:
            colors, camera, seen = RegionColors(classes, stated, region.color_prior), rig.cameras[i], 0
            room = self._empty_room(camera.name)
            for k, images in enumerate(self._sets):
                image = images.get(camera.name)
                found = (
                    None
                    if image is None
                    else render_labels(Configuration(model, states[k][i]), camera, region.background_ring_px)
                )
                if image is not None and found is not None and min(found[1].shape) >= _LEAST_REGION_PX:
                    seen += 1
                    colors.learn(image.bgr, *found, 1.0 / seen, region.margin_px, region.background_ring_px)
                    if self._region.learn_background and len(self._sets) > 1:
                        room.learn(image.bgr, *found)
            return colors, room

        self._seen = [learn(i) for i in range(len(rig))]

    def _empty_room(self, camera: str) -> EmptyRoom:
        plate, background = self._plates.get(camera), self._config.background
        plates = [] if plate is None else [plate] if isinstance(plate, np.ndarray) else list(plate)
        return EmptyRoom(plates, background.sigma, background.learning_rate, background.body_margin_px)

    def lines(self, index: int, model: ArticulatedModel, rig: CameraRig, states: Sequence[State]) -> ContourLines:
        if self._drawer is None or self._drawer[0] is not model or self._drawer[1] is not rig:
            self._drawer = model, rig, self._make(model, rig)
        drawer, images = self._drawer[2], self._sets[index]
        views: list[View | None] = []
        for camera, (colors, room) in zip(rig, self._seen, strict=True):
            image = images.get(camera.name)
            if image is None or not colors.knows:
                views.append(None)
            else:
                views.append(View(image.bgr, (colors.body, colors.scene), room.packed))
        offsets = [state.difference(states[0]) if state is not states[0] else None for state in states]
        found = drawer.draw(views, states[0], self._scale, self._config.region.model_sigma_px, offsets)
        return joined([self._lines(i, model, found) for i in found.active])

    def _make(self, model: ArticulatedModel, rig: CameraRig) -> LineDrawer:
        return LineDrawer(rig, model, ShapeArrays.from_model(model, caps=False), color_classes(model), line_options(self._config))

    def _lines(self, camera: int, model: ArticulatedModel, drawn: LineCorrespondences) -> ContourLines:
        own = drawn.cameras[camera]
        assert own is not None
        keep = np.flatnonzero(own.lines[:, table.PRECISION] > 0.0)
        lines, shapes = own.lines[keep], own.info[keep, SHAPE].astype(np.int64)
        points = np.empty((len(keep), 3))
        for k in np.unique(shapes):
            own, T = shapes == k, model.Ts_link_shape[k]
            in_link = lines[own, table.POINT : table.POINT + 3]
            points[own] = normalized(model.shapes[k].primitive, (in_link - T[:3, 3]) @ T[:3, :3])
        variances = 1.0 / lines[:, table.PRECISION] + self._model_sigma_px**2 + (0.5 * self._scale) ** 2 / 3.0
        return ContourLines(
            np.full(len(keep), camera), shapes, points, lines[:, table.LINE_U : table.LINE_V + 1].copy(),
            lines[:, table.LINE_NU : table.LINE_NV + 1].copy(), lines[:, table.MEAN].copy(), variances,
        )  # fmt: skip
