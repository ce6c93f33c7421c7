"""Contours: distances of the body's contour samples to silhouettes and edges (Knossow et al.).

Fits are Levenberg-Marquardt, first with boundaries that attract from afar, then without (Knossow et al., 2008).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Neighbor, State
from ...objective.chamfer.correspondences import ContourBody, ContourCorrespondences, ContourOptions, EvidenceMaps
from ...objective.constraints.prior import Prior
from ...objective.per_camera import bodies_seen
from ...observation.chamfer.observer import Observation, Observer
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ...render.occluders import BodyRegion, Occluders
from ...render.shape_arrays import ShapeArrays
from ..config import ChamferConfig, TrackerConfig
from ..constraints import constraints_of, resting, staying
from ..engine import Solver
from ..modality import Images, Modality, Persons, cameras_in_turn
from ..motion.model import ExposureDelays

COARSE, FINE = "coarse", "fine"
"""Details of correspondences: in coarse ones, boundary points that are far off attract the outline."""

_FIRST_MARGIN = 3  # times the usual margin around a first pose that is only roughly known
_LEAST_REGION_PX = 8  # a body of which less is in view is not searched


class ChamferModality(Modality):
    """The `Modality` of contours.

    Parameters
    ----------
    rig, model, config, backgrounds : as for the `Tracker`.
    parallel : maps a function over cameras.
    occluders : what stands before the body; None: nothing does.

    Attributes
    ----------
    observations : what each camera shows of the present set; None for one without the body.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig,
        backgrounds: Mapping[str, np.ndarray | list],
        parallel: Callable[[Callable, list], list],
        occluders: Occluders | None = None,
    ):
        self._rig, self._config, self._backgrounds = rig, config, dict(backgrounds)
        self._occluders = occluders or Occluders(None, rig)
        self._body = ContourBody.of(model, rig.cameras, ShapeArrays.from_model(model, caps=False), parallel)
        self._options = options_of(config.chamfer)
        self.reset()

    def reset(self) -> None:
        """Only the images of the background are known."""
        chamfer, background = self._config.chamfer, self._config.background
        self._observers = [
            Observer(
                camera.name, (camera.model.width, camera.model.height), chamfer, background, self._backgrounds.get(camera.name)
            )
            for camera in self._rig
        ]
        self.observations: list[Observation | None] = [None] * len(self._rig)
        self._delays: ExposureDelays | None = None
        self._count = 0

    def lessons(self, known: bool) -> Sequence[int]:
        """Pixels around the body that are not learned as background: the first pose given is rarely exact."""
        margin = self._config.background.body_margin_px
        return (margin,) if known else (_FIRST_MARGIN * margin, margin)

    def learn_first(self, images: Images, state: State, lesson: int) -> None:
        """Learn the appearance of body and background anew."""
        self._delays = None
        regions = self._look(state, images)

        def learn(i: int) -> None:
            image, body = images[i], regions[i]
            assert image is not None and body is not None
            self._observers[i].begin(image, body.region, body.labels, lesson)

        self._body.parallel(learn, _seen(images, regions))

    def set_images(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, persons: Persons = ()
    ) -> None:
        """Silhouettes, edges and their distances around the expected body."""
        self._delays = delays
        self.observations = [None] * len(self._rig)
        if expected is None:
            return
        regions = self._look(expected, images)

        def observe(i: int) -> None:
            image, body = images[i], regions[i]
            assert image is not None and body is not None
            self.observations[i] = _uncovered(self._observers[i].observe(image, body.region, body.labels), body.occlusion)

        self._body.parallel(observe, _seen(images, regions))

    def correspond(self, state: State, detail: str) -> ContourCorrespondences:
        """Distances of the contours that are seen in a state; they hold for other states too."""
        maps = [
            None if o is None or o.empty else EvidenceMaps(o.region[:2], o.silhouette_distance, o.edge_distance, o.boundary)
            for o in self.observations
        ]
        return ContourCorrespondences(self._body, maps, self._options[detail], state, self._offsets(state))

    def others(self) -> Sequence[Neighbor]:
        """Other bodies that stand about."""
        return self._occluders.others

    def learn(self, images: Images, state: State, weights: np.ndarray | None) -> None:
        """Appearances change slowly: in each image set some of the cameras learn."""
        turn = cameras_in_turn(images, self._count, self._config.chamfer.learn_every)
        self._count += 1
        if not any(self._observers[i].learns for i, image in enumerate(turn) if image is not None):
            return
        regions = self._look(state, turn)

        def learn(i: int) -> None:
            image, body = turn[i], regions[i]
            assert image is not None and body is not None
            self._observers[i].learn(image, body.region, body.labels)

        self._body.parallel(learn, _seen(turn, regions))

    def _look(self, state: State, images: Images) -> list[BodyRegion | None]:
        """Where the body is in the cameras that have an image, if it is in ``state``."""
        bodies = bodies_seen(self._body.model, state, self._offsets(state))

        def look(i: int) -> BodyRegion | None:
            found = self._occluders.look(i, bodies[i], self._rig.cameras[i], self._config.chamfer.margin_px)
            return None if found is None or min(found.labels.shape) < _LEAST_REGION_PX else found

        present = [i for i, image in enumerate(images) if image is not None]
        result: list[BodyRegion | None] = [None] * len(self._rig)
        for i, body in zip(present, self._body.parallel(look, present), strict=True):
            result[i] = body
        return result

    def _offsets(self, state: State) -> list[np.ndarray | None]:
        return [None] * len(self._rig) if self._delays is None else self._delays.offsets(state)


