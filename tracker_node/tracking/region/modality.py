"""Regions: the colors on either side of the body's contours, by correspondence lines; needs no image of the background.

Girths and clothes of a body, followed while tracking: where the surface of each part is beside the model's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from ...camera.rig import CameraRig
from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.clothes import expected_surfaces
from ...model.configuration import Neighbor, State, configured
from ...model.humans.keypoints import relative_size
from ...objective.lines.correspondences import LineCorrespondences, LineDrawer, LineOptions, Offsets, PartEvidence, View
from ...objective.lines.surfaces import N_UNKNOWNS, Surfaces, SurfaceSums
from ...observation.region.colors import distinctness
from ...render.occluders import Occluders
from ...render.shape_arrays import ShapeArrays
from ..config import KEYPOINTS, KeypointConfig, TrackerConfig
from ..modality import Images, Modality, PartColors, Persons, cameras_in_turn
from ..motion.model import ExposureDelays
from .appearance import RegionAppearance

_BODY_PX = 300.0  # of a body whose lines are as long as stated; others have theirs with their size
_LARGE_PX = 450.0  # of a body, above which contours are close within more than `region.inlier_px`
_OWN_SIGMA_M = 0.003  # of surfaces that are the model's own, of a body of the default size
_OWN_SPREAD = 2.0  # of contours about them, in these; four to six on people in clothes and mannequins, one on the own shapes
_COMPARISONS = 6  # with them, by the first fits


@dataclass(frozen=True)
class LineDetail:
    """How lines are drawn: pixels from place to place on a line; standard deviation of contours beyond what their lines say;
    where surfaces are beside the shapes, None: as they are known."""

    scale: float
    model_sigma_px: float
    surfaces: Surfaces | None = None


def line_options(config: TrackerConfig) -> LineOptions:
    """How lines are drawn, by the parameters."""
    region = config.region
    return LineOptions(
        samples_per_line=region.samples_per_line,
        half_length=region.half_length,
        max_log_ratio=region.max_log_ratio,
        pixel_independence=region.pixel_independence,
        robust_sigmas=region.robust_sigmas,
        correlation=region.correlation,
        shadow=config.background.shadow,
    )


class RegionModality(Modality):
    """The `Modality` of regions.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    parallel : maps a function over cameras.
    occluders : what stands before the body; None: nothing does.
    backgrounds : as for the `Tracker`.

    Attributes
    ----------
    appearance : colors and background.
    views : what each camera shows.
    n_learned : image sets that have been learned from since the reset.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig,
        parallel: Callable[[Callable, list], list],
        occluders: Occluders | None = None,
        backgrounds: Mapping[str, np.ndarray | list] | None = None,
    ):
        self._occluders = occluders = occluders or Occluders(None, rig)
        self._model, self._config = model, config.region
        self.appearance = RegionAppearance(
            rig, model, config.region, config.background, parallel, occluders, backgrounds or {}, config.keypoints
        )
        self._arrays = ShapeArrays.from_model(model)
        self._drawer = LineDrawer(
            rig, model, self._arrays, self.appearance.classes, line_options(config), parallel, occluders.depths
        )
        self._surfaces = SurfaceFilter(model, config.keypoints) if KEYPOINTS in config.modalities else None
        self._along = np.array([camera.T_cam_world[2] for camera in rig])
        self._focals = [float(camera.model.params[0]) for camera in rig]
        self._delays: ExposureDelays | None = None
        self.n_learned = 0
        self.views: list[View | None] = [None] * len(rig)
        self._latest: LineCorrespondences | None = None  # lines last drawn in the present images
        self._size: tuple[State, tuple[float, float]] | None = None  # in them, in the state last asked for

    @property
    def surfaces(self) -> np.ndarray | None:
        """See `Modality.surfaces`; followed while points hold the joints."""
        return None if self._surfaces is None else self._surfaces.surfaces.means

    @property
    def surface_filter(self) -> SurfaceFilter | None:
        """Follows the surfaces; None where nothing else holds the joints."""
        return self._surfaces

    @property
    def surfaces_are_own(self) -> bool:
        """Whether contours are known to lie on the model's own shapes."""
        return self._surfaces is not None and self._surfaces.are_own

    def others(self) -> Sequence[Neighbor]:
        """Other bodies that stand about."""
        return self._occluders.others

    @property
    def colors(self) -> PartColors:
        """See `Modality.colors`."""
        return self.appearance.classes, self.appearance.colors

    @property
    def has_silhouettes(self) -> bool:
        """Whether a detector has found the body's pixels in any of the present images."""
        return any(view is not None and view.silhouette[0].size for view in self.views)

    def reset(self) -> None:
        """Only the colors that the model states, and the images of the background, are known."""
        self.appearance.reset()
        self.n_learned, self._delays = 0, None
        if self._surfaces is not None:
            self._surfaces.reset()

    def lessons(self, known: bool) -> Sequence[int]:
        """Pixels around the body that are not learned as surroundings: the first pose given is rarely exact."""
        margin = self._config.margin_px
        return (margin,) if known else (4 * margin, 2 * margin, margin)

    def learn_first(self, images: Images, state: State, lesson: int) -> None:
        """Learn the colors of body and surroundings anew."""
        self._delays = None
        self.appearance.forget_colors()
        self.appearance.learn(images, state, self._offsets(state), 1.0, lesson, None)
        self.appearance.trust_stated()

    def set_images(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, persons: Persons = ()
    ) -> None:
        """Keep the images: lines are drawn where the fit needs them."""
        self._delays, self._latest, self._size = delays, None, None
        self.views = [None] * len(images) if expected is None else self.appearance.views(images, persons)

    def correspond(self, state: State, detail: LineDetail) -> LineCorrespondences:
        """Lines of the contours that are seen in a state."""
        surfaces = detail.surfaces or (None if self._surfaces is None else self._surfaces.surfaces)
        self._latest = self._drawer.draw(self.views, state, detail.scale, detail.model_sigma_px, self._offsets(state), surfaces)
        return self._latest

    def _learn_surfaces(self, state: State, weights: np.ndarray | None) -> None:
        """Follow where surfaces are beside the shapes, by lines about a state that has been found."""
        if self._surfaces is not None and any(view is not None for view in self.views):
            sigma_px, lines = self._config.model_sigma_px, self._latest
            if lines is None or lines.drawn_at is not state or lines.scale != 1.0:
                lines = self.correspond(state, LineDetail(1.0, sigma_px))
            sums = lines.at(state).surfaces_at(sigma_px**2)
            assert sums is not None
            trusted = np.ones(len(self._model.shapes), dtype=np.bool_) if weights is None else np.asarray(weights > 0.5)
            self._surfaces.update(sums, trusted)

    def learn(self, images: Images, state: State, weights: np.ndarray | None) -> None:
        """Colors change slowly: in each image set some of the cameras learn. A camera that has joined learns all at once."""
        region, known, offsets = self._config, self.appearance.known, self._offsets(state)
        self._learn_surfaces(state, weights)
        joined = [None if knows else image for image, knows in zip(images, known, strict=True)]
        if any(image is not None for image in joined):
            self.appearance.learn(joined, state, offsets, 1.0, region.margin_px, weights)
        turn = cameras_in_turn(images, self.n_learned, region.learn_every, [image is not None for image in joined])
        self.n_learned += 1
        if region.color_rate > 0.0 and any(image is not None for image in turn):
            self.appearance.learn(turn, state, offsets, region.color_rate, region.margin_px, weights)

    def _offsets(self, state: State) -> Offsets:
        return [None] * len(self._focals) if self._delays is None else self._delays.offsets(state)

    def part_evidence(self, lines: LineCorrespondences, state: State, close_px: float) -> PartEvidence:
        """How far the outline of the body agrees with the images.

        Parameters
        ----------
        lines : of the present images.
        state : of the body.
        close_px : a contour within this is close, on a body of up to 450 pixels; what the model leaves out, clothes mostly, is so
            many pixels larger on a larger one.

        Returns
        -------
        By camera and part.
        """
        size_m, px_per_m = self.size(state)
        return lines.at(state).part_evidence(close_px * max(size_m * px_per_m / _LARGE_PX, 1.0))

    def distinctness(self, shapes: np.ndarray) -> float:
        """How well the colors of some parts, (n_shapes,) mask, tell them from what surrounds the body; see
        `observation.region.colors.distinctness`. The mean over parts and cameras that show anything; 0 without any."""
        densities = [view.densities for view in self.views if view is not None and shapes.any()]
        classes = self.appearance.classes[shapes]
        told = [[distinctness(body[i], scene) for i in np.unique(classes)] for body, scene in densities]
        counts = np.unique(classes, return_counts=True)[1]
        return float(np.average(np.mean(told, axis=0), weights=counts)) if told else 0.0

    def zoom(self, state: State) -> float:
        """Size of the body in the images, in that of a body whose lines are as long as stated."""
        size_m, px_per_m = self.size(state)
        return size_m * px_per_m / _BODY_PX

    def size_px(self, state: State) -> float:
        """Pixels of the body, in the median camera."""
        return math.prod(self.size(state))

    def size(self, state: State) -> tuple[float, float]:
        """Size of the body in meters, and pixels per meter of it in the median of the cameras' distances.

        Such that the body has `_BODY_PX` pixels where no camera sees it.
        """
        if self._size is None or self._size[0] is not state:
            self._size = state, self._size_in(state)
        return self._size[1]

    def _size_in(self, state: State) -> tuple[float, float]:
        depths = np.empty(len(self.views))
        reach = _reach(configured(self._model, state).Ts_world_shape, self._arrays.bounds, self._along, depths)
        focals = zip(self.views, depths.tolist(), self._focals, strict=True)
        # A camera in which the body is nearer does not see it, or stands amid it
        scales = [focal / depth for view, depth, focal in focals if view is not None and depth > reach]
        return 2.0 * reach, median(scales) if scales else _BODY_PX / (2.0 * reach)


