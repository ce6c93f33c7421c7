"""The engine of a tracker: modalities, how states are fitted to them, and how the fits are assessed.

The `Tracker` knows time: it predicts, asks its engine, and uses the answer or not. An engine knows the images of one set: for
each set the tracker calls `observe`, `fit`, then `assess`, `report` and `learn`, in this order; `begin` comes before them on the
first set. Which parts an engine has, `engines.make_engine` says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from ..objective.constraints.prior import Prior, SumObjective
from ..objective.normal_equations import LeastSquaresObjective
from ..observation.image_set import ImageSet
from ..optimize.fitter import Fit
from ..optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from .assessment import Assessment, Report, inverse_covariance
from .config import JointConfig
from .estimate import LimbStatus, Status
from .modality import Images, Modality, PartColors, PeopleSeen, Persons
from .motion.model import ExposureDelays

_NO_WORSE, _AS_GOOD = 1.1, 0.01  # times, and beyond, its own best score, to which the first agrees with the second
_DENIED_SETS = 15  # in which a detector sees people, and none where the body is, after which that is LOST
_TRACE = 1e-9  # of the largest entry of an information's diagonal


class Fits(Protocol):
    """Finds the state of a body near another one."""

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """The state that suits the images best.

        Parameters
        ----------
        start : state to begin at.
        first : of a first image set: longer.
        prior : in information units; solvers with other units leave it out. None: the start, as ``motion.stay_position`` and
            ``motion.stay_angle`` say.

        Returns
        -------
        The fit.
        """
        ...

    def refit(self, start: State, prior: Prior | None) -> Fit:
        """A fit without searches: of a set that is not the newest any more, or where something else knows where the body is.

        Parameters
        ----------
        start, prior : as of `fit`.

        Returns
        -------
        The fit.
        """
        return self.fit(start, False, prior)


class Assesses(Protocol):
    """Says whether a fit is the body, and how exactly."""

    def assess(self, fit: Any, image_set: ImageSet) -> Assessment:
        """Whether that is the body.

        Parameters
        ----------
        fit : of the images of ``image_set``.
        image_set : its cameras.

        Returns
        -------
        Status, and what goes with it.
        """
        ...

    def report(self, fit: Any, image_set: ImageSet) -> Report:
        """Residuals and covariance.

        Parameters
        ----------
        fit : of the images of ``image_set``.
        image_set : has the stamps of the cameras.

        Returns
        -------
        Of all cameras.
        """
        ...


class Finds(Protocol):
    """Finds a body by what a detector has found."""

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        """Where the body begins, without knowing where it is.

        Parameters
        ----------
        people : whom a detector has found, by camera.
        near : (3,) meters, world: of several people, the one there; None: where the cameras look.

        Returns
        -------
        None where nobody can be the body.
        """
        ...

    def otherwise(self, people: PeopleSeen, state: State) -> State | None:
        """How the body stands, where the points of half of the cameras have contradicted its states for some image sets.

        Parameters
        ----------
        people, state : whom a detector has found, by camera; where the body is taken to be.

        Returns
        -------
        None where it is as it is taken to be, or nothing suits clearly better.
        """
        return None


class Claims(Protocol):
    """Says who of the people in the images may be the body, where several bodies are followed."""

    def claims(self, people: PeopleSeen, expected: State) -> list[np.ndarray]:
        """How well everybody suits a body where it is expected.

        Parameters
        ----------
        people, expected : whom a detector has found, by camera; the body.

        Returns
        -------
        By camera (n_people,) log-likelihood ratios; minus infinity of those who are not the body.
        """
        return []

    def candidates(self, people: PeopleSeen, near: np.ndarray | None = None) -> list[tuple[State, float]]:
        """Where the body may begin.

        Parameters
        ----------
        people, near : of `Finds.find`.

        Returns
        -------
        States, and what each point costs in them, in information units; those nearest to a place first.
        """
        return []


class Solver(Fits, Protocol):
    """Finds the state of a body in the present images: stages of fits, and searches for what they do not reach.

    One that remembers nothing from fit to fit has `fit` alone.
    """

    def reset(self) -> None:
        """Forget everything."""
        return

    def restart(self) -> bool:
        """A state is handed over; whether it is to be taken as it is, with what has been learned."""
        return False

    def support(self, state: State) -> float | None:
        """Log-likelihood that the present images gain by a body in ``state``; None before one was tracked."""
        return None

    def fit_start(self, start: State) -> Fit:
        """Fit from a start that is one of many: without searches, which only the best are worth."""
        return self.fit(start, True, None)

    def remember(self, fit: Fit, assessment: Assessment) -> None:
        """Take in how a fit was assessed.

        Parameters
        ----------
        fit, assessment : the last fit, and its assessment.
        """
        return


class Judge(Assesses, Protocol):
    """Assesses fits; one that remembers nothing from fit to fit has `assess` and `report` alone."""

    def reset(self) -> None:
        """Forget everything."""
        return

    def restart(self) -> None:
        """A state is handed over; its quality is unknown."""
        return


class Choice(Finds, Claims, Protocol):
    """Chooses who of the people in the images is the body."""

    @property
    def doubt_of_size(self) -> str:
        """Why the body may not be the person's; empty where it may."""
        ...

    @property
    def is_of_another_size(self) -> bool:
        """Whether the body cannot be the person's."""
        ...

    @property
    def is_contradicted(self) -> bool:
        """Whether points of half of the cameras contradict it, and `otherwise` has not yet been asked why."""
        ...

    def reset(self) -> None:
        """Forget everything."""
        ...

    def restart(self) -> None:
        """A state has been handed over."""
        ...

    def denied_sets(self, stamp_ns: int) -> int:
        """Image sets in a row, until the present one of this stamp, in which somebody was seen, and nobody was the body."""
        ...

    def choose(self, people: PeopleSeen, expected: State) -> Persons:
        """The body in each camera.

        Parameters
        ----------
        people : whom a detector has found, by camera.
        expected : where the body is expected.

        Returns
        -------
        By camera; None where nobody is the body.
        """
        ...


