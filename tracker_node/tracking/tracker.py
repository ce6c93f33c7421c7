"""The whole core in one call: `Tracker.step` takes an image set and says where the body is."""

from __future__ import annotations

import time
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..camera.rig import CameraRig, check_metres, check_place
from ..errors import CalibrationError, ModelError, TrackerError
from ..model.articulated import ArticulatedModel
from ..model.configuration import Neighbor, State, configured
from ..model.humans.keypoints import BLAZEPOSE, KeypointTable
from ..objective.constraints.prior import Prior
from ..observation.exposure import Exposures
from ..observation.image_set import ImageSet
from ..observation.keypoints.crop import Crop
from ..optimize.fitter import Fit, at_state
from ..optimize.levenberg_marquardt import clip_to_limits
from ..parallel import Workers
from ..render.occluders import Occluders
from .assessment import Assessment, Report
from .cameras.trust import CameraTrust
from .config import GEOMETRIC, KEYPOINTS, TrackerConfig, checked_combination
from .constraints import given_sigmas
from .engine import AnyEngine
from .engines import make_engine
from .estimate import LimbStatus, Status, Timings, TrackEstimate
from .initialization.detector import body_size
from .initialization.initializer import NOT_GIVEN, Initializer
from .keypoints.crops import crops_of
from .keypoints.late import LatePoints, PastSet
from .modality import Images, PeopleSeen
from .motion.model import ExposureDelays, MotionModel, Prediction
from .uncertainty.covariance import ImageEvidence, fit_covariance, limits_information, without_direction
from .uncertainty.modes import Symmetry, symmetry_of

_LOST_SETS = 2  # image sets in which a body was LOST, after which a detector's points say where it is
_HELD_SETS = 5  # that a body was not LOST, for what was learned from it to be the body's...
_KNOWN_SETS = 100  # ...and in which it is LOST, until that says nothing any more
_MOST_AGAIN = 1  # image sets that are fitted again where points come late, of those since: live, all would take too long
_CLEARLY = 0.05  # fraction of its log-likelihood ratio by which another place has to be better than one that is not lost
_OF_A_TURN = 1.0 / 6.0  # that maps the body onto itself: standard deviation, beyond which it may have been turned by it
_SAME_PLACE_M = 0.5  # between two roots, within which it may be the same body otherwise posed
# Who is farther than this, and as far as the body surely runs, from where it was seen within so long is somebody else
_NEAR_M, _AWAY_NS = 1.0, 1_000_000_000


@dataclass(eq=False)
class _Track:
    """What is known of the body that is followed.

    ``log_ratio``: of the last assessment. ``start``: its last state, or the one that was given; None: it is not known. ``lost``:
    image sets in a row in which it was LOST. ``held``: image sets since the start in which it was not. ``unproven``: image sets
    since it was found in which a limb was lost; None: there was one without. ``spoiled``: a camera that is left out now has shown
    another moment until then. ``turned``: why it may be turned otherwise, of a body that looks the same then. ``doubt``: variance
    of its turn that has added up since it was TRACKING, radians^2. ``seen``: stamp, place and least speed, m/s, of its root
    when it was not LOST last, once it was held.
    """

    engine: AnyEngine
    motion: MotionModel
    start: State | None
    log_ratio: float | None = None
    lost: int = 0
    held: int = 0
    unproven: int | None = 0
    spoiled: bool = False
    turned: str = ""
    doubt: float = 0.0
    seen: tuple[int, np.ndarray, float] | None = None

    def seen_lately(self, stamp_ns: int) -> tuple[np.ndarray, float] | None:
        """(3,) meters, world, where the body was a moment ago, and how far from there it may be."""
        if self.seen is None or stamp_ns - self.seen[0] >= _AWAY_NS:
            return None
        return self.seen[1], _NEAR_M + self.seen[2] * 1e-9 * (stamp_ns - self.seen[0])

    def see(self, stamp_ns: int, state: State) -> None:
        """The body is not LOST."""
        covariance = self.motion.velocity_covariance
        sigma = np.inf if covariance is None else np.sqrt(np.trace(covariance[:3, :3]))
        least = max(float(np.linalg.norm(self.motion.velocity[:3]) - 2.0 * sigma), 0.0)
        self.seen = stamp_ns, state.T_world_root[:3, 3], least


