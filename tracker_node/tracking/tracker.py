"""The whole core in one call: `Tracker.step` takes an image set and says where the body is."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..camera.rig import CameraRig
from ..camera.rig_unit import check_metres
from ..errors import CalibrationError
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..objective.constraints.prior import Prior
from ..observation.image_set import ImageSet
from ..optimize.levenberg_marquardt import clip_to_limits
from ..optimize.result import OptimizerResult
from ..parallel import Workers
from ..render.occluders import Occluders
from .camera_fault import CameraFault
from .chamfer.engine import ContourEngine
from .config import CHAMFER, COLOR_OVER_BACKGROUND, JOINT, REGION, TEXTURE, TrackerConfig, checked_combination
from .covariance import ImageEvidence, fit_covariance
from .engine import Engine, Images, Report, Verdict
from .estimate import GRAY_LEVELS, PX, LimbStatus, Status, Timings, TrackEstimate
from .initialization.detector import body_size
from .initialization.initializer import NOT_GIVEN, Starter
from .motion.model import MotionModel, Passage, Prediction
from .region.engine import RegionEngine
from .self_check import SelfCheck, SelfCheckOptions

_CLEARLY = 0.05  # share of its surety by which another place has to be better than one that is not lost


class Tracker:
    """Follows one body through image sets; deterministic in them.

    Parameters
    ----------
    rig, model, config : cameras, body, parameters.
    plates : camera name -> BGR image (or list of images) of the empty scene, where there is one.
    initial_state : where the body is in the first image set; None: it is looked for in the images (`config.start`), unless
        `set_state` is called before.
    occluders : fixed things that may hide the body from a camera (root at the world's origin, joints neutral); contours only.

    Attributes
    ----------
    surety : of the last verdict, see `Verdict`.

    Raises
    ------
    TrackerError : the places of the cameras are in millimetres or centimetres.
    CalibrationError : from `step`, when an image does not have the size that its camera was calibrated for, or no colors where
        the engine goes by them.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig | None = None,
        plates: Mapping[str, np.ndarray | list] | None = None,
        initial_state: State | None = None,
        occluders: ArticulatedModel | None = None,
    ):
        check_metres(rig.cameras, body_size(model))
        self.rig, self.model = rig, model
        self.config = checked_combination(config or TrackerConfig(), "tracker config")
        self._initial_state = initial_state
        self._make_engine = lambda: _make_engine(rig, model, self.config, plates or {}, Occluders(occluders, rig))
        self._engine = self._make_engine()
        self._starter: Starter | None = None
        if self.config.initialization.enabled:
            follower = replace(self.config, initialization=replace(self.config.initialization, enabled=False))
            parallel = Workers(self.config.threads).map
            self._starter = Starter(
                rig, model, self.config.initialization, plates or {}, parallel, self._make_engine,
                lambda: Tracker(rig, model, follower, plates, None, occluders),
            )  # fmt: skip
        self._check = SelfCheck(rig, model, _check_options(self.config))
        self._restart(initial_state)

    @property
    def in_information_units(self) -> bool:
        """Whether estimates come with the information that their images gave."""
        return self._engine.in_information_units

    def reset(self) -> None:
        """Back to the initial state, with nothing learnt."""
        self._engine.reset()
        self._check.reset()
        if self._starter is not None:
            self._starter.reset()
        self._restart(self._initial_state)

    def set_state(self, state: State) -> None:
        """Go on from ``state`` at the next image set, with what has been learnt so far."""
        self._restart(state)

    def look_anew(self) -> None:
        """Look for the body at the next image sets, wherever it was, with what has been learnt so far."""
        self._restart(None)

    def _restart(self, state: State | None) -> None:
        self._motion = MotionModel(self.model.chain, self.config.motion)
        self._check.skip()  # how it got there is no velocity
        self._start, self._lost = state, 0
        self._unproven: int | None = 0  # image sets since the start in which a limb was lost; None: there was one without
        self.surety: float | None = None
        if self._starter is not None:
            self._starter.stop()

    def take_over(self, other: Tracker, image_set: ImageSet) -> None:
        """Go on where ``other`` has left the same body in ``image_set``, its latest, which teaches what the body looks like.

        Raises
        ------
        CalibrationError : the images do not suit the cameras of this tracker.
        """
        images = self._images(image_set)
        assert other._start is not None
        self._restart(other._start)
        self._engine.begin(images, other._start, known=True)
        self._motion.take_over(other._motion)
        self.surety, self._lost, self._unproven = other.surety, other._lost, other._unproven

    def _looked_for(self, starter: Starter, images: Images, image_set: ImageSet) -> TrackEstimate | None:
        """Of another tracker that has found the body in all of the images, and whose place this one takes; None without one.

        Looked for is a body that is not known yet, that is LOST for long, or of which a limb has been lost ever since the start;
        this once, and another place has to be clearly better.
        """
        if self._start is not None and max(self._lost, self._unproven or 0) < self.config.initialization.after_lost_sets:
            starter.stop()
            if self._lost or self._unproven:
                starter.watch(images)
            return None
        found = starter.find(images, image_set, self._start)
        if found is None:
            if not starter.busy and self._start is not None and not self._lost:
                self._unproven = None
            return None
        other, estimate = found
        assert isinstance(other, Tracker)
        if self._start is not None and not self._lost:
            own = self.surety or 0.0
            if (other.surety or 0.0) < own + _CLEARLY * abs(own):
                self._unproven = None
                return None
        self._engine, self._motion, self.surety = other._engine, other._motion, other.surety
        self._start, self._lost, self._unproven = other._start, other._lost, other._unproven
        self._check.skip()
        return replace(estimate, faults=self._check.faults)

    def step(self, image_set: ImageSet) -> TrackEstimate:
        """Estimate the state for one image set."""
        began = time.perf_counter()
        images = self._images(image_set)
        if self._starter is not None:
            found = self._looked_for(self._starter, images, image_set)
            if found is not None:
                return replace(found, timings=replace(found.timings, total_ms=1e3 * (time.perf_counter() - began)))
        engine = self._engine
        prediction = self._motion.predict(image_set.stamp_ns)
        first, predicted = prediction is None, self._expected(prediction)
        waiting = first and self._start is None
        start = engine.begin(images, predicted) if first and not waiting else predicted
        engine.observe(images, None if waiting else start, self._passage(image_set, prediction))
        observed = time.perf_counter()
        prior = prediction.prior() if prediction is not None and engine.in_information_units else None
        result = engine.fit(start, first, prior)
        done = time.perf_counter()
        if waiting:
            problem = NOT_GIVEN if self._starter is None else self._starter.problem
            verdict, information = Verdict(Status.INITIALIZING, problem), None
        else:
            verdict = engine.judge(result, image_set)
            self.surety = verdict.surety
            if verdict.noise:  # stay where the body was last, whatever the optimizer has made of noise
                result = replace(result, state=predicted, equations=engine.linearize(predicted))
            information = self._information(result, prior, verdict)
            self._accept(image_set.stamp_ns, result.state, information, images, verdict, first)
        faults = self._compare_cameras(image_set.stamp_ns, verdict)
        finished = time.perf_counter()
        report = engine.report(result, image_set)
        evidence = report.images if information is not None else None
        told = self._told(evidence, verdict)
        covariance, arcs = self._covariance(report, result.state, prior, information, told, verdict)
        alone, pull = (information, None) if evidence is None else evidence.measurement(verdict.trust)
        return TrackEstimate(
            stamp_ns=image_set.stamp_ns,
            status=verdict.status,
            status_reason=verdict.reason,
            state=result.state,
            velocity=self._motion.velocity.copy(),
            covariance=covariance,
            arcs=arcs,
            score=result.equations.cost,
            residual=report.residual_px,
            residual_unit=PX if self.config.contours else GRAY_LEVELS,
            cameras=report.cameras,
            iterations=result.iterations,
            evaluations=result.evaluations,
            timings=Timings(1e3 * (observed - began), 1e3 * (done - observed), 1e3 * (finished - began)),
            velocity_covariance=self._motion.velocity_covariance,
            information=alone,
            pull=pull,
            faults=faults,
            limbs=verdict.limbs,
        )

    def _compare_cameras(self, stamp_ns: int, verdict: Verdict) -> tuple[CameraFault, ...]:
        """Cameras that disagree with the others, by this set and those before."""
        if not self.config.self_check.enabled:
            return ()
        comparison = self._engine.comparison()
        if comparison is None or verdict.jumped or verdict.status not in (Status.TRACKING, Status.DEGRADED):
            self._check.skip()
            return self._check.faults
        return self._check.add(stamp_ns, comparison)

    def _images(self, image_set: ImageSet) -> list[np.ndarray | None]:
        """BGR pixels per camera of the rig, None where the set has none."""
        result: list[np.ndarray | None] = []
        for camera in self.rig:
            image = image_set.get(camera.name)
            problem = "" if image is None else camera.model.size_problem(image.pixels)
            if problem:
                raise CalibrationError(camera.name, problem)
            if image is not None and image.encoding == "mono8" and self.config.colors is not None:
                expected = f"expected color images for the modality {self.config.colors}"
                raise CalibrationError(camera.name, f"{expected}, got mono8")
            result.append(None if image is None else image.bgr)
        return result

    def _expected(self, prediction: Prediction | None) -> State:
        state = (self._start or State.neutral(self.model)) if prediction is None else prediction.state
        return clip_to_limits(state, self.model.chain)

    def _passage(self, image_set: ImageSet, prediction: Prediction | None) -> Passage | None:
        """Where the body is when each camera exposes; None where all do at once, or nobody knows how the body moves."""
        images = [image_set.get(camera.name) for camera in self.rig]
        late_s = [0.0 if image is None else 1e-9 * (image.stamp_ns - image_set.stamp_ns) for image in images]
        return None if prediction is None or not any(late_s) else Passage(late_s, prediction)

    def _information(self, result: OptimizerResult, prior: Prior | None, verdict: Verdict) -> np.ndarray | None:
        """(n_dof, n_dof) of all that was fitted to but the prediction; None where the images are not believed, or their engine
        has other units."""
        doubtful = verdict.status is Status.LOST or verdict.noise or verdict.jumped
        if doubtful or not self._engine.in_information_units:
            return None
        H, g = np.zeros_like(result.equations.H), np.zeros_like(result.equations.g)
        if prior is not None:
            prior.add_to(H, g, result.state)
        information = result.equations.H - H
        return information if verdict.trust is None else verdict.trust[:, None] * information * verdict.trust

    def _told(self, evidence: ImageEvidence | None, verdict: Verdict) -> ImageEvidence | None:
        """What is believed of what the images have told; None where the engine cannot say."""
        if evidence is None or verdict.trust is None:
            return evidence
        return evidence.trusted(verdict.trust, self.model.chain.link_moved_by)

    def _covariance(
        self,
        report: Report,
        state: State,
        prior: Prior | None,
        information: np.ndarray | None,
        told: ImageEvidence | None,
        verdict: Verdict,
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """(n_dof, n_dof) of ``state``, and what of it is of arcs: by what is believed of the images, and by the prediction, all
        there is of what is lost."""
        sound = information is not None and (verdict.trust is None or bool((verdict.trust == 1.0).all()))
        if not verdict.limbs or sound or (prior is None and information is None):
            return report.covariance, report.arcs
        n = self.model.n_dof
        H = np.zeros((n, n)) if information is None else information.copy()
        if prior is not None:
            prior.add_to(H, np.zeros(n), state)
        return fit_covariance(H, told, Configuration(self.model, state))

    def _accept(
        self, stamp_ns: int, state: State, information: np.ndarray | None, images: Images, verdict: Verdict, first: bool
    ) -> None:
        self._start = state
        self._lost = self._lost + 1 if verdict.status is Status.LOST else 0
        if self._unproven is not None:
            lost = verdict.status is Status.LOST or any(limb.status is LimbStatus.LOST for limb in verdict.limbs)
            self._unproven = self._unproven + 1 if lost else None
        if verdict.status is not Status.LOST:
            if verdict.jumped:
                self._motion.restart(stamp_ns, state)
            else:
                self._motion.update(stamp_ns, state, information)
            self._engine.learn(images, state)
        elif not (first and _nothing_seen(verdict)):  # else nothing has been learnt: it begins again at the next image set
            self._motion.coast(stamp_ns, state)  # nothing is learnt from what is taken for the body, nor how fast it is


def _nothing_seen(verdict: Verdict) -> bool:
    return bool(verdict.limbs) and all(limb.status is LimbStatus.UNSEEN for limb in verdict.limbs)


def _check_options(config: TrackerConfig) -> SelfCheckOptions:
    check = config.self_check
    delay_s = check.delay_images * config.synchronizer.image_period_s
    return SelfCheckOptions(check.window_s, np.radians(check.angle_deg), delay_s, check.sigmas)


def _make_engine(rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, plates: Mapping, occluders: Occluders) -> Engine:
    """Compiled code of engines that are not used is not loaded."""
    parallel = Workers(config.threads).map

    def contours() -> ContourEngine | RegionEngine:
        distances = ContourEngine(rig, model, config, plates, parallel, occluders) if CHAMFER in config.modalities else None
        if distances is not None and REGION not in config.modalities:
            return distances
        return RegionEngine(rig, model, config, parallel, occluders, plates, distances)

    if config.colors is None:
        return contours()
    if config.colors == TEXTURE:
        from .color.texture_engine import TextureEngine

        colors: Engine = TextureEngine(rig, model, config)
    elif config.colors == COLOR_OVER_BACKGROUND:
        from .color.scene_engine import SceneEngine

        colors = SceneEngine(rig, model, config, plates, parallel)
    else:
        from .color.engine import ColorEngine

        colors = ColorEngine(rig, model, config.color, config.threads, parallel)
        if JOINT in config.tags:
            from .combined.color_with_contour import ColorWithContourEngine

            return ColorWithContourEngine(colors, contours(), model.chain, config)
    if not config.contours:
        return colors
    from .combined.color_then_contour import ColorThenContourEngine

    return ColorThenContourEngine(colors, contours())