class AnyEngine(Fits, Assesses, Finds, Claims, Protocol):
    """Finds a body near a state in the images of one set; deterministic in what it has been given since `reset`.

    Attributes
    ----------
    in_information_units : whether the normal equations of fits are those of minus twice a log posterior, so that a filter can use
        them.
    """

    in_information_units: bool

    @property
    def doubt_of_size(self) -> str:
        """Why the body may not be that of the person who is tracked with it; empty where it may, or nothing tells."""
        return ""

    @property
    def surfaces(self) -> np.ndarray | None:
        """(n_shapes, 4) meters: where the surface of each part is beside its shape; None where no modality follows that."""
        return None

    @property
    def colors(self) -> PartColors | None:
        """What the body looks like; None where no modality learns that."""
        return None

    def reset(self) -> None:
        """Forget everything learned."""

    def begin(self, images: Images, start: State, *, known: bool = False, people: PeopleSeen = ()) -> State:
        """Learn what is needed from the first image set; what a tracked body has taught is kept.

        Parameters
        ----------
        images : in which the body is near ``start``.
        start : where the body is said to be.
        known : the body is just there, as another tracker has found it, and nothing is fitted.
        people : whom a detector has found, by camera; empty where none is used.

        Returns
        -------
        A better start.
        """
        ...

    def attempt(self, images: Images, start: State, *, near: bool = False) -> Fit:
        """What a start is worth, one of many: the engine begins anew with it, without the searches that only the best are worth.

        Parameters
        ----------
        images : in which the body may be near ``start``.
        start : where it may be.
        near : most of the body is just there.

        Returns
        -------
        The fit.
        """
        self.reset()
        state = self.begin(images, start)
        self.observe(images, state)
        return self.fit(state, True)

    def observe(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, people: PeopleSeen = ()
    ) -> None:
        """Take the images of a set.

        Parameters
        ----------
        images : by camera.
        expected : where the body is expected; None: not known, and nothing is compared.
        delays : when each camera exposes; None: all at one time.
        people : whom a detector has found, by camera; empty where none is used.
        """

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        return None

    def support(self, images: Images, state: State) -> float | None:
        """How much speaks for a body somewhere, by what was learned while it was tracked.

        Parameters
        ----------
        images, state : where the body may be in them.

        Returns
        -------
        Log-likelihood that the images gain by it; None where nothing has been learned that could tell.
        """
        return None

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> Fit: ...

    def learn(self, images: Images, state: State) -> None:
        """Learn what the body and its surroundings look like now.

        Parameters
        ----------
        images : those last observed.
        state : of the body in them.
        """


