"""The loop of every run, live or offline: image sets into the tracker, which is reset where stamps go back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..errors import TrackerError
from ..model.configuration import State
from ..observation.image_set import ImageSet
from ..tracking.bodies import Bodies
from ..tracking.estimate import Status, TrackEstimate


class Steppable(Protocol):
    """What the loop needs of a tracker."""

    def estimate(self, image_set: ImageSet) -> TrackEstimate: ...
    def learn(self) -> None: ...
    def reset(self) -> None: ...
    def set_state(self, state: State) -> None: ...
    def reinitialize(self, near: np.ndarray | None = None) -> None: ...
    def take_over(self, other: Any, image_set: ImageSet) -> None:
        """Go on with the body as another tracker has left it.

        Parameters
        ----------
        other : the tracker that has tracked until now.
        image_set : the latest that it has tracked.
        """


Prepare = Callable[[Any, ImageSet], ImageSet]
"""Adds to an image set what a tracker (the first argument) will need of it."""


@dataclass(frozen=True, eq=False)
class StartRequest:
    """How the tracker is to begin with the next image set, and the state at which; None: not at a given one.

    ``forgets_state``: where the body was does not matter any more; ``forgets_clock``: neither do the stamps. ``body``: of several
    bodies, the one that is meant; "": all.
    """

    tell: Callable[[Steppable], None]
    state: State | None = None
    forgets_state: bool = False
    forgets_clock: bool = False
    body: str = ""


class TrackingLoop:
    """Steps a tracker through image sets.

    `SetFormation` makes the sets of images; whoever runs the loop says where images come from and where estimates go.

    Parameters
    ----------
    tracker : None while it cannot be made.
    prepare : called before each step; None: image sets are tracked as they come.

    Attributes
    ----------
    tracker : None while it cannot be made.
    tracked, tracked_set : the latest estimate of a tracker since it began; its image set, as it was tracked.
    request : how the tracker was asked to begin; None once it has tracked an image set since.
    """

    def __init__(self, tracker: Steppable | None = None, prepare: Prepare | None = None):
        self.tracker, self._prepare = tracker, prepare
        self.tracked: TrackEstimate | None = None
        self.request: StartRequest | None = None
        self.tracked_set: ImageSet | None = None
        self._last_ns: int | None = None

    @property
    def estimates(self) -> Mapping[str, TrackEstimate]:
        """The latest since it began, by the name of the body; "" of one that is alone."""
        if self.tracked is None:
            return {}
        return self.tracker.estimates if isinstance(self.tracker, Bodies) else {"": self.tracked}

    def step(self, image_set: ImageSet) -> TrackEstimate:
        """Track an image set; where its stamp goes back, the tracker begins anew. What it teaches is learned by `learn`.

        Raises
        ------
        TrackerError : there is no tracker, or the images cannot be tracked. Any other error of the tracker passes too.
        """
        if self.tracker is None:
            raise TrackerError("there is no tracker yet")
        if self._last_ns is not None and image_set.stamp_ns < self._last_ns:
            self.tracker.reset()  # a recording began again
            self.tracked = self.tracked_set = None
            if self.request is not None:
                self.request.tell(self.tracker)
        self._last_ns = image_set.stamp_ns
        if self._prepare is not None:
            image_set = self._prepare(self.tracker, image_set)
        self.tracked, self.tracked_set = self.tracker.estimate(image_set), image_set
        self.request = None
        return self.tracked

    def learn(self) -> None:
        """Learn from the latest image set, once its estimate has gone where it is waited for; else the next step does."""
        if self.tracker is not None:
            self.tracker.learn()

    def begin(self, request: StartRequest) -> None:
        """The next image set is begun as requested, also if a reset or another tracker comes before it."""
        if request.forgets_state:
            self.tracked = self.tracked_set = None
        if request.forgets_clock:
            self._last_ns = None
        self.request = request
        if self.tracker is not None:
            request.tell(self.tracker)

    def exchange(self, tracker: Steppable | None) -> None:
        """Another tracker, which begins as was requested, or where the old one has left the body."""
        old, self.tracker = self.tracker, tracker
        if tracker is None:
            return
        if self.request is not None:
            self.request.tell(tracker)
        elif isinstance(tracker, Bodies) and isinstance(old, Bodies):
            for name, estimate in old.estimates.items():
                self._go_on(tracker.trackers[name], old.trackers[name], estimate)
        elif self.tracked is not None:
            self._go_on(tracker, old, self.tracked)

    def _go_on(self, tracker: Steppable, old: Steppable | None, tracked: TrackEstimate) -> None:
        if tracked.status is Status.INITIALIZING:
            tracker.reinitialize()
        elif not self._taken_over(tracker, old, tracked):
            tracker.set_state(tracked.state)

    def _taken_over(self, tracker: Steppable, old: Steppable | None, tracked: TrackEstimate) -> bool:
        """Whether a new tracker knows where the body is; else it looks around there, which takes a second."""
        if old is None or self.tracked_set is None or tracked.status is Status.LOST:
            return False
        try:
            tracker.take_over(old, self.tracked_set)
        except TrackerError:  # the images are of another size than its cameras
            return False
        return True
