"""Contour lines for the joint fit of bodies and rigs: by the colors on either side of contours, or by silhouettes and edges."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.chamfer.correspondences import ContourOptions
from ...objective.contour_residual import read_samples
from ...objective.lines import table
from ...objective.lines.correspondences import LineCorrespondences, LineDrawer
from ...objective.per_camera import SeenSamples, samples_seen
from ...objective.shape_jacobian import ContourLines, normalized
from ...observation.chamfer.observer import Observation
from ...observation.image_set import ImageSet
from ...observation.region.colors import color_classes
from ...parallel import serial
from ...render.contour import samples as cs
from ...render.contour.generators import P
from ...render.occluders import Occluders
from ...render.shape_arrays import ShapeArrays
from ...tracking.chamfer.modality import ChamferModality
from ...tracking.config import TrackerConfig
from ...tracking.region.appearance import RegionAppearance
from ...tracking.region.modality import line_options


class LineEvidence(ABC):
    """Image sets, and the contour lines of a body in them.

    Parameters
    ----------
    sets, config : images; how they are processed.
    backgrounds : images of the empty scene, where there are some, as for the tracker.
    """

    def __init__(
        self, sets: Sequence[ImageSet], config: TrackerConfig, backgrounds: Mapping[str, np.ndarray | list] | None = None
    ):
        self._sets, self._config, self._backgrounds = list(sets), config, dict(backgrounds or {})

    def _images(self, index: int, rig: CameraRig) -> list[np.ndarray | None]:
        images = [self._sets[index].get(camera.name) for camera in rig]
        return [None if image is None else image.bgr for image in images]

    def _alone(self, index: int, rig: CameraRig, camera: int) -> list[np.ndarray | None]:
        image = self._sets[index].get(rig.cameras[camera].name)
        return [image.bgr if i == camera and image is not None else None for i in range(len(rig))]

    @abstractmethod
    def look(self, model: ArticulatedModel, rig: CameraRig, states: Sequence[Sequence[State]], robust_px: float) -> None:
        """Observe the image sets around the body.

        Parameters
        ----------
        model : the body.
        rig : the cameras.
        states : per set, where each camera sees the body, roughly.
        robust_px : by about how much they are off.
        """

    @abstractmethod
    def lines(self, index: int, model: ArticulatedModel, rig: CameraRig, states: Sequence[State]) -> ContourLines:
        """Draw the lines of one image set.

        Parameters
        ----------
        index : of the set.
        model : the body.
        rig : the cameras.
        states : where camera i sees the body; lines are drawn at its contours.

        Returns
        -------
        Lines of all cameras.
        """


def _on_shapes(model: ArticulatedModel, Ts: np.ndarray, shapes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) of ``shapes`` (n,), whose frames are ``Ts`` (n_shapes, 4, 4), as `objective.shape_jacobian.normalized`."""
    result = np.empty_like(points)
    for k in np.unique(shapes):
        own = shapes == k
        result[own] = normalized(model.shapes[k].primitive, (points[own] - Ts[k, :3, 3]) @ Ts[k, :3, :3])
    return result


class SilhouetteEvidence(LineEvidence):
    """Contours where silhouettes have their boundary, and, of parts in front of others, where the image has edges.

    Every image set is processed by itself: the colors of body and scene are learned in it, around the body. For gray images, of
    which the colors tell little.
    """

    _seen: list[list[Observation | None]]

    def look(self, model: ArticulatedModel, rig: CameraRig, states: Sequence[Sequence[State]], robust_px: float) -> None:
        """Distances to silhouettes and edges, which reach as far as they do in tracking."""
        modality = ChamferModality(rig, model, self._config, self._backgrounds, serial)

        def look(k: int, i: int) -> Observation | None:
            image, state = self._alone(k, rig, i), states[k][i]
            modality.learn_first(image, state, self._config.background.body_margin_px)
            modality.set_images(image, state)
            seen = modality.observations[i]
            return None if seen is None or seen.empty else seen

        self._seen = [[look(k, i) for i in range(len(rig))] for k in range(len(self._sets))]

    def lines(self, index: int, model: ArticulatedModel, rig: CameraRig, states: Sequence[State]) -> ContourLines:
        """To the silhouette for the outline, and to edges within it."""
        arrays, n_samples, drawn = ShapeArrays.from_model(model, caps=False), self._config.chamfer.samples_per_line, []
        for i, seen in enumerate(self._seen[index]):
            if seen is not None:
                body = Configuration(model, states[i])
                drawn.append(self._read(i, body, samples_seen(body, arrays, rig.cameras[i], n_samples), seen))
        return joined(drawn)

    def _read(self, camera: int, body: Configuration, samples: SeenSamples, seen: Observation) -> ContourLines:
        outer, at = samples.info[:, cs.CLASS] == cs.OUTER, samples.pixels[:, [cs.U, cs.V, cs.NU, cs.NV]]
        at[:, :2] -= seen.region[:2]
        options = ContourOptions(inner_weight=self._config.chamfer.inner_weight, alignment=self._config.chamfer.min_alignment)
        read = read_samples(seen.silhouette_distance, seen.edge_distance, at, outer, options.packed())
        keep = np.flatnonzero(read[:, 0])
        offsets, slopes, weights = read[keep, 1], read[keep, 2:4], read[keep, 4]
        normals = slopes / np.linalg.norm(slopes, axis=1)[:, None]
        signs = np.where(np.sum(normals * at[keep, 2:], axis=1) < 0.0, -1.0, 1.0)  # edges have no side
        shapes = samples.info[keep, cs.SHAPE].astype(np.int64)
        points = _on_shapes(body.model, body.Ts_world_shape, shapes, samples.rows[keep, P : P + 3])
        return ContourLines(
            np.full(len(keep), camera), shapes, points, samples.pixels[keep, :2], signs[:, None] * normals, -signs * offsets,
            self._config.chamfer.residual_sigma_px**2 / weights,
        )  # fmt: skip