class Engine(AnyEngine):
    """An engine of one solver and one judge.

    Parameters
    ----------
    modalities : the first one leads: it says how often is learned from a first image set.
    solver, judge : of the same modalities.
    in_information_units : see `AnyEngine`.
    choice : says who the body is; None: no modality looks at people.
    """

    def __init__(
        self, modalities: Sequence[Modality], solver: Solver, judge: Judge, in_information_units: bool,
        choice: Choice | None = None,
    ):  # fmt: skip
        self.modalities, self.solver, self.judge, self.choice = tuple(modalities), solver, judge, choice
        self.in_information_units = in_information_units
        self._weights: np.ndarray | None = None

    @property
    def doubt_of_size(self) -> str:
        return "" if self.choice is None else self.choice.doubt_of_size

    @property
    def surfaces(self) -> np.ndarray | None:
        return next((modality.surfaces for modality in self.modalities if modality.surfaces is not None), None)

    @property
    def colors(self) -> PartColors | None:
        return next((modality.colors for modality in self.modalities if modality.colors is not None), None)

    def reset(self) -> None:
        for modality in self.modalities:
            modality.reset()
        self.judge.reset()
        self.solver.reset()
        if self.choice is not None:
            self.choice.reset()
        self._weights = None

    def begin(self, images: Images, start: State, *, known: bool = False, people: PeopleSeen = ()) -> State:
        """Learn what is needed from the first image set: learn, fit, and learn again, since the first pose given is rarely exact.

        What a tracked body has taught is kept.
        """
        self.judge.restart()
        if self.choice is not None:
            self.choice.restart()
        if self.solver.restart():
            return start
        self._weights = None
        lead = self.modalities[0]
        lessons = lead.lessons(known)
        for i, lesson in enumerate(lessons):
            lead.learn_first(images, start, lesson)
            if i < len(lessons) - 1:
                self.observe(images, start, people=people)
                start = self.fit(start, first=True).state
        self._learn_others(images, start)
        return start

    def _learn_others(self, images: Images, state: State) -> None:
        for other in self.modalities[1:]:
            for lesson in other.lessons(True)[-1:]:
                other.learn_first(images, state, lesson)

    def attempt(self, images: Images, start: State, *, near: bool = False) -> Fit:
        self.reset()
        lead = self.modalities[0]
        for lesson in lead.lessons(False)[1 if near else 0 :] or (None,):  # textures are known, and have no lessons
            if lesson is not None:
                lead.learn_first(images, start, lesson)
            self._learn_others(images, start)
            self.observe(images, start)
            fit = self.solver.fit_start(start)
            start = fit.state
        return fit

    def observe(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, people: PeopleSeen = ()
    ) -> None:
        persons = () if self.choice is None or expected is None else self.choice.choose(people, expected)
        for modality in self.modalities:
            modality.set_images(images, expected, delays, persons)

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        return None if self.choice is None else self.choice.find(people, near)

    def claims(self, people: PeopleSeen, expected: State) -> list[np.ndarray]:
        return [] if self.choice is None else self.choice.claims(people, expected)

    def otherwise(self, people: PeopleSeen, state: State) -> State | None:
        return None if self.choice is None else self.choice.otherwise(people, state)

    def candidates(self, people: PeopleSeen, near: np.ndarray | None = None) -> list[tuple[State, float]]:
        return [] if self.choice is None else self.choice.candidates(people, near)

    def support(self, images: Images, state: State) -> float | None:
        self.observe(images, state)
        return self.solver.support(state)

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> Fit:
        """Fit the body by the engine's solver."""
        return self.solver.fit(start, first, prior)

    def refit(self, start: State, prior: Prior | None) -> Fit:
        return self.solver.refit(start, prior)

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Assess a fit by the engine's judge; the solver remembers it."""
        assessment = self.judge.assess(fit, image_set)
        if self.choice is not None and self.choice.denied_sets(image_set.stamp_ns) >= _DENIED_SETS:
            assessment = _denied(assessment)
        if self.choice is not None and (doubt := self.choice.doubt_of_size):
            assessment = _doubted(assessment, doubt, self.choice.is_of_another_size)
        if self.choice is not None and self.choice.is_contradicted:
            assessment = _doubted(assessment, "points of half of the cameras contradict it", True)
        self._weights = assessment.part_weights
        self.solver.remember(fit, assessment)
        return assessment

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        return self.judge.report(fit, image_set)

    def learn(self, images: Images, state: State) -> None:
        for modality in self.modalities:
            modality.learn(images, state, self._weights)


class InformationOf(Protocol):
    """A modality in gray levels, whose correspondences can be had in information units.

    Attributes
    ----------
    leads : whether it tells enough of the body to say where that is, before another one refines it.
    """

    leads: bool

    def information_at(self, state: State) -> tuple[LeastSquaresObjective, float]:
        """Correspondences at ``state`` without priors, and their unit in units of information."""
        ...


