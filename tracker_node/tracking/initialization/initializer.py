"""From images to a state to track from: starts are detected, tried by the engine, repaired, and compared with each other."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...observation.image_set import ImageSet
from ...parallel import Workers
from ..config import InitializationConfig
from ..engine import AnyEngine
from ..estimate import Status, TrackEstimate
from ..modality import Images
from .detector import PoseDetector, Start
from .trials import HOPEFUL, Contest, Follower, LimbRepair, Trial, rivals, tried

NOT_GIVEN = "no initial state has been given"
_SURE = 0.6  # a start that covers so much of the evidence is taken whatever the engine says
_WORSE = 0.08  # of that share, by which an engine may make a start worse


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
        self._pause = 0
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

    def find(self, images: Images, image_set: ImageSet, around: State | None = None) -> tuple[Follower, TrackEstimate] | None:
        """Find the body; where that fails, ``problem`` says why, and the next few image sets are only watched.

        Parameters
        ----------
        images, image_set : BGR pixels of all cameras, and the set that they are of.
        around : where the body was last.

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
        states = self._chosen(starts, images, image_set)
        if not states:
            self._pause = self._config.interval_sets
            covers = f"{100 * starts[0].score:.0f} % of what stands out"
            self.problem = f"the best of {len(starts)} poses does not hold; it covers {covers}"
            return None
        while len(self._followers) < len(states):
            self._followers.append(self._make_follower())
        self._contest = Contest(self._followers[: len(states)], states, self._config.tracked_sets)
        return self._continued(self._contest, image_set)

    def _continued(self, contest: Contest, image_set: ImageSet) -> tuple[Follower, TrackEstimate] | None:
        found = contest.step(image_set)
        self.problem = (
            f"{len(contest)} poses are compared with each other ({contest.sets} of {self._config.tracked_sets} image sets)"
        )
        if found is None:
            return None
        self._contest = None
        if found[1].status is Status.LOST and found[0].log_ratio is not None:
            self._pause = self._config.interval_sets
            self.problem = f"the best pose does not hold: {found[1].status_reason}"
            return None
        self._followers = [other for other in self._followers if other is not found[0]]
        return found

    def _chosen(self, starts: Sequence[Start], images: Images, image_set: ImageSet) -> list[State]:
        """States that go on, the best first."""
        engine = self._engine = self._engine or self._make_engine()
        coverage = self._finder.coverage()

        def attempt(state: State) -> Trial:
            trial = tried(engine, images, image_set, state)
            return replace(trial, uncovered=coverage.uncovered(trial.state))

        trials = [attempt(start.state) for start in starts]
        if any(trial.assessment.log_ratio is None for trial in trials):
            return self._by_share(starts, trials)
        # With a limb elsewhere, the right one can stand far behind another whose limbs happen to be hidden.
        hopeful = rivals(self._model, trials, self._finder.size_m, self._config.repaired_candidates, HOPEFUL)
        mended = [self._mended(trial, attempt) for trial in hopeful]
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