def joined(lines: Sequence[ContourLines]) -> ContourLines:
    """Lines of several cameras as one, in the order of shapes."""
    if not lines:
        none = np.zeros((0, 2))
        return ContourLines(
            np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 3)), none, none, np.zeros(0), np.ones(0)
        )
    return ContourLines(
        *(np.concatenate([getattr(x, name) for x in lines]) for name in ContourLines.__dataclass_fields__)
    ).sorted()


class RegionEvidence(LineEvidence):
    """Contours where colors change from those of the body to those of its surroundings.

    Colors are learned in all image sets together, one camera at a time, so that a limb that is off in one set does no harm.
    """

    _appearance: RegionAppearance
    _drawer: tuple[ArticulatedModel, CameraRig, LineDrawer] | None = None
    _scale, _model_sigma_px = 1.0, 0.5

    def look(self, model: ArticulatedModel, rig: CameraRig, states: Sequence[Sequence[State]], robust_px: float) -> None:
        """Colors of body and background; ``robust_px`` gives the length of the lines, and the uncertainty of the model."""
        region, nothing = self._config.region, Occluders(None, rig)
        self._scale, self._model_sigma_px = max(1.0, robust_px / 3.0), robust_px / 6.0
        self._appearance = RegionAppearance(rig, model, region, self._config.background, serial, nothing, self._backgrounds)
        all_parts = np.ones(len(model.shapes)) if len(self._sets) > 1 else None
        for i, camera in enumerate(rig):
            shown = [k for k, images in enumerate(self._sets) if images.get(camera.name) is not None]
            for n, k in enumerate(shown, 1):
                image, together = self._alone(k, rig, i), [None] * len(rig)
                self._appearance.learn(image, states[k][i], together, 1.0 / n, region.margin_px, all_parts)

    def lines(self, index: int, model: ArticulatedModel, rig: CameraRig, states: Sequence[State]) -> ContourLines:
        """With the contour's position by the colors on either side."""
        if self._drawer is None or self._drawer[0] is not model or self._drawer[1] is not rig:
            self._drawer = model, rig, self._make(model, rig)
        views = self._appearance.views(self._images(index, rig))
        offsets = [state.difference(states[0]) if state is not states[0] else None for state in states]
        found = self._drawer[2].draw(views, states[0], self._scale, self._config.region.model_sigma_px, offsets)
        return joined([self._lines(i, model, found) for i in found.active])

    def _make(self, model: ArticulatedModel, rig: CameraRig) -> LineDrawer:
        return LineDrawer(rig, model, ShapeArrays.from_model(model, caps=False), color_classes(model), line_options(self._config))

    def _lines(self, camera: int, model: ArticulatedModel, drawn: LineCorrespondences) -> ContourLines:
        own = drawn.cameras[camera]
        assert own is not None
        keep = np.flatnonzero(own.lines[:, table.PRECISION] > 0.0)
        lines, shapes = own.lines[keep], own.info[keep, cs.SHAPE].astype(np.int64)
        points = _on_shapes(model, model.Ts_link_shape, shapes, lines[:, table.POINT : table.POINT + 3])
        variances = 1.0 / lines[:, table.PRECISION] + self._model_sigma_px**2 + (0.5 * self._scale) ** 2 / 3.0
        return ContourLines(
            np.full(len(keep), camera), shapes, points, lines[:, table.LINE_U : table.LINE_V + 1].copy(),
            lines[:, table.LINE_NU : table.LINE_NV + 1].copy(), lines[:, table.MEAN].copy(), variances,
        )  # fmt: skip