def options_of(chamfer: ChamferConfig) -> dict[str, ContourOptions]:
    """How contours are compared, by the parameters: `COARSE` and `FINE`."""
    coarse = ContourOptions(
        robust_scale_px=chamfer.robust_scale_px,
        samples_per_line=chamfer.samples_per_line,
        sliding=chamfer.sliding,
        distances=chamfer.distances,
        inner_weight=chamfer.inner_weight,
        alignment=chamfer.min_alignment,
        boundary_weight=chamfer.boundary_weight,
        boundary_scale_px=chamfer.boundary_scale_px,
        reach_px=float(chamfer.reach_px),
        variance_px2=chamfer.residual_sigma_px**2 * chamfer.correlation,
    )
    return {COARSE: coarse, FINE: replace(coarse, boundary_weight=0.0, robust_scale_px=chamfer.fine_robust_scale_px)}


def _seen(images: Images, regions: Sequence[BodyRegion | None]) -> list[int]:
    return [i for i, (image, body) in enumerate(zip(images, regions, strict=True)) if image is not None and body is not None]


def _uncovered(observation: Observation, mask: np.ndarray | None) -> Observation:
    """Evidence without what hides the body (mask (h, w)): distances are NaN there, and no boundary runs along it."""
    if mask is None:
        return observation
    to_silhouette, to_edge = observation.silhouette_distance.copy(), observation.edge_distance.copy()
    to_silhouette[mask], to_edge[mask] = np.nan, np.nan
    u, v = np.rint(observation.boundary[:, :2]).astype(int).T
    boundary = observation.boundary[~mask[v, u]]
    return replace(observation, silhouette_distance=to_silhouette, edge_distance=to_edge, boundary=boundary)


class ChamferFitting(Solver):
    """How bodies are fitted to the contours of a `ChamferModality`.

    Parameters
    ----------
    model, config : as for the `Tracker`.
    modality : of the contours.
    """

    def __init__(self, model: ArticulatedModel, config: TrackerConfig, modality: ChamferModality):
        self._config, self._modality = config, modality
        self._fitter, self._rest = Fitter(model, constraints_of(model, config, modality.others)), resting(model, config.motion)

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """Coarse iterations, then fine ones."""
        chamfer, motion = self._config.chamfer, self._config.motion
        total = chamfer.first_iterations if first else chamfer.max_iterations
        n_coarse = min(total // 2 if first else chamfer.coarse_iterations, total - 1)
        stages = [Stage(COARSE, LevenbergMarquardtOptions(n_coarse, tolerance=chamfer.tolerance))] if n_coarse > 0 else []
        # In coarse ones boundaries attract from wherever they are, which says nothing of cameras
        stages.append(Stage(FINE, LevenbergMarquardtOptions(total - n_coarse, tolerance=chamfer.tolerance), compares=True))
        return self._fitter.fit(start, self._modality, stages, [prior or staying(start, motion), self._rest])