def _doubted(assessment: Assessment, doubt: str, certain: bool) -> Assessment:
    """Of a body that points speak against: why it is in trouble, and that it is where that is certain."""
    if assessment.status is Status.TRACKING and not certain:
        return assessment
    status = Status.DEGRADED if assessment.status is Status.TRACKING else assessment.status
    limbs = tuple(limb.doubted(doubt) for limb in assessment.limbs) if certain else assessment.limbs
    return replace(assessment, status=status, reason="; ".join(filter(None, (assessment.reason, doubt))), limbs=limbs)


def _denied(assessment: Assessment) -> Assessment:
    """Of a body where people are seen, but nobody where it is."""
    if assessment.status is Status.LOST:
        return assessment
    reason = "people are seen, but nobody where the body is"
    if assessment.status is Status.TRACKING:  # it, or the detector, is wrong in every camera
        reason += ", though its outline fits: are names and cameras of the points right?"
    return replace(assessment, status=Status.LOST, reason=reason, limbs=tuple(limb.doubted(reason) for limb in assessment.limbs))


class SequentialEngine(AnyEngine):
    """Two engines in one step: the first says where the body is, the second from there on how exactly.

    Status and covariance are those of the second; where the first does not find the body, the second begins where it is expected.

    Parameters
    ----------
    first, second : the second in information units.
    """

    in_information_units = True

    def __init__(self, first: Engine, second: Engine):
        self._first, self._second = first, second
        self._images: Images = ()
        self._delays: ExposureDelays | None = None
        self._waiting = True
        self._lost, self._jumped = True, False

    @property
    def _leads(self) -> bool:
        """Whether the first tells enough of the body to say where that is; else the second is alone."""
        return True

    @property
    def colors(self) -> PartColors | None:
        return self._second.colors

    def reset(self) -> None:
        self._first.reset()
        self._second.reset()

    def begin(self, images: Images, start: State, *, known: bool = False, people: PeopleSeen = ()) -> State:
        """The second learns where the first has led."""
        led = self._first.begin(images, start, known=known)
        return self._second.begin(images, led if self._leads else start, known=known)

    def observe(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, people: PeopleSeen = ()
    ) -> None:
        """What the second sees depends on what the first has found, and is taken in `fit`."""
        self._images, self._delays, self._waiting = images, delays, expected is None
        if self._leads:
            self._first.observe(images, expected, delays)

    def support(self, images: Images, state: State) -> float | None:
        return self._second.support(images, state)

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> Fit:
        """Fit by the first, then by the second."""
        found = self._first.fit(start, first) if self._leads else None
        assessment = None if found is None or self._waiting else self._first.assess(found, ImageSet(0, ()))
        self._lost, self._jumped = assessment is None or assessment.status is Status.LOST, False
        if not (found is None or assessment is None or self._lost):
            start, self._jumped, prior = found.state, assessment.jumped, self._prior(found.state, prior)
        self._second.observe(self._images, None if self._waiting else start, self._delays)
        fit = self._fit_second(start, first, prior)
        return fit if found is None else _counted(fit, found.iterations, found.evaluations)

    def _fit_second(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """The fit of the second, once it is known whether the first is lost."""
        return self._second.fit(start, first, prior)

    def _prior(self, found: State, prior: Prior | None) -> Prior | None:
        """What the second begins with, besides where the first has found the body."""
        return prior

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Assess the fit of the second; the first knows whether the body was found far from where it was expected."""
        assessment = self._second.assess(fit, image_set)
        return assessment if self._lost else replace(assessment, jumped=self._jumped)

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals and covariance of the second."""
        return self._second.report(fit, image_set)

    def learn(self, images: Images, state: State) -> None:
        self._first.learn(images, state)
        self._second.learn(images, state)


class JointEngine(SequentialEngine):
    """Two engines in one step, and then both in one least-squares problem (named as what comes next by Knossow et al., 2008).

    The normal equations of the first, divided by the variance of one pixel's color and by how many neighbors share one error,
    are an inverse covariance like those of the second, so the two are added, each divided by what its covariances have to be
    multiplied with to agree with errors. Where the first does not find the body, or does not lead, the second is alone.

    Parameters
    ----------
    first, second : as of `SequentialEngine`.
    beside : the first one's modality.
    chain : kinematics of the body.
    config : parameters.
    """

    def __init__(self, first: Engine, second: Engine, beside: InformationOf, chain: KinematicChain, config: JointConfig):
        super().__init__(first, second)
        self._beside, self._chain, self._config = beside, chain, config

    @property
    def _leads(self) -> bool:
        return self._beside.leads

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> Fit:
        """Fit one after the other, then to the sum of both."""
        fit = super().fit(start, first, prior)
        if self._lost:
            return fit
        options = LevenbergMarquardtOptions(max_iterations=self._config.iterations, tolerance=1e-3)
        alone = fit.objective
        for _ in range(self._config.passes):
            correspondences, information = self._beside.information_at(fit.state)
            both = SumObjective([alone, correspondences], [1.0, information / self._config.color_scale])
            found = minimize(both, fit.state, self._chain, options)
            fit = _counted(
                replace(
                    fit, state=found.state, equations=found.equations, converged=found.converged, objective=both,
                    iterations=found.iterations, evaluations=found.evaluations,
                ),
                fit.iterations, fit.evaluations,
            )  # fmt: skip
        return fit

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals and covariance; where the second alone would have the body is left out: the state rests on both."""
        report = super().report(fit, image_set)
        if self._lost or report.images is None:
            return report
        return replace(report, images=replace(report.images, gradient=None))


class Scored(Protocol):
    """A modality in gray levels that says what they tell of a state, and scores states by itself."""

    def information_of(self, state: State) -> np.ndarray:
        """(n_dof, n_dof) inverse covariance of a state that was fitted to the present images."""
        ...

    def score_of(self, state: State) -> float:
        """From 0, all is as it should be, to 1."""
        ...


class LedEngine(SequentialEngine):
    """Two engines in one step: what the first one's images tell of the state is a prior of the second.

    A body whose own picture is found is where that is, whatever around it looks like its outline: where the second leads away
    from it, the first is alone, and the status is the better of both.

    Parameters
    ----------
    first, second : as of `SequentialEngine`.
    beside : the first one's modality.
    """

    def __init__(self, first: Engine, second: Engine, beside: Scored):
        super().__init__(first, second)
        self._beside = beside
        self._known: tuple[State, Prior] | None = None  # where the first has the body, and what is known of it besides
        self._alone = False

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> Fit:
        """Fit by the first, then by the second with what the first knows."""
        self._known, self._alone = None, False
        fit = super().fit(start, first, prior)
        if self._known is None:
            return fit
        found, known = self._known
        self._alone = self._beside.score_of(fit.state) > _NO_WORSE * self._beside.score_of(found) + _AS_GOOD
        if not self._alone:
            return fit
        H, g = np.zeros_like(fit.equations.H), np.zeros_like(fit.equations.g)
        cost = known.add_to(H, g, known.mean)
        return replace(fit, state=known.mean, equations=replace(fit.equations, H=H, g=g, cost=cost))

    def _fit_second(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """A fit without searches where the first leads: its images know which of the poses with such contours it is."""
        return super()._fit_second(start, first, prior) if first or self._lost else self._second.refit(start, prior)

    def _prior(self, found: State, prior: Prior | None) -> Prior:
        """The prediction and the images of the first, as one normal distribution about where both have the body."""
        H = self._beside.information_of(found)
        g = np.zeros(len(H))
        if prior is not None:
            prior.add_to(H, g, found)
        H[np.diag_indices_from(H)] += _TRACE * max(float(np.diag(H).max()), 1.0)
        known = Prior(found.retract(-np.linalg.solve(H, g)), H)
        self._known = found, known
        return known

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """The better of both assessments."""
        of_second = super().assess(fit, image_set)
        of_first = None if self._lost else self._first.assess(replace(fit, jumped=self._jumped), image_set)
        if of_first is None or of_first.status is not Status.TRACKING or of_second.status is Status.TRACKING:
            return of_second
        limbs = tuple(replace(limb, status=LimbStatus.TRACKING, reason="") for limb in of_second.limbs)
        parts, dofs = of_second.part_weights, of_second.dof_weights
        return replace(
            of_second, status=Status.TRACKING, reason="", noise=False, limbs=limbs,
            part_weights=None if parts is None else np.ones_like(parts), dof_weights=None if dofs is None else np.ones_like(dofs),
        )  # fmt: skip

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Residuals of the second; where the first is alone, the covariance is that of what it knows."""
        report = super().report(fit, image_set)
        if not self._alone:
            return report
        return replace(report, covariance=inverse_covariance(fit.equations.H, 1.0), images=None, second_order=None)


def _counted(fit: Fit, iterations: int, evaluations: int) -> Fit:
    """With iterations and evaluations of what came before."""
    return replace(fit, iterations=fit.iterations + iterations, evaluations=fit.evaluations + evaluations)
