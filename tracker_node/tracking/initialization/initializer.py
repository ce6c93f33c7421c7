"""From images to a state to track from: starts are detected, tried by the engine, repaired, and compared with each other.

Starts put to the test: what the engine makes of each, with doubtful limbs elsewhere, and over some image sets.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.image_set import ImageSet
from ...optimize.robust_start import best_apart
from ...parallel import Workers
from ..assessment import Assessment
from ..config import InitializationConfig
from ..engine import AnyEngine
from ..estimate import LimbReport, Status, TrackEstimate
from ..limbs.tree import limbs_of
from ..modality import Images
from .detector import PoseDetector, Start
from .parts import LimbAlternatives

NOT_GIVEN = "no initial state has been given"
_SURE = 0.6  # a start that covers so much of the evidence is taken whatever the engine says
_WORSE = 0.08  # of that share, by which an engine may make a start worse
_LONGEST_PAUSE = 8  # times that between two searches: one that fails again and again is too dear


class Initializer:
    """Asks a `PoseDetector`, then engines; parameters are those of the finder.

    Parameters
    ----------
    make_engine : an engine for trials. make_follower : a tracker that does not look for starts itself.

    Attributes
    ----------
    problem : why the last `find` has found nothing.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: InitializationConfig,
        backgrounds: Mapping[str, np.ndarray | list],
        workers: Workers,
        make_engine: Callable[[], AnyEngine],
        make_follower: Callable[[], Follower],
    ):
        self._model, self._config = model, config
        self._finder = PoseDetector(rig, model, config, backgrounds, workers)
        self._mended = LimbRepair(model, self._finder.alternatives)
        self._make_engine, self._make_follower = make_engine, make_follower
        self._engine: AnyEngine | None = None
        self._followers: list[Follower] = []
        self.reset()

    def reset(self) -> None:
        """Forget all images."""
        self._finder.reset()
        self.problem = NOT_GIVEN
        self.stop()

    def stop(self) -> None:
        """The search is over; what has moved is remembered, the memory of the search freed."""
        self._contest: Contest | None = None
        self._pause = self._failed = 0
        if self._engine is not None or self._followers:
            self._engine, self._followers = None, []
            gc.collect()  # some hundred megabytes, in reference cycles

    @property
    def busy(self) -> bool:
        """Whether the next image sets may bring what this one has not."""
        return self._contest is not None or self._finder.watching

    def watch(self, images: Images) -> None:
        """Take in an image set in which nothing has to be found."""
        self._finder.watch(images)

    def find(
        self, images: Images, image_set: ImageSet, around: State | None = None,
        allowed: Callable[[list[State]], list[State]] = list,
    ) -> tuple[Follower, TrackEstimate] | None:  # fmt: skip
        """Find the body; where that fails, ``problem`` says why, and the next few image sets are only watched.

        Parameters
        ----------
        images, image_set : BGR pixels of all cameras, and the set that they are of.
        around : where the body was last.
        allowed : those of some states in which the body may be.

        Returns
        -------
        A tracker that has the body, and its estimate for this image set; None without.
        """
        if self._contest is not None:
            self._finder.watch(images)
            return self._continued(self._contest, image_set)
        if self._pause > 0:
            self._pause -= 1
            self._finder.watch(images)
            return None
        starts = self._finder.find(images, around)
        self.problem = self._finder.problem
        if not starts:
            self._pause = 0 if self._finder.watching else self._config.interval_sets
            return None
        holding = self._chosen(starts, images, image_set)
        states = allowed(holding)
        if not states:
            self._rest()
            covers = f"{100 * starts[0].score:.0f} % of what stands out"
            self.problem = f"the best of {len(starts)} poses does not hold; it covers {covers}"
            if holding:
                self.problem = "the colors that were learned speak against all poses that hold"
            return None
        while len(self._followers) < len(states):
            self._followers.append(self._make_follower())
        self._contest = Contest(self._followers[: len(states)], states, self._config.tracked_sets)
        return self._continued(self._contest, image_set)

    def _rest(self) -> None:
        """Pause after poses have been tried in vain, longer with each time."""
        self._pause = self._config.interval_sets * min(2**self._failed, _LONGEST_PAUSE)
        self._failed += 1

    def _continued(self, contest: Contest, image_set: ImageSet) -> tuple[Follower, TrackEstimate] | None:
        found = contest.step(image_set)
        sets = f"{contest.sets} of {self._config.tracked_sets} image sets"
        several = len(contest) > 1
        self.problem = f"{len(contest)} poses are compared with each other ({sets})" if several else f"one pose is tried ({sets})"
        if found is None:
            return None
        self._contest = None
        if found[1].status is Status.LOST and found[0].log_ratio is not None:
            self._rest()
            self.problem = f"the best pose does not hold: {found[1].status_reason}"
            return None
        self._followers = [other for other in self._followers if other is not found[0]]
        return found

    def _chosen(self, starts: Sequence[Start], images: Images, image_set: ImageSet) -> list[State]:
        """States that go on, the best first."""
        engine = self._engine = self._engine or self._make_engine()
        coverage = self._finder.coverage()

        def attempt(state: State, near: bool = True) -> Trial:
            trial = tried(engine, images, image_set, state, near)
            return replace(trial, uncovered=coverage.uncovered(trial.state))

        trials = [attempt(start.state, False) for start in starts]
        if any(trial.assessment.log_ratio is None for trial in trials):
            return self._by_share(starts, trials)
        # With a limb elsewhere, the right one can stand far behind another whose limbs happen to be hidden; not behind one that
        # has been mended.
        hopeful = rivals(self._model, trials, self._finder.size_m, self._config.repaired_candidates, HOPEFUL)
        mended: list[Trial] = []
        for trial in hopeful:
            if not mended or trial.standing > HOPEFUL * max(other.standing for other in mended):
                mended.append(self._mended(trial, attempt))
        best = rivals(self._model, mended + trials, self._finder.size_m, self._config.tracked_candidates)
        return [trial.state for trial in best if trial.standing > 0.0]

    def _by_share(self, starts: Sequence[Start], trials: Sequence[Trial]) -> list[State]:
        """The state that covers most of the evidence, of an engine that does not compare states; none if it does not hold."""
        shares = self._finder.shares([trial.state for trial in trials] + [start.state for start in starts])
        refined, unrefined = shares[: len(trials)], shares[len(trials) :]
        best = int(np.argmax(np.maximum(refined, unrefined)))
        held, state = trials[best].assessment.status is not Status.LOST, trials[best].state
        if refined[best] < unrefined[best] - _WORSE:  # the engine has left what the body was found by
            held, state = False, starts[best].state
        return [state] if held or max(refined[best], unrefined[best]) > _SURE else []


