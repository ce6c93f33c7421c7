"""The loop of every run, live or offline: image sets into the tracker, which is reset where stamps go back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from ..errors import TrackerError
from ..model.configuration import State
from ..observation.image_set import ImageSet
from ..tracking.estimate import Status, TrackEstimate
from ..tracking.together.bodies import Bodies


class Steppable(Protocol):
    """What the loop needs of a tracker."""

    def estimate(self, image_set: ImageSet) -> TrackEstimate: ...
    def learn(self) -> None: ...
    def reset(self) -> None: ...
    def set_state(self, state: State) -> None: ...
    def reinitialize(self, near: np.ndarray | None = None) -> None: ...


class OfOneBody(Steppable, Protocol):
    """The same of one body, which another tracker may have followed before."""

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

    ``tell``: is called with the tracker. ``forgets_state``: where the body was does not matter any more; ``forgets_clock``:
    neither do the stamps. ``body``: of several bodies, the one that is meant, whose tracker is told; "": all.
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
    estimates : the same by the name of the body; "" of one that is alone. Another tracker goes on there.
    requests : how each body was asked to begin, "" all of them; none once an image set has been tracked since.
    """

    def __init__(self, tracker: Steppable | None = None, prepare: Prepare | None = None):
        self.tracker, self._prepare = tracker, prepare
        self.tracked: TrackEstimate | None = None
        self.estimates: Mapping[str, TrackEstimate] = {}
        self.requests: dict[str, StartRequest] = {}
        self.tracked_set: ImageSet | None = None
        self._last_ns: int | None = None
        self._left: Steppable | None = None  # that has tracked, before there was none

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
            self._forget()
            for request in self.requests.values():
                request.tell(_of(self.tracker, request.body))
        self._last_ns = image_set.stamp_ns
        if self._prepare is not None:
            image_set = self._prepare(self.tracker, image_set)
        self.tracked, self.tracked_set = self.tracker.estimate(image_set), image_set
        self.estimates = self.tracker.estimates if isinstance(self.tracker, Bodies) else {"": self.tracked}
        self.requests = {}
        return self.tracked

    def _forget(self) -> None:
        self.tracked, self.tracked_set, self.estimates = None, None, {}

    def learn(self) -> None:
        """Learn from the latest image set, once its estimate has gone where it is waited for; else the next step does."""
        if self.tracker is not None:
            self.tracker.learn()

    def begin(self, request: StartRequest) -> None:
        """The next image set is begun as requested, also if a reset or another tracker comes before it."""
        if request.forgets_state:
            self._forget()
        if request.forgets_clock:
            self._last_ns = None
        self.requests = {**self.requests, request.body: request} if request.body else {"": request}
        if self.tracker is not None:
            request.tell(_of(self.tracker, request.body))

    def exchange(self, tracker: Steppable | None) -> None:
        """Another tracker, which begins as was requested, or where the old one has left the body."""
        old, self.tracker = self.tracker, tracker
        if tracker is None:
            self._left = old or self._left
            return
        self._left = old or self._left
        if isinstance(tracker, Bodies) and isinstance(self._left, Bodies):
            tracker.keep_joined(self._left)
        image_sets, before = self._sets_of(old), _by_body(old)
        for name, own in _by_body(tracker).items():
            request = self.requests.get(name, self.requests.get(""))
            if request is not None:
                request.tell(own)
            elif name in self.estimates:
                self._go_on(own, before.get(name), self.estimates[name], image_sets.get(name))

    def _sets_of(self, old: Steppable | None) -> Mapping[str, ImageSet]:
        """The latest image set as each body has it: with the others in it."""
        if self.tracked_set is None:
            return {}
        return old.image_sets(self.tracked_set) if isinstance(old, Bodies) else {"": self.tracked_set}

    def _go_on(self, tracker: OfOneBody, old: OfOneBody | None, tracked: TrackEstimate, image_set: ImageSet | None) -> None:
        if tracked.status is Status.INITIALIZING:
            tracker.reinitialize()
        elif not self._taken_over(tracker, old, tracked, image_set):
            tracker.set_state(tracked.state)

    def _taken_over(
        self, tracker: OfOneBody, old: OfOneBody | None, tracked: TrackEstimate, image_set: ImageSet | None
    ) -> bool:
        """Whether a new tracker knows where the body is; else it looks around there, which takes a second."""
        if old is None or image_set is None or tracked.status is Status.LOST:
            return False
        try:
            tracker.take_over(old, image_set)
        except TrackerError:  # the images are of another size than its cameras
            return False
        return True


def _by_body(tracker: Steppable | None) -> Mapping[str, OfOneBody]:
    if tracker is None:
        return {}
    return tracker.trackers if isinstance(tracker, Bodies) else {"": cast(OfOneBody, tracker)}


def _of(tracker: Steppable, body: str) -> Steppable:
    """The tracker of one of several bodies; of all without a name."""
    return _by_body(tracker)[body] if body else tracker
