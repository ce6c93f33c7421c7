"""The whole core in one call: `Tracker.step` takes an image set and says where the body is."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..camera.camera_rig import CameraRig
from ..errors import CalibrationError
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.kinematic_chain import N_ROOT_DOF
from ..objective.contour_objective import CameraSlot, ContourObjective, ContourOptions, EvidenceMaps, Prior
from ..observation.body_region import Region
from ..observation.image_set import ImageSet
from ..observation.observer import Observation, Observer
from ..optimize.levenberg_marquardt import LevenbergMarquardtOptions, clip_to_limits, minimize
from ..optimize.result import OptimizerResult
from ..render.raycaster import render_labels
from ..render.shape_arrays import ShapeArrays
from .config import TrackerConfig
from .estimate import Status, Timings, TrackEstimate
from .judge import NOTHING, covariance_of, judge, reports_of
from .motion_model import MotionModel
from .workers import Workers

_FIRST_MARGIN = 3  # times the usual margin around a first pose that is only roughly known
_LEAST_REGION_PX = 8  # a body of which less is in view is not looked for


@dataclass(frozen=True, eq=False)
class _Sight:
    """Where the body is expected in one camera: its region and predicted part labels there (0 outside the body)."""

    region: Region
    labels: np.ndarray


class Tracker:
    """Follows one body through image sets; deterministic in them.

    Parameters
    ----------
    rig, model, config : cameras, body, parameters.
    plates : camera name -> BGR image (or list of images) of the empty scene, where there is one.
    initial_state : where the body is in the first image set; None: `set_state` must be called before.

    Raises
    ------
    CalibrationError : from `step`, when an image does not have the size that its camera was calibrated for.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig | None = None,
        plates: Mapping[str, np.ndarray | list] | None = None,
        initial_state: State | None = None,
    ):
        self.rig, self.model = rig, model
        self.config = config = config or TrackerConfig()
        self._plates = dict(plates or {})
        self._initial_state = initial_state
        self._arrays = ShapeArrays.from_model(model)
        self._slots = [CameraSlot(camera, model, config.optimizer.samples_per_line) for camera in rig]
        self._options = ContourOptions(
            robust_scale_px=config.optimizer.robust_scale_px,
            samples_per_line=config.optimizer.samples_per_line,
            sliding=config.optimizer.sliding,
            sum_of_maps=config.evidence.distances == "sum",
            inner_weight=config.optimizer.inner_weight,
            alignment=config.optimizer.alignment,
            boundary_weight=config.optimizer.boundary_weight,
            boundary_scale_px=config.optimizer.boundary_scale_px,
            reach_px=float(config.evidence.reach_px),
        )
        self._fine = replace(self._options, boundary_weight=0.0, robust_scale_px=config.optimizer.fine_robust_scale_px)
        self._parallel = Workers(config.threads).map
        self.reset()

    def reset(self) -> None:
        """Back to the initial state, with nothing learnt."""
        evidence = self.config.evidence
        self._observers = [
            Observer(camera.name, camera.model.width, camera.model.height, evidence, self._plates.get(camera.name))
            for camera in self.rig
        ]
        self._motion = MotionModel(self.model.n_dof, self.config.motion)
        self._start = self._initial_state
        self._count = 0

    def set_state(self, state: State) -> None:
        """Go on from ``state`` at the next image set, with what has been learnt so far."""
        self._motion = MotionModel(self.model.n_dof, self.config.motion)
        self._start = state

    def step(self, image_set: ImageSet) -> TrackEstimate:
        """Estimate the state for one image set."""
        began = time.perf_counter()
        images = self._images(image_set)
        first, predicted = self._predict(image_set.stamp_ns)
        waiting = first and self._start is None
        start = predicted
        if first and not waiting:
            start = self._begin(images, predicted)
        sights = [None] * len(images) if waiting else self._look(start, images)
        observations = self._observe(images, sights)
        observed = time.perf_counter()
        objective = self._objective(observations, start)
        result = self._fit(objective, start, first)
        done = time.perf_counter()
        if waiting:
            status, reason = Status.INITIALISING, "no initial state has been given"
        else:
            objective.count_agreement(result.state, self.config.status.agreement_px, self.config.status.agreement_m)
            status, reason, agreement = judge(self._slots, observations, image_set, self.config.status)
            if agreement < NOTHING:  # stay where the body was last, whatever the optimizer has made of noise
                result = replace(result, state=predicted, equations=objective.linearize(predicted))
            self._accept(image_set.stamp_ns, result.state, images, trusted=status is not Status.LOST)
        finished = time.perf_counter()
        reports, residual = reports_of(self.rig, self._slots, observations, image_set)
        return TrackEstimate(
            stamp_ns=image_set.stamp_ns,
            status=status,
            status_reason=reason,
            state=result.state,
            velocity=self._motion.velocity.copy(),
            covariance=covariance_of(result.equations, self._slots, observations, self.config.status),
            score=result.equations.cost,
            residual_px=residual,
            cameras=reports,
            iterations=result.iterations,
            evaluations=result.evaluations,
            timings=Timings(1e3 * (observed - began), 1e3 * (done - observed), 1e3 * (finished - began)),
        )

    def _images(self, image_set: ImageSet) -> list[np.ndarray | None]:
        """BGR pixels per camera of the rig, None where the set has none."""
        result: list[np.ndarray | None] = []
        for camera in self.rig:
            image = image_set.get(camera.name)
            if image is not None and image.pixels.shape[:2] != (camera.model.height, camera.model.width):
                got, model = image.pixels.shape, camera.model
                raise CalibrationError(
                    camera.name, f"expected images of {model.width}x{model.height} as calibrated, got {got[1]}x{got[0]}"
                )
            result.append(None if image is None else image.bgr)
        return result

    def _predict(self, stamp_ns: int) -> tuple[bool, State]:
        predicted = self._motion.predict(stamp_ns)
        if predicted is not None:
            return False, clip_to_limits(predicted, self.model.chain)
        return True, clip_to_limits(self._start or State.neutral(self.model), self.model.chain)

    def _look(self, state: State, images: list[np.ndarray | None]) -> list[_Sight | None]:
        """Where the body is in the cameras that have an image, if it is in ``state``."""
        configuration = Configuration(self.model, state)

        def look(i: int) -> _Sight | None:
            found = render_labels(configuration, self.rig.cameras[i], self.config.evidence.margin_px)
            return None if found is None or min(found[1].shape) < _LEAST_REGION_PX else _Sight(*found)

        seen = [i for i, image in enumerate(images) if image is not None]
        result: list[_Sight | None] = [None] * len(self.rig)
        for i, sight in zip(seen, self._parallel(look, seen), strict=True):
            result[i] = sight
        return result

    def _seen(self, images, sights) -> list[int]:
        return [i for i, (image, sight) in enumerate(zip(images, sights, strict=True)) if image is not None and sight is not None]

    def _begin(self, images, start: State) -> State:
        """Learn what body and scene look like, fit, and learn again: the first pose given is rarely exact. Returns the fit."""
        margin = self.config.evidence.body_margin_px
        for margin_px in (_FIRST_MARGIN * margin, margin):
            sights = self._look(start, images)
            self._learn_anew(images, sights, margin_px)
            if margin_px != margin:
                start = self._fit(self._objective(self._observe(images, sights), start), start, first=True).state
        return start

    def _learn_anew(self, images, sights, margin_px: int) -> None:
        seen = self._seen(images, sights)
        self._parallel(lambda i: self._observers[i].begin(images[i], sights[i].region, sights[i].labels, margin_px), seen)

    def _learn(self, images, sights) -> None:
        seen = self._seen(images, sights)
        self._parallel(lambda i: self._observers[i].learn(images[i], sights[i].region, sights[i].labels), seen)

    def _observe(self, images, sights) -> list[Observation | None]:
        seen = self._seen(images, sights)
        found = self._parallel(lambda i: self._observers[i].observe(images[i], sights[i].region, sights[i].labels), seen)
        result: list[Observation | None] = [None] * len(self.rig)
        for i, observation in zip(seen, found, strict=True):
            result[i] = observation
        return result

    def _objective(self, observations: list[Observation | None], predicted: State) -> ContourObjective:
        maps = [
            None if o is None or o.empty else EvidenceMaps(o.region[:2], o.silhouette_distance, o.edge_distance, o.boundary)
            for o in observations
        ]
        motion, axes = self.config.motion, self.model.chain.axes
        stay = np.full(self.model.n_dof, motion.stay_angle)
        stay[:3] = motion.stay_position
        neutral = np.zeros(self.model.n_dof)
        neutral[N_ROOT_DOF:] = [motion.neutral_angle * axis.stiffness for axis in axes]
        priors = [Prior(predicted, stay), Prior(State.neutral(self.model, predicted.T_world_root), neutral)]
        return ContourObjective(self.model, self._arrays, self._slots, maps, self._options, priors, self._parallel)

    def _fit(self, objective: ContourObjective, predicted: State, first: bool) -> OptimizerResult:
        """Coarse iterations, in which far boundaries pull, then fine ones."""
        optimizer = self.config.optimizer
        total = optimizer.first_iterations if first else optimizer.max_iterations
        n_coarse = min(total // 2 if first else optimizer.coarse_iterations, total - 1)
        coarse: OptimizerResult | None = None
        if n_coarse > 0:
            coarse = self._minimize(objective, predicted, n_coarse)
            objective.restart(self._fine)
        fine = self._minimize(objective, predicted if coarse is None else coarse.state, total - n_coarse)
        if coarse is None:
            return fine
        return replace(fine, iterations=fine.iterations + coarse.iterations, evaluations=fine.evaluations + coarse.evaluations)

    def _minimize(self, objective: ContourObjective, start: State, iterations: int) -> OptimizerResult:
        options = LevenbergMarquardtOptions(max_iterations=iterations, tolerance=self.config.optimizer.tolerance)
        return minimize(objective, start, self.model.chain, options)

    def _accept(self, stamp_ns: int, state: State, images, trusted: bool) -> None:
        self._start = state
        if not trusted:  # nothing is learnt from what is taken for the body then, nor how fast it is
            self._motion.coast(stamp_ns, state)
            return
        self._motion.update(stamp_ns, state)
        # Appearances change slowly: in each image set some of the cameras learn
        every = self.config.evidence.learn_every
        turn = [image if (i + self._count) % every == 0 else None for i, image in enumerate(images)]
        self._count += 1
        if any(self._observers[i].learns for i, image in enumerate(turn) if image is not None):
            self._learn(turn, self._look(state, turn))