_DOUBTFUL = 0.05  # probability of being lost, of a limb that is searched elsewhere...
_LOST = 0.5  # ...and that teaches nothing about the rest of the body
_ELSEWHERE = 4  # places that are tried for it
_ROUNDS = 2
_UNCOVERED_COUNTS = 2.0  # times as much as what is covered, a share for a share
_BETTER = 0.01  # fraction of the standing that another place of a limb must add
_RIVAL = 0.85  # of the best one's standing: with less, a start is out
HOPEFUL = 0.5  # the same before doubtful limbs have been searched elsewhere
_SAME = 0.05  # of the body's size: states whose landmarks differ less, on average, are the same


def standing(log_ratio: float, limbs: Sequence[LimbReport]) -> float:
    """A state's log-likelihood ratio, less for every limb that is likely lost: a clear contour may be another thing's.

    Parameters
    ----------
    log_ratio : of the images.
    limbs : with their probabilities of being lost.

    Returns
    -------
    ``log_ratio`` times the mean probability that a limb is not lost, where it is positive.
    """
    if log_ratio <= 0.0 or not limbs:
        return log_ratio
    return log_ratio * float(np.mean([1.0 - limb.probability for limb in limbs]))


@dataclass(frozen=True, eq=False)
class Trial:
    """What the engine has made of a start in one image set. ``uncovered``: see `StartCoverage`."""

    state: State
    assessment: Assessment
    uncovered: float = 0.0

    @property
    def standing(self) -> float:
        """See `standing`, less for what is left uncovered; the engine has to have a log_ratio."""
        assert self.assessment.log_ratio is not None
        found = standing(self.assessment.log_ratio, self.assessment.limbs)
        return found * (1.0 - min(self.uncovered, 1.0)) ** _UNCOVERED_COUNTS if found > 0.0 else found


def tried(engine: AnyEngine, images: Images, image_set: ImageSet, start: State, near: bool = False) -> Trial:
    """A fit by an engine that has been reset.

    Parameters
    ----------
    engine, images, image_set : it learns from these images, and fits to them.
    start : state to begin at.
    near : most of the body is just there.

    Returns
    -------
    The state with its assessment.
    """
    result = engine.attempt(images, start, near=near)
    return Trial(result.state, engine.assess(result, image_set))