@compiled
def _reach(Ts_shape, bounds, along, depths):
    """How far the parts of a body are from its middle, meters; ``depths`` (n_cameras,) of that along each camera's view, whose
    direction and offset ``along`` (n_cameras, 4) are, are overwritten."""
    n, middle, reach = len(Ts_shape), np.zeros(3), 0.0
    for i in range(n):
        middle += Ts_shape[i, :3, 3]
    middle /= n
    for i in range(n):
        x, y, z = Ts_shape[i, 0, 3] - middle[0], Ts_shape[i, 1, 3] - middle[1], Ts_shape[i, 2, 3] - middle[2]
        reach = max(reach, math.sqrt(x * x + y * y + z * z), bounds[i, 3])
    for i in range(len(along)):
        depths[i] = along[i, 0] * middle[0] + along[i, 1] * middle[1] + along[i, 2] * middle[2] + along[i, 3]
    return reach


class SurfaceFilter:
    """Beliefs of the surfaces, one a part; needs joints that something else holds in place, such as a detector's points.

    They are expected as on people in clothes, unless the model says that its shapes are clothed, or contours show it in the first
    fits, as of a body that was drawn from the model.

    Parameters
    ----------
    model, config : body, parameters.

    Attributes
    ----------
    surfaces : as they are known now.
    are_own : whether they were found to be the model's own.
    """

    def __init__(self, model: ArticulatedModel, config: KeypointConfig):
        size = relative_size(model)
        self._config, self._wobble = config, (size * config.surface_wobble_m) ** 2 * np.eye(N_UNKNOWNS)
        means, sigmas = expected_surfaces(model)
        sigmas = size * config.surface_scale * sigmas
        self._in_clothes = Surfaces(size * means, sigmas[:, :, None] ** 2 * np.eye(N_UNKNOWNS))
        self._own_sigma_m = size * _OWN_SIGMA_M
        self._own = Surfaces(np.zeros_like(means), np.tile(self._own_sigma_m**2 * np.eye(N_UNKNOWNS), (len(means), 1, 1)))
        self._clothed = model.clothed
        self.reset()

    def reset(self) -> None:
        """Back to what is expected before anything has been seen."""
        self.are_own, self._n_left = self._clothed, 0 if self._clothed else _COMPARISONS
        self.surfaces = self._own if self._clothed else self._in_clothes

    @property
    def rival(self) -> Surfaces | None:
        """The model's own surfaces, as long as it is open whether they are seen."""
        return self._own if self._n_left else None

    def compare(self, spread_m: float) -> None:
        """Take in how far contours are from the model's own surfaces.

        Parameters
        ----------
        spread_m : standard deviation of contours about the best fit with the `rival`, beyond what their lines allow for.
        """
        self._n_left -= 1
        if spread_m < _OWN_SPREAD * self._own_sigma_m:
            self.surfaces, self.are_own, self._n_left = self._own, True, 0

    def update(self, sums: SurfaceSums, trusted: np.ndarray) -> None:
        """Take in what the lines of one set say.

        Parameters
        ----------
        sums : of the lines at the state that was found.
        trusted : (n_shapes,) mask of the parts that are where that state says.
        """
        now, config = self.surfaces, self._config
        # What the lines say of a part wobbles from pose to pose, and one error lasts for some sets
        share = np.linalg.inv(np.eye(N_UNKNOWNS) + sums.H @ self._wobble) / config.correlation_sets
        share[~trusted] = 0.0
        covariances = np.linalg.inv(now.priors + share @ sums.H)
        means = now.means - (covariances @ (share @ sums.b[:, :, None]))[:, :, 0]
        least = (0.25 * config.surface_wobble_m) ** 2
        values, axes = np.linalg.eigh(0.5 * (covariances + np.swapaxes(covariances, 1, 2)))
        self.surfaces = Surfaces(means, (axes * np.maximum(values, least)[:, None]) @ np.swapaxes(axes, 1, 2))