@dataclass(frozen=True, eq=False)
class _Lesson:
    """What a fit of an image set has to teach: what body, background and cameras are like."""

    stamp_ns: int
    images: Images
    fit: Fit
    assessment: Assessment


@dataclass(frozen=True, eq=False)
class _Step:
    """What was made of an image set; ``information`` of its images alone; ``observed``, ``fitted``: when that was done."""

    fit: Fit
    prior: Prior | None
    assessment: Assessment
    information: np.ndarray | None
    observed: float
    fitted: float


class Tracker:
    """Follows one body through image sets; deterministic in them.

    Parameters
    ----------
    rig, model, config : cameras, body, parameters.
    backgrounds : camera name -> BGR image (or list of images) of the background, where there is one.
    initial_state : where the body is in the first image set; None: it is detected in the images (`config.initialization`), unless
        `set_state` is called before.
    occluders : fixed things that may hide the body from a camera (root at the world's origin, joints neutral); contours only.
        Trackers of the same body share theirs, and `ImageSet.neighbors` with them.
    keypoints : what a detector's points are on the body; None: those of BlazePose on the human.

    Raises
    ------
    TrackerError : the positions of the cameras are in millimeters or centimeters; the body has no shapes.
    CalibrationError : from `step`, when an image does not have the size that its camera was calibrated for, or no colors where
        the modalities need them.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig | None = None,
        backgrounds: Mapping[str, np.ndarray | list] | None = None,
        initial_state: State | None = None,
        occluders: ArticulatedModel | Occluders | None = None,
        keypoints: KeypointTable | None = None,
    ):
        if not model.shapes:
            raise ModelError(f"'{model.name}' has no shapes, and nothing of it is seen: expected at least one")
        check_metres(rig.cameras, body_size(model))
        if initial_state is not None:
            check_place(rig.cameras, body_size(model), initial_state.T_world_root[:3, 3])
        self.rig, self.model = rig, model
        self.config = config = checked_combination(config or TrackerConfig(), "tracker config")
        self._initial_state, backgrounds, keypoints = initial_state, backgrounds or {}, keypoints or BLAZEPOSE
        shared = occluders if isinstance(occluders, Occluders) else Occluders(occluders, rig, Workers(config.threads).map)
        self._occluders = shared

        def engine() -> AnyEngine:
            return make_engine(rig, model, config, backgrounds, shared, keypoints)

        self._track = _Track(engine(), MotionModel(model.chain, config.motion), None)
        self._initializer: Initializer | None = None
        if config.initialization.enabled:
            follower = replace(config, initialization=replace(config.initialization, enabled=False))
            self._initializer = Initializer(
                rig, model, config.initialization, backgrounds, Workers(config.threads), engine,
                lambda: Tracker(rig, model, follower, backgrounds, None, shared, keypoints),
            )  # fmt: skip
        self._trust, self._exposures = CameraTrust(rig, model, config), Exposures(len(rig))
        self._late = LatePoints(rig, model, keypoints) if KEYPOINTS in config.modalities else None
        self._near: np.ndarray | None = None  # where, of several people, the body is wanted
        self._lesson: _Lesson | None = None  # of the latest image set, not learned yet
        self._restart(initial_state)

    @property
    def in_information_units(self) -> bool:
        """Whether estimates come with the information that their images gave."""
        return self._track.engine.in_information_units

    @property
    def doubt_of_size(self) -> str:
        """Why the body may not be that of the person who is tracked with it; empty where it may, or nothing tells."""
        return self._track.engine.doubt_of_size

    @property
    def log_ratio(self) -> float | None:
        """Log-likelihood ratio of the last assessment, see `Assessment`."""
        return self._track.log_ratio

    def reset(self) -> None:
        """Back to the initial state, with nothing learned."""
        self._lesson = None
        self._track.engine.reset()
        self._trust.reset()
        self._exposures.reset()
        if self._initializer is not None:
            self._initializer.reset()
        self._restart(self._initial_state)

    def set_state(self, state: State) -> None:
        """Go on from ``state`` at the next image set, with what has been learned so far."""
        self._restart(state)

    def reinitialize(self, near: np.ndarray | None = None) -> None:
        """Detect the body in the next image sets, wherever it was, with what has been learned so far.

        Parameters
        ----------
        near : (3,) meters, world: of several people, the one there, now and whenever the body is LOST; None: as before.

        Raises
        ------
        TrackerError : a place, where no points of people are compared.
        """
        if near is not None:
            if self._late is None:
                names = ", ".join(self.config.modalities)
                raise TrackerError(f"a person is chosen by points: expected keypoints among the modalities, got {names}")
            self._near = np.asarray(near, dtype=np.float64)
        self._restart(None)

    def _restart(self, state: State | None) -> None:
        self.learn()
        self._track = _Track(self._track.engine, MotionModel(self.model.chain, self.config.motion), state)
        self._trust.skip()
        if self._late is not None:
            self._late.reset()
        if self._initializer is not None:
            self._initializer.stop()

    def take_over(self, other: Tracker, image_set: ImageSet) -> None:
        """Go on where another tracker has left the same body.

        Parameters
        ----------
        other : has tracked until now.
        image_set : its latest, from which the appearance of the body is learned.

        Raises
        ------
        CalibrationError : the images do not suit the cameras of this tracker.
        """
        images, track, self._near = self._images(image_set), other._track, other._near
        assert track.start is not None
        self._restart(track.start)
        self._show(image_set, track.start)
        self._track.engine.begin(images, track.start, known=True)
        self._track.motion.take_over(track.motion)
        turned = track.turned and self._turned_otherwise(np.inf)  # by other modalities its turns may be told
        self._track = replace(track, engine=self._track.engine, motion=self._track.motion, turned=turned)

    def _reinitialized(self, initializer: Initializer, images: Images, image_set: ImageSet) -> TrackEstimate | None:
        """The estimate of another tracker that has found the body in all of the images, and whose track is taken; or None.

        Searched is a body that is not known yet, that is LOST for long, or of which a limb has been lost ever since the start;
        this once, and another place has to be clearly better.
        """
        track = self._track
        if track.start is not None and max(track.lost, track.unproven or 0) < self.config.initialization.after_lost_sets:
            initializer.stop()
            if track.lost or track.unproven:
                initializer.watch(images)
            return None
        if track.start is None and self._late is not None and self._late.may_come(image_set.stamp_ns):
            initializer.watch(images)  # points tell in no time what outlines take seconds to find, and others would wait
            return None
        self._occluders.show(image_set.neighbors, None)
        found = initializer.find(images, image_set, track.start, lambda states: self._supported(images, states))
        if found is None:
            if not initializer.busy and track.start is not None and not track.lost:
                track.unproven = None
            return None
        other, estimate = found
        assert isinstance(other, Tracker)
        if track.start is not None and not track.lost:
            own = track.log_ratio or 0.0
            if (other.log_ratio or 0.0) < own + _CLEARLY * abs(own):
                track.unproven = None
                return None
        self._track = replace(other._track, turned=self._turned_otherwise(np.inf))
        self._trust.skip()
        self._late = other._late
        if self._track.turned and estimate.status is Status.TRACKING:
            estimate = replace(estimate, status=Status.DEGRADED, status_reason=self._track.turned)
        return replace(estimate, faults=self._trust.faults)

    def _supported(self, images: Images, states: list[State]) -> list[State]:
        """Where a LOST body may be: what was learned while it was tracked speaks for that, and more than for where it is taken to
        be. One that is not lost is there, turned at most: others may have clearer outlines. All ``states`` where nothing tells.
        """
        track, engine, here = self._track, self._track.engine, self._track.start
        if here is not None and not track.lost:
            place = here.T_world_root[:3, 3]
            return [state for state in states if np.linalg.norm(state.T_world_root[:3, 3] - place) < _SAME_PLACE_M]
        if here is None or not 0 < track.lost < _KNOWN_SETS or track.held < _HELD_SETS:
            return states
        gain = engine.support(images, here)
        if gain is None:
            return states
        least = max(gain, 0.0)  # of somebody else the colors say less than nothing
        return [state for state in states if (engine.support(images, state) or 0.0) > least]

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]:
        """Where a detector of people should look for the body.

        Parameters
        ----------
        stamp_ns : of the images.

        Returns
        -------
        A square in the image of each camera of the rig; none where the body is not known or not expected to be seen: the detector
        is to look at the whole image.
        """
        expected = self.expected(stamp_ns)
        crops = [None] * len(self.rig) if expected is None else crops_of(self.model, self.rig, expected)
        return [() if crop is None else (crop,) for crop in crops]

    def expected(self, stamp_ns: int) -> State | None:
        """Where the body is expected at a stamp; None where it is not known, or LOST."""
        prediction = self._track.motion.predict(stamp_ns)
        if self._track.lost or (prediction is None and self._track.start is None):
            return None
        return self._expected(prediction)

    def as_neighbor(self, stamp_ns: int) -> Neighbor | None:
        """The body as others in the same images have to know it; None where it is not known, or LOST."""
        expected = self.expected(stamp_ns)
        return None if expected is None else self._as_neighbor(expected)

    def _as_neighbor(self, expected: State) -> Neighbor:
        unknown = np.zeros(len(self.model.shapes), np.int32), [None] * len(self.rig)
        classes, colors = self._track.engine.colors or unknown
        # Copies: this tracker may learn on its thread while another draws the body.
        return Neighbor(configured(self.model, expected), classes, [None if each is None else each.copy() for each in colors])

    def people_of(self, image_set: ImageSet) -> PeopleSeen:
        """Whom a detector has found, as the body's modalities take them, late or not; empty where they take none."""
        return () if self._late is None else self._late.found(image_set)

    def claims(self, people: PeopleSeen, expected: State) -> list[np.ndarray]:
        """How well everybody suits the body where it is expected.

        Parameters
        ----------
        people : of `people_of`.
        expected : of the body.

        Returns
        -------
        By camera (n_people,) log-likelihood ratios; minus infinity of those who are not the body. Empty without points.
        """
        return self._track.engine.claims(people, expected)

    def candidates(self, people: PeopleSeen) -> list[tuple[State, float]]:
        """Where the body may begin.

        Parameters
        ----------
        people : of `people_of`.

        Returns
        -------
        States, and by what less likely ones are more: meters from where the body is wanted, or else what each point costs.
        """
        found = self._track.engine.candidates(people, self._near)
        if self._near is None:
            return found
        return [(state, float(np.linalg.norm(state.T_world_root[:3, 3] - self._near))) for state, _ in found]

    def step(self, image_set: ImageSet) -> TrackEstimate:
        """Estimate the state for one image set, and learn from it."""
        estimate = self.estimate(image_set)
        self.learn()
        return estimate

    def learn(self) -> None:
        """Learn from the latest image set what body and background look like, and compare the cameras; once."""
        lesson, self._lesson = self._lesson, None
        if lesson is not None:
            self._take_in(lesson)
            self._trust.compare(lesson.stamp_ns, lesson.fit, lesson.assessment)

    def estimate(self, image_set: ImageSet) -> TrackEstimate:
        """Estimate the state for one image set; what it has to teach is left for `learn`, or for the next set.

        Who waits for the state has it earlier; states are the same. Cameras at fault are named by the sets before.
        """
        began = time.perf_counter()
        self.learn()
        image_set, images = self._in_first_light(self._trust.trusted(image_set, self._track.start, bool(self._track.lost)))
        self._track.spoiled |= self._trust.spoiled
        people: PeopleSeen = ()
        if self._late is not None:
            self._go_back(self._late.since(image_set))
            people = self._late.in_time(image_set)
        if self._initializer is not None:
            self._begin_where_found(people, image_set.stamp_ns)
            by_points = self.config.modalities == (KEYPOINTS,)  # which tell poses apart by people alone
            found = None if by_points else self._reinitialized(self._initializer, images, image_set)
            if found is not None:
                return replace(found, timings=replace(found.timings, total_ms=1e3 * (time.perf_counter() - began)))
        track, engine, step = self._track, self._track.engine, self._stepped(image_set, images, people)
        fit, prior, assessment, information = step.fit, step.prior, step.assessment, step.information
        finished = time.perf_counter()
        report = engine.report(fit, image_set)
        evidence = report.images if information is not None else None
        if evidence is not None:
            for spin in self._spins(fit.state):
                evidence = evidence.without(spin)
        covariance, second_order = self._covariance(report, fit.state, prior, information, evidence, assessment)
        if KEYPOINTS in self.config.modalities:
            scale = self.config.keypoints.error_scale
            covariance = scale * covariance
            second_order = None if second_order is None else scale * second_order
        alone, innovation = (information, None) if evidence is None else evidence.measurement(assessment.dof_weights)
        if information is not None and any(people):  # lines and points together
            alone, innovation = information / self.config.keypoints.error_scale, None
        said = self._trust.doubted(assessment)
        return TrackEstimate(
            stamp_ns=image_set.stamp_ns,
            status=said.status,
            status_reason=self._with_left_out(said.reason),
            state=fit.state,
            velocity=track.motion.velocity.copy(),
            covariance=covariance,
            second_order=second_order,
            score=fit.equations.cost,
            residual=report.residual,
            residual_unit=self.config.residual_unit,
            cameras=report.cameras,
            iterations=fit.iterations,
            evaluations=fit.evaluations,
            timings=Timings(1e3 * (step.observed - began), 1e3 * (step.fitted - step.observed), 1e3 * (finished - began)),
            velocity_covariance=track.motion.velocity_covariance,
            information=alone,
            innovation=innovation,
            faults=self._trust.faults,
            limbs=said.limbs,
            surfaces=engine.surfaces,
        )

    def _stepped(self, image_set: ImageSet, images: Images, people: PeopleSeen) -> _Step:
        """Predict, observe, fit and assess."""
        track, engine, before = self._track, self._track.engine, copy(self._track.motion)
        first = track.motion.predict(image_set.stamp_ns) is None
        prediction = self._predicted(image_set)
        predicted = self._expected(prediction)
        waiting = first and track.start is None
        self._show(image_set, None if waiting else predicted)
        start = engine.begin(images, predicted, people=people) if first and not waiting else predicted
        engine.observe(images, None if waiting else start, self._delays(image_set, prediction), people)
        observed = time.perf_counter()
        prior = prediction.prior() if prediction is not None and engine.in_information_units else None
        fit = engine.fit(start, first, prior)
        fitted = time.perf_counter()
        if waiting:
            problem = self.doubt_of_size or (NOT_GIVEN if self._initializer is None else self._initializer.problem)
            assessment, information = Assessment(Status.INITIALIZING, problem), None
        else:
            assessment = self._with_turns(engine.assess(fit, image_set), prediction)
            assessment = self._unless_elsewhere(assessment, fit.state, image_set.stamp_ns)
            track.log_ratio = assessment.log_ratio
            if assessment.noise:  # stay where the body was last, whatever the optimizer has made of noise
                fit = at_state(fit, predicted)
            information = self._information(fit, prior, assessment)
            self._accept(image_set.stamp_ns, fit.state, information, assessment, first)
            self._lesson = _Lesson(image_set.stamp_ns, images, fit, assessment)
        if self._late is not None:
            self._late.add(PastSet(image_set, people, before))
        return _Step(fit, prior, assessment, information, observed, fitted)

    def _show(self, image_set: ImageSet, expected: State | None) -> None:
        """Have other bodies stand about this one."""
        own = image_set.own
        if expected is None or not image_set.neighbors:
            own = None
        elif own is None or not _same(own.body.state, expected):
            own = self._as_neighbor(expected)
        self._occluders.show(image_set.neighbors, own)

    def _predicted(self, image_set: ImageSet) -> Prediction | None:
        """What is expected of an image set before its images are looked at: by those before, and by the robot's joint states."""
        motion, stamp_ns, config = self._track.motion, image_set.stamp_ns, self.config.motion
        said, start = image_set.joint_positions, self._track.start
        if not self.in_information_units:
            return motion.predict(stamp_ns)
        if motion.predict(stamp_ns) is None and start is not None and (said or config.base == "fixed"):
            motion.expect(stamp_ns, start, given_sigmas(start, config))
        if said:
            axes = self.model.chain.axes
            motion.read_joints(stamp_ns, np.array([said.get(axis.name, np.nan) for axis in axes]))
        return motion.predict(stamp_ns)

    @cached_property
    def _symmetry(self) -> Symmetry:
        """How the body may be turned without looking otherwise."""
        return symmetry_of(self.model, any(name not in GEOMETRIC for name in self.config.modalities))

    def _spins(self, state: State) -> list[np.ndarray]:
        """Tangents (n_dof,) along which no image tells how the body is turned."""
        return self._symmetry.spins(configured(self.model, state)) if self._symmetry.has_spins else []

    def _turned_otherwise(self, sigma_rad: float) -> str:
        """Why the body may be turned otherwise, if its turn was known to ``sigma_rad`` when it was found; else "" """
        turns = [turn for turn in self._symmetry.turns if sigma_rad > _OF_A_TURN * turn]
        if self.model.symmetric or not turns:
            return ""
        return f"where it was found it may as well be turned by {np.degrees(turns[-1]):.0f} degrees"

    def _with_turns(self, assessment: Assessment, prediction: Prediction | None) -> Assessment:
        """DEGRADED, where a body that was lost, or in doubt, is in one of several turns in which it looks the same."""
        track = self._track
        track.doubt += assessment.doubt_rad**2
        if assessment.status is Status.LOST or track.lost:
            covariance = None if prediction is None else prediction.covariance
            expected = np.inf if covariance is None else float(np.linalg.eigvalsh(covariance[3:6, 3:6])[-1])
            track.doubt = max(track.doubt, expected)
        if assessment.status is Status.TRACKING:
            track.turned, track.doubt = track.turned or self._turned_otherwise(np.sqrt(track.doubt)), 0.0
        if track.turned and assessment.status is Status.TRACKING:
            return replace(assessment, status=Status.DEGRADED, reason=track.turned)
        return assessment

    def _unless_elsewhere(self, assessment: Assessment, state: State, stamp_ns: int) -> Assessment:
        """LOST, where points have led a body that was LOST to somebody else."""
        seen = self._track.seen_lately(stamp_ns) if self._track.lost and self._late is not None else None
        if seen is None or assessment.status is Status.LOST or np.linalg.norm(state.T_world_root[:3, 3] - seen[0]) <= seen[1]:
            return assessment
        reason = f"a moment ago it was more than {seen[1]:.1f} m from here"
        limbs = tuple(limb.doubted(reason) for limb in assessment.limbs)
        return replace(assessment, status=Status.LOST, reason=reason, limbs=limbs)

    def _begin_where_found(self, people: PeopleSeen, stamp_ns: int) -> bool:
        """Begin where a detector has found a body that is not known, LOST, otherwise than it seemed, or bent by images of another
        moment; whether it has.

        One that is not lost, or was not a moment ago, is near where it was, whoever else is found.
        """
        track = self._track
        known = track.start if track.lost < _LOST_SETS else None
        if self._late is None:
            return False
        here, within_m = self._near, np.inf
        if known is not None:
            here, within_m = known.T_world_root[:3, 3], _SAME_PLACE_M
        elif (seen := track.seen_lately(stamp_ns)) is not None:
            here, within_m = seen
        begin = track.engine.find(people, here) if known is None or track.spoiled else track.engine.otherwise(people, known)
        if begin is None or (here is not None and np.linalg.norm(begin.T_world_root[:3, 3] - here) > within_m):
            return False
        self._restart(begin)
        self._track.seen = track.seen
        return True

    def _go_back(self, past: list[PastSet]) -> None:
        """Go through some image sets again, the first of which has points now; where the body is not found in that, all stays."""
        if not past:
            return
        assert self._late is not None
        oldest, kept = past[0], replace(self._track, motion=copy(self._track.motion))
        begun = self._initializer is not None and self._begin_where_found(oldest.people, oldest.image_set.stamp_ns)
        if not begun and oldest.motion.predict(oldest.image_set.stamp_ns) is not None:
            self._track.motion, begun = copy(oldest.motion), True
        if begun:
            step = self._stepped(oldest.image_set, self._images(oldest.image_set), oldest.people)
            lesson, self._lesson = self._lesson, None
            if lesson is not None:
                self._take_in(lesson)
            if step.assessment.status is not Status.LOST:
                every = -(-len(past) // (_MOST_AGAIN + 1))
                for i, each in enumerate(past[1:], 1):
                    if i % every == 0 or any(each.people):
                        self._fit_again(each)
                    else:
                        self._late.add(replace(each, motion=copy(self._track.motion)))
                return
            self._track, past = kept, past[1:]
        for each in past:
            self._late.add(each)

    def _fit_again(self, past: PastSet) -> None:
        """Fit an image set anew that has been judged and learned from before."""
        assert self._late is not None
        track, image_set, before = self._track, past.image_set, copy(self._track.motion)
        prediction = self._predicted(image_set)
        assert prediction is not None
        predicted, prior = self._expected(prediction), prediction.prior()
        self._show(image_set, predicted)
        track.engine.observe(self._images(image_set), predicted, self._delays(image_set, prediction), past.people)
        fit = track.engine.refit(predicted, prior)
        track.start = fit.state
        track.motion.update(image_set.stamp_ns, fit.state, self._information(fit, prior, Assessment(Status.TRACKING, "")))
        self._late.add(PastSet(image_set, past.people, before))

    def _with_left_out(self, reason: str) -> str:
        left_out = self._trust.left_out
        return f"{reason}: {', '.join(left_out)} left out" if reason and left_out else reason

    def _take_in(self, lesson: _Lesson) -> None:
        """Learn from the images of cameras that show the body."""
        images = self._trust.look(lesson.stamp_ns, lesson.images, lesson.fit, lesson.assessment)
        if lesson.assessment.status is not Status.LOST:
            self._track.engine.learn(images, lesson.fit.state)

    def _in_first_light(self, image_set: ImageSet) -> tuple[ImageSet, list[np.ndarray | None]]:
        """The set as it would be in the light of the first one, and its images: who looks at it again sees the same colors."""
        shown = self._images(image_set)
        images = [None if pixels is None else _fixed(pixels) for pixels in self._exposures.normalized(shown)]
        pairs = zip(self.rig.names, shown, images, strict=True)
        lit = {name: pixels for name, before, pixels in pairs if pixels is not None and pixels is not before}
        if lit:
            every = (replace(i, pixels=lit[i.camera], encoding="bgr8") if i.camera in lit else i for i in image_set.images)
            image_set = replace(image_set, images=tuple(every))
        return image_set, images

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
            result.append(None if image is None else _fixed(image.bgr))
        return result

    def _expected(self, prediction: Prediction | None) -> State:
        state = (self._track.start or State.neutral(self.model)) if prediction is None else prediction.state
        return clip_to_limits(state, self.model.chain)

    def _delays(self, image_set: ImageSet, prediction: Prediction | None) -> ExposureDelays | None:
        """When each camera exposes; None where all do at once, or nobody knows how the body moves."""
        images = [image_set.get(camera.name) for camera in self.rig]
        delays_s = [0.0 if image is None else 1e-9 * (image.stamp_ns - image_set.stamp_ns) for image in images]
        return None if prediction is None or not any(delays_s) else ExposureDelays(delays_s, prediction)

    def _information(self, fit: Fit, prior: Prior | None, assessment: Assessment) -> np.ndarray | None:
        """(n_dof, n_dof) of all that was fitted to but the prediction; None where the images are not used, or the engine has
        other units."""
        doubtful = assessment.status is Status.LOST or assessment.noise or assessment.jumped
        if doubtful or not self._track.engine.in_information_units:
            return None
        H, g = np.zeros_like(fit.equations.H), np.zeros_like(fit.equations.g)
        if prior is not None:
            prior.add_to(H, g, fit.state)
        information, weights = fit.equations.H - H, assessment.dof_weights
        for spin in self._spins(fit.state):
            information = without_direction(information, spin)
        return information if weights is None else weights[:, None] * information * weights

    def _covariance(
        self,
        report: Report,
        state: State,
        prior: Prior | None,
        information: np.ndarray | None,
        evidence: ImageEvidence | None,
        assessment: Assessment,
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """(n_dof, n_dof) of ``state``, and its second-order part: by what the images say, weighted, and by the prediction, which
        is all there is of what is lost."""
        weights = assessment.dof_weights
        whole = information is not None and (weights is None or bool((weights == 1.0).all())) and not self._symmetry.has_spins
        if not assessment.limbs or whole or (prior is None and information is None):
            return report.covariance, report.second_order
        n = self.model.n_dof
        H = np.zeros((n, n)) if information is None else information.copy()
        if prior is not None:
            prior.add_to(H, np.zeros(n), state)
        if weights is not None:  # of what is not seen, the limits of its joints are known
            H[np.diag_indices(n)] += limits_information(self.model.chain, 1.0 - weights**2)
        if evidence is not None and weights is not None:
            evidence = evidence.weighted(weights, self.model.chain.link_moved_by)
        return fit_covariance(H, evidence, configured(self.model, state))

    def _accept(
        self, stamp_ns: int, state: State, information: np.ndarray | None, assessment: Assessment, first: bool
    ) -> None:
        track, lost = self._track, assessment.status is Status.LOST
        track.start = state
        if track.lost >= self.config.initialization.after_lost_sets and not lost:
            track.unproven = 0  # found again after long, as at a start
        track.lost, track.held = (track.lost + 1, track.held) if lost else (0, track.held + 1)
        if track.unproven is not None:
            any_lost = lost or any(limb.status is LimbStatus.LOST for limb in assessment.limbs)
            track.unproven = track.unproven + 1 if any_lost else None
        if not lost:
            if assessment.jumped:
                track.motion.restart(stamp_ns, state)
            else:
                track.motion.update(stamp_ns, state, information)
            if track.held >= _HELD_SETS or track.seen_lately(stamp_ns) is not None:
                track.see(stamp_ns, state)
        elif not (first and _nothing_seen(assessment)):  # else nothing has been learned: it begins again at the next image set
            track.motion.coast(stamp_ns, state)  # nothing is learned from what is taken for the body, nor how fast it is


def _same(one: State, other: State) -> bool:
    same_root = np.array_equal(one.T_world_root, other.T_world_root)
    return same_root and np.array_equal(one.joint_positions, other.joint_positions)


def _fixed(pixels: np.ndarray) -> np.ndarray:
    """An image as compiled code takes it: in one piece, not to be written into; code for any other kind is compiled apart."""
    pixels = np.ascontiguousarray(pixels)
    if pixels.flags.writeable:
        pixels = pixels.view()
        pixels.flags.writeable = False
    return pixels


def _nothing_seen(assessment: Assessment) -> bool:
    return bool(assessment.limbs) and all(limb.status is LimbStatus.UNSEEN for limb in assessment.limbs)