class LimbRepair:
    """Searches the doubtful limbs of a start elsewhere; the engine decides what is better."""

    def __init__(self, model: ArticulatedModel, alternatives: LimbAlternatives):
        self._limbs, self._alternatives = limbs_of(model), alternatives

    def __call__(self, trial: Trial, attempt: Callable[[State], Trial]) -> Trial:
        """The best that `attempt` has made of ``trial`` and what differs from it in one limb after the other."""
        for _ in range(_ROUNDS):
            before = trial
            doubts = [limb.probability for limb in trial.assessment.limbs]
            for i in sorted(range(1, len(doubts)), key=lambda i: -doubts[i]):
                if trial.assessment.limbs[i].probability > _DOUBTFUL:
                    trial = self._with_limb_elsewhere(i, trial, attempt)
            if trial is before:
                break
        return trial

    def _with_limb_elsewhere(self, i: int, trial: Trial, attempt: Callable[[State], Trial]) -> Trial:
        doubtful = np.zeros_like(self._limbs[0].shapes)
        for limb, said in zip(self._limbs[1:], trial.assessment.limbs[1:], strict=True):
            doubtful |= limb.shapes & (said.probability > _LOST)
        others = [attempt(state) for state in self._alternatives.find(trial.state, self._limbs[i], doubtful, _ELSEWHERE)]
        best = max(others, key=lambda other: other.standing, default=trial)
        return best if best.standing > trial.standing + _BETTER * abs(trial.standing) else trial


class Follower(Protocol):
    """What goes on from a start: a tracker of its own. ``log_ratio`` is that of its last assessment."""

    @property
    def log_ratio(self) -> float | None:
        """Of the last assessment."""
        ...

    def reset(self) -> None:
        """Forget everything."""
        ...

    def set_state(self, state: State) -> None:
        """Where the body is in the next image set."""
        ...

    def step(self, image_set: ImageSet) -> TrackEstimate:
        """Follow it there."""
        ...


class Contest:
    """Several starts, followed side by side until one of them is clearly the best, or some image sets have passed."""

    def __init__(self, followers: Sequence[Follower], starts: Sequence[State], most_sets: int):
        self._followers, self._most_sets = list(followers), most_sets
        self._totals = np.zeros(len(self._followers))
        self.sets = 0
        for follower, state in zip(followers, starts, strict=True):
            follower.reset()
            follower.set_state(state)

    def __len__(self) -> int:
        return len(self._followers)

    def step(self, image_set: ImageSet) -> tuple[Follower, TrackEstimate] | None:
        """The winner, and what it says of this image set; None as long as there is none."""
        estimates = [follower.step(image_set) for follower in self._followers]
        self.sets += 1
        pairs = zip(self._followers, estimates, strict=True)
        self._totals += [standing(follower.log_ratio or 0.0, estimate.limbs) for follower, estimate in pairs]
        best = int(np.argmax(self._totals))
        winner, estimate = self._followers[best], estimates[best]
        stay = np.flatnonzero(self._totals >= self._totals[best] - (1.0 - _RIVAL) * abs(self._totals[best]))
        self._followers, self._totals = [self._followers[i] for i in stay], self._totals[stay]
        sure = len(stay) == 1 and (estimate.status is Status.TRACKING or winner.log_ratio is None)
        return (winner, estimate) if sure or self.sets >= self._most_sets else None


def rivals(model: ArticulatedModel, trials: Sequence[Trial], size_m: float, n: int, share: float = _RIVAL) -> list[Trial]:
    """The best trials that are not the same as a better one.

    Parameters
    ----------
    model, trials : body, and its trials.
    size_m : of the body; landmarks nearer than a fraction of it are the same.
    n : at most.
    share : fraction of the best one's standing that the others need.

    Returns
    -------
    The best first.
    """
    best_first = sorted(trials, key=lambda trial: -trial.standing)
    able = best_first[:1] + [trial for trial in best_first[1:] if trial.standing > share * best_first[0].standing]
    points = [Configuration(model, trial.state).landmarks_world for trial in able]

    def same(i: int, chosen: list[int]) -> bool:
        own = points[i]
        return any(len(own) and np.linalg.norm(own - points[j], axis=1).mean() < _SAME * size_m for j in chosen)

    return [able[i] for i in best_apart(range(len(able)), same, n)]
