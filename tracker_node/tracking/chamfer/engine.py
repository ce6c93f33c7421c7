"""The body by its contours: silhouettes and edges, and Levenberg-Marquardt on the distances of contour generators to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.chamfer.objective import CameraSlot, ContourObjective, ContourOptions, EvidenceMaps
from ...objective.constraints.prior import Prior
from ...objective.moved_configuration import bodies_seen
from ...objective.normal_equations import Comparison, LeastSquaresObjective, NormalEquations
from ...objective.sum_objective import SumObjective
from ...observation.chamfer.observer import Observation, Observer
from ...observation.image_set import ImageSet
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from ...optimize.result import OptimizerResult
from ...render.occluders import Occluders, Sight
from ...render.shape_arrays import ShapeArrays
from ..config import TrackerConfig
from ..constraints import constraints_of
from ..engine import Images, Report, Verdict
from ..motion.model import Passage
from .judge import NOTHING, Recovery, covariance_of, judge, reports_of

_FIRST_MARGIN = 3  # times the usual margin around a first pose that is only roughly known
_LEAST_REGION_PX = 8  # a body of which less is in view is not looked for


class ContourEngine:
    """The `Engine` of contours.

    Parameters
    ----------
    rig, model, config, plates : as for the `Tracker`.
    parallel : maps a function over cameras.
    occluders : what stands before the body; None: nothing does.
    """

    in_information_units = True

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig,
        plates: Mapping[str, np.ndarray | list],
        parallel: Callable[[Callable, list], list],
        occluders: Occluders | None = None,
    ):
        self._rig, self._model, self._config, self._plates, self._parallel = rig, model, config, dict(plates), parallel
        self._occluders = occluders or Occluders(None, rig)
        chamfer = config.chamfer
        self._arrays = ShapeArrays.from_model(model, caps=False)
        self._constraints = constraints_of(model, config)
        self._slots = [CameraSlot(camera, model, chamfer.samples_per_line) for camera in rig]
        self._options = ContourOptions(
            robust_scale_px=chamfer.robust_scale_px,
            samples_per_line=chamfer.samples_per_line,
            sliding=chamfer.sliding,
            distances=chamfer.distances,
            inner_weight=chamfer.inner_weight,
            alignment=chamfer.min_alignment,
            boundary_weight=chamfer.boundary_weight,
            boundary_scale_px=chamfer.boundary_scale_px,
            reach_px=float(chamfer.reach_px),
            variance_px2=config.chamfer.residual_sigma_px**2 * config.chamfer.correlation,
        )
        self._fine = replace(self._options, boundary_weight=0.0, robust_scale_px=chamfer.fine_robust_scale_px)
        self.reset()

    def reset(self) -> None:
        """Nothing but the plates is known."""
        chamfer, background = self._config.chamfer, self._config.background
        self._observers = [
            Observer(camera.name, (camera.model.width, camera.model.height), chamfer, background, self._plates.get(camera.name))
            for camera in self._rig
        ]
        self._observations: list[Observation | None] = [None] * len(self._rig)
        self._passage: Passage | None = None
        self._comparison: Comparison | None = None
        self._recovery = Recovery()
        self._count = 0

    def begin(self, images: Images, start: State, *, known: bool = False) -> State:
        """Learn what body and scene look like, fit, and learn again: the first pose given is rarely exact."""
        self._passage, margin, self._recovery = None, self._config.background.body_margin_px, Recovery()
        for margin_px in (margin,) if known else (_FIRST_MARGIN * margin, margin):
            sights = self._look(start, images)
            self._learn_anew(images, sights, margin_px)
            if margin_px != margin:
                self._observe(images, sights)
                start = self.fit(start, first=True).state
        return start

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """Silhouettes, edges and their distances around the expected body."""
        self._passage = passage
        self._observe(images, [None] * len(images) if expected is None else self._look(expected, images))

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """Coarse iterations, in which far boundaries pull, then fine ones."""
        self._objective = objective = self._objective_around(start, prior)
        chamfer = self._config.chamfer
        total = chamfer.first_iterations if first else chamfer.max_iterations
        n_coarse = min(total // 2 if first else chamfer.coarse_iterations, total - 1)
        coarse: OptimizerResult | None = None
        if n_coarse > 0:
            coarse = self._minimize(start, n_coarse)
            objective.restart(self._fine, self._offsets(coarse.state))
        fine = self._minimize(start if coarse is None else coarse.state, total - n_coarse)
        self._comparison = Comparison(fine.state, fine.equations, objective.camera_equations())
        if coarse is None:
            return fine
        return replace(fine, iterations=fine.iterations + coarse.iterations, evaluations=fine.evaluations + coarse.evaluations)

    @property
    def whole(self) -> LeastSquaresObjective:
        """What the last fit has minimized at its end: contours, constraints and priors."""
        return SumObjective([self._objective, *self._constraints])

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """By how far outline and silhouette agree."""
        chamfer = self._config.chamfer
        self._objective.count_agreement(result.state, chamfer.agreement_px, chamfer.agreement_m)
        found, reason, agreement = judge(self._slots, self._observations, image_set, chamfer)
        found, reason = self._recovery.update(found, reason, agreement)
        return Verdict(found, reason, noise=agreement < NOTHING)

    def linearize(self, state: State) -> NormalEquations:
        """Of the contour residuals."""
        return self._objective.linearize(state)

    def comparison(self) -> Comparison | None:
        """Of the fine stage: in the coarse one, boundaries pull from wherever they are."""
        return self._comparison

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """Distances of contour samples."""
        reports, residual = reports_of(self._rig, self._slots, self._observations, image_set)
        covariance = covariance_of(result.equations, self._slots, self._observations, self._config.chamfer)
        return Report(reports, residual, covariance)

    def learn(self, images: Images, state: State) -> None:
        """Appearances change slowly: in each image set some of the cameras learn."""
        every = self._config.chamfer.learn_every
        turn = [image if (i + self._count) % every == 0 else None for i, image in enumerate(images)]
        self._count += 1
        if any(self._observers[i].learns for i, image in enumerate(turn) if image is not None):
            self._learn(turn, self._look(state, turn))

    def _look(self, state: State, images: Images) -> list[Sight | None]:
        """Where the body is in the cameras that have an image, if it is in ``state``."""
        bodies = bodies_seen(self._model, state, self._offsets(state))

        def look(i: int) -> Sight | None:
            found = self._occluders.look(i, bodies[i], self._rig.cameras[i], self._config.chamfer.margin_px)
            return None if found is None or min(found.labels.shape) < _LEAST_REGION_PX else found

        seen = [i for i, image in enumerate(images) if image is not None]
        result: list[Sight | None] = [None] * len(self._rig)
        for i, sight in zip(seen, self._parallel(look, seen), strict=True):
            result[i] = sight
        return result

    def _offsets(self, state: State) -> list[np.ndarray | None]:
        return [None] * len(self._rig) if self._passage is None else self._passage.offsets(state)

    def _seen(self, images, sights) -> list[int]:
        return [i for i, (image, sight) in enumerate(zip(images, sights, strict=True)) if image is not None and sight is not None]

    def _learn_anew(self, images, sights, margin_px: int) -> None:
        seen = self._seen(images, sights)
        self._parallel(lambda i: self._observers[i].begin(images[i], sights[i].region, sights[i].labels, margin_px), seen)

    def _learn(self, images, sights) -> None:
        seen = self._seen(images, sights)
        self._parallel(lambda i: self._observers[i].learn(images[i], sights[i].region, sights[i].labels), seen)

    def _observe(self, images, sights) -> None:
        seen = self._seen(images, sights)
        found = self._parallel(lambda i: self._observers[i].observe(images[i], sights[i].region, sights[i].labels), seen)
        self._observations = [None] * len(self._rig)
        for i, observation in zip(seen, found, strict=True):
            self._observations[i] = _unveiled(observation, sights[i].veil)

    def learn_first(self, images: Images, state: State) -> None:
        """Learn from the first image set what the body, which is in ``state``, and its surroundings look like."""
        self._passage = None
        self._learn_anew(images, self._look(state, images), self._config.background.body_margin_px)

    def evidence_around(self, expected: State) -> ContourObjective:
        """What was observed, as of the fine iterations and without priors: to be minimized together with other evidence."""
        self._objective = self._objective_of([])
        self._objective.restart(self._fine, self._offsets(expected))
        return self._objective

    def _objective_of(self, priors: list[Prior]) -> ContourObjective:
        maps = [
            None if o is None or o.empty else EvidenceMaps(o.region[:2], o.silhouette_distance, o.edge_distance, o.boundary)
            for o in self._observations
        ]
        return ContourObjective(self._model, self._arrays, self._slots, maps, self._options, priors, self._parallel)

    def _objective_around(self, expected: State, prior: Prior | None) -> ContourObjective:
        motion, axes, variance = self._config.motion, self._model.chain.axes, self._options.variance_px2
        if prior is None:
            stay = np.full(self._model.n_dof, motion.stay_angle / variance)
            stay[:3] = motion.stay_position / variance
            prior = Prior(expected, stay)
        neutral = np.zeros(self._model.n_dof)
        neutral[N_ROOT_DOF:] = [motion.neutral_angle * axis.stiffness / variance for axis in axes]
        priors = [prior, Prior(State.neutral(self._model, expected.T_world_root), neutral)]
        objective = self._objective_of(priors)
        objective.restart(self._options, self._offsets(expected))
        return objective

    def _minimize(self, start: State, iterations: int) -> OptimizerResult:
        options = LevenbergMarquardtOptions(max_iterations=iterations, tolerance=self._config.chamfer.tolerance)
        return minimize(self.whole, start, self._model.chain, options)


def _unveiled(observation: Observation, veil: np.ndarray | None) -> Observation:
    """Evidence without what hides the body: distances are NaN there, and no boundary runs along it."""
    if veil is None:
        return observation
    to_silhouette, to_edge = observation.silhouette_distance.copy(), observation.edge_distance.copy()
    to_silhouette[veil], to_edge[veil] = np.nan, np.nan
    u, v = np.rint(observation.boundary[:, :2]).astype(int).T
    boundary = observation.boundary[~veil[v, u]]
    return replace(observation, silhouette_distance=to_silhouette, edge_distance=to_edge, boundary=boundary)
