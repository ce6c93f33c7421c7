"""The loop of every run, live or offline: images to image sets, and these into the tracker, which is reset where stamps go back.

Accounts of the sets outlast a change of cameras or of the synchronizer's parameters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, cast

import numpy as np

from ..errors import TrackerError
from ..model.configuration import State
from ..observation.image_set import CameraImage, ImageSet
from ..observation.synchronizer import ImageSynchronizer
from ..tracking.config import SynchronizerConfig
from ..tracking.estimate import Status, TrackEstimate
from ..tracking.together.bodies import Bodies


def make_synchronizer(cameras: tuple[str, ...], config: SynchronizerConfig) -> ImageSynchronizer:
    """A synchronizer by its parameters; with fewer cameras than ``min_cameras`` all of them are asked for.

    Parameters
    ----------
    cameras : names, in the order of the rig.
    config : its parameters.

    Returns
    -------
    synchronizer : without images.
    """
    return ImageSynchronizer(
        cameras,
        image_period_s=config.image_period_s,
        tolerance=config.tolerance,
        queue_s=config.queue_s,
        min_cameras=min(config.min_cameras, len(cameras)),
    )


@dataclass(frozen=True, eq=False)
class _Account:
    """A synchronizer and what came before it; exchanged as one, since another thread reads the counts."""

    synchronizer: ImageSynchronizer
    config: SynchronizerConfig
    images_before: dict[str, Counter[str]] = field(default_factory=dict)
    sets_before: Counter[str] = field(default_factory=Counter)
    not_formed_before: Counter[str] = field(default_factory=Counter)
    jumps_before: int = 0

    def images(self) -> dict[str, Counter[str]]:
        result = {camera: Counter(counts) for camera, counts in self.images_before.items()}
        for camera, counts in self.synchronizer.counters.items():
            result.setdefault(camera, Counter()).update(counts)
        return result

    def sets(self) -> Counter[str]:
        now = self.synchronizer
        result = Counter({"complete": now.sets_complete, "of fewer cameras": now.sets_incomplete})
        result.update(self.sets_before)
        return result

    def not_formed(self) -> Counter[str]:
        result = Counter(self.synchronizer.sets_not_formed)
        result.update(self.not_formed_before)
        return result

    def jumps(self) -> int:
        return self.jumps_before + self.synchronizer.clock_jumps

    def changed(self, cameras: tuple[str, ...], config: SynchronizerConfig) -> _Account:
        """The next one; nothing may wait any more."""
        made = make_synchronizer(cameras, config)
        return _Account(made, config, self.images(), self.sets(), self.not_formed(), self.jumps())


class SetFormation:
    """Matches images to sets, as an `ImageSynchronizer` that can be exchanged and that cameras can be taken out of."""

    def __init__(self, cameras: tuple[str, ...], config: SynchronizerConfig):
        self._now = _Account(make_synchronizer(cameras, config), config)
        self._leaving: dict[str, int] = {}  # camera -> stamp of its last image

    @property
    def cameras(self) -> tuple[str, ...]:
        """Those that sets are made of now."""
        return self._now.synchronizer.cameras

    def change(self, cameras: tuple[str, ...], config: SynchronizerConfig) -> None:
        """Other cameras or parameters; images that wait are counted as ``reset``.

        Parameters
        ----------
        cameras : names, in the order of the rig.
        config : parameters of the synchronizer.
        """
        old = self._now
        if cameras == old.synchronizer.cameras and config == old.config:
            return
        old.synchronizer.reset()
        self._now = old.changed(cameras, config)
        self._leaving.clear()

    def drop(self, camera: str, last_stamp_ns: int) -> None:
        """No image of ``camera`` comes after this stamp; its sets up to there are still made.

        Parameters
        ----------
        camera : its name.
        last_stamp_ns : integer nanoseconds.
        """
        self._leaving[camera] = last_stamp_ns

    def add(self, image: CameraImage) -> list[ImageSet]:
        """As `ImageSynchronizer.add`."""
        sets = self._without_those_gone(image.stamp_ns) if self._leaving else []
        return sets + self._now.synchronizer.add(image)

    def _without_those_gone(self, stamp_ns: int) -> list[ImageSet]:
        config = self._now.config
        tolerance_ns = round(config.tolerance * config.image_period_s * 1e9)
        gone = [camera for camera, last_ns in self._leaving.items() if stamp_ns > last_ns + tolerance_ns]
        if not gone:
            return []
        sets = self.flush()
        for camera in gone:
            del self._leaving[camera]
        self._now = self._now.changed(tuple(camera for camera in self.cameras if camera not in gone), config)
        return sets

    def flush(self) -> list[ImageSet]:
        """As `ImageSynchronizer.flush`."""
        return self._now.synchronizer.flush()

    def reset(self) -> None:
        """As `ImageSynchronizer.reset`."""
        self._now.synchronizer.reset()

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera that is or was in use, what became of its images: see `ImageSynchronizer.counters`."""
        return {camera: dict(counts) for camera, counts in self._now.images().items()}

    @property
    def clock_jumps(self) -> int:
        """How often stamps went back by more than images overtake each other."""
        return self._now.jumps()

    @property
    def sets(self) -> dict[str, int]:
        """``complete`` and ``of fewer cameras``, and ``not formed, <reason>`` for each reason."""
        now = self._now
        return {**now.sets(), **{f"not formed, {reason}": n for reason, n in now.not_formed().items()}}

    @property
    def sets_not_formed(self) -> dict[str, int]:
        """Time steps without a set, by the reasons of the synchronizer."""
        return dict(self._now.not_formed())


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
