"""What a tracker node is made of, the making of the tracker, and what the tracking thread works with and counts.

The thread makes its setup anew for changed parameters.
"""

from __future__ import annotations

import threading
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import CameraRig
from ...compiled.ahead import Progress, show_progress
from ...errors import TrackerError
from ...loaders.images.source import load_backgrounds, resized_backgrounds
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.humans.keypoints import KeypointTable
from ...observation.keypoints.blazepose import NAMES
from ...runs.loop import StartRequest, Steppable
from ...tracking.config import KEYPOINTS, TrackerConfig
from ...tracking.together.bodies import Bodies, shared_threads
from ...tracking.together.joining import Joining, JoiningOptions
from ...tracking.tracker import Tracker
from ...tracking.warm_up import SmallTrackers, warm_up
from .image_inbox import InboxOptions


@dataclass(frozen=True, eq=False)
class BodyOptions:
    """One of the bodies that a node follows.

    Parameters
    ----------
    model, initial_state : as for the `Tracker`.
    person : (3,) meters, world: of several people, the one there; None: the one nearest to where the cameras look.
    """

    model: ArticulatedModel
    initial_state: State | None = None
    person: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class TrackerOptions:
    """What a tracker node is made of.

    Parameters
    ----------
    rig, model, config, initial_state, occluders : as for `tracking.tracker.Tracker`; parameters given to the node win over
        ``config``.
    keypoints : as for the `Tracker`: what the points of a detector are on the body.
    bodies : several that are followed together, by name, the first of them being ``model``; empty: that alone.
    joining : people who come and go beside these; their parameters are those of the node. None: nobody does.
    joint_states : topic on which a robot says where its joints are; "": none does.
    inbox : how images are received; ``inbox.lossless`` also makes every image set be tracked, in order.
    calibration_from_topics : lenses come from ``<cam>/camera_info`` instead of the rig, which gives the places only.
    autostart : configure and activate without being asked.
    make_tracker : what tracks; by default the `Tracker`.
    ros_args : of the process, behind ``--ros-args``.
    """

    rig: CameraRig
    model: ArticulatedModel
    config: TrackerConfig = field(default_factory=TrackerConfig)
    initial_state: State | None = None
    occluders: ArticulatedModel | None = None
    bodies: Mapping[str, BodyOptions] = field(default_factory=dict)
    joining: JoiningOptions | None = None
    keypoints: KeypointTable | None = None
    joint_states: str = ""
    inbox: InboxOptions = field(default_factory=InboxOptions)
    calibration_from_topics: bool = False
    autostart: bool = True
    make_tracker: Callable[[CameraRig, ArticulatedModel, TrackerConfig, State | None], Steppable] | None = None
    ros_args: Sequence[str] = ()

    @property
    def several(self) -> bool:
        """Whether there may be several bodies."""
        return bool(self.bodies) or self.joining is not None

    @property
    def named(self) -> Mapping[str, BodyOptions]:
        """All bodies by name that are there from the beginning; "" of one that is alone."""
        return self.bodies if self.several else {"": BodyOptions(self.model, self.initial_state)}

    @property
    def each(self) -> Mapping[str, BodyOptions]:
        """The same, and those who may join."""
        joining = self.joining
        return self.named if joining is None else {**self.named, **dict.fromkeys(joining.names, BodyOptions(joining.model))}

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of a detector's points that a tracker knows."""
        return NAMES if self.keypoints is None else tuple(self.keypoints)


class TrackerMaker:
    """Makes trackers for the cameras in use.

    Parameters
    ----------
    options : of the node.
    progress : told of what is compiled, from several threads.

    Raises
    ------
    SourceError, CalibrationError : images of the background that are missing, unreadable or of another size.
    """

    def __init__(self, options: TrackerOptions, progress: Progress = show_progress):
        self._options, self._progress = options, progress
        self._backgrounds = load_backgrounds(options.rig)
        self._small: list[SmallTrackers] = []
        self._prepared: TrackerConfig | None = None

    def rig(self, cameras: tuple[str, ...], lenses: Mapping[str, CameraModel] | None = None) -> CameraRig | None:
        """The cameras in use, in the order of the rig, with other lenses if given; None where one of them is not known.

        Parameters
        ----------
        cameras : names of those in use.
        lenses : camera -> lens.

        Returns
        -------
        rig : or None.
        """
        rig = self._options.rig.subset(cameras)
        if lenses is None:
            return rig
        if any(name not in lenses for name in cameras):
            return None
        return replace(rig, cameras=tuple(replace(camera, model=lenses[camera.name]) for camera in rig))

    def prepare(self, cameras: tuple[str, ...], config: TrackerConfig) -> None:
        """Have the code in memory that such a tracker runs, so that it does not stop to compile in the middle of a run.

        Parameters
        ----------
        cameras : names of those in use.
        config : parameters of the tracker.

        Raises
        ------
        TrackerError : the configuration does not suit the body.
        """
        options = self._options
        if options.make_tracker is not None or self._prepared == config:
            return
        rig = options.rig.subset(cameras)
        warm_up(rig, options.model, config, options.initial_state, options.occluders, options.keypoints, self._progress)
        self._prepared = config

    def tracker(self, rig: CameraRig, config: TrackerConfig) -> Steppable:
        """A tracker that knows nothing yet but the initial state.

        Parameters
        ----------
        rig : the cameras in use.
        config : parameters of the tracker.

        Returns
        -------
        tracker : for these cameras.

        Raises
        ------
        TrackerError : the configuration does not suit the body.
        """
        options = self._options
        if options.make_tracker is not None:
            return options.make_tracker(rig, options.model, config, options.initial_state)
        backgrounds = resized_backgrounds({name: b for name, b in self._backgrounds.items() if name in rig.names}, rig)
        asked = None if options.joining is None else replace(options.joining, config=config)
        at_once, threads = shared_threads(config.threads, len(options.named) + 2 * (asked is not None))

        def make(of: TrackerConfig, model: ArticulatedModel, state: State | None) -> Tracker:
            own = replace(of, threads=threads)
            return Tracker(rig, model, own, backgrounds, state, options.occluders, options.keypoints)

        trackers = {name: make(config, body.model, body.initial_state) for name, body in options.named.items()}
        for name, body in options.named.items():
            if body.person is not None and body.initial_state is None:
                trackers[name].reinitialize(body.person)
        joining = None if asked is None else Joining(rig, asked, partial(make, asked.config), options.keypoints)
        return Bodies(trackers, at_once, joining) if options.several else trackers[""]

    def check(self, cameras: tuple[str, ...], config: TrackerConfig) -> None:
        """Whether such a tracker can be made, in some 20 ms.

        Parameters
        ----------
        cameras : names of those in use.
        config : parameters of the tracker.

        Raises
        ------
        TrackerError : the configuration does not suit the body.
        """
        options = self._options
        if options.make_tracker is not None:
            return
        if options.joining is not None:
            replace(options.joining, config=config)  # takes points
        for name, body in options.named.items():
            if body.person is not None and body.initial_state is None and KEYPOINTS not in config.modalities:
                got = ", ".join(config.modalities)
                raise TrackerError(f"{name}: a person is chosen by points: expected keypoints among the modalities, got {got}")
        if not self._small:
            names = tuple(self._backgrounds)
            models = {id(body.model): body.model for body in options.each.values()}
            self._small = [SmallTrackers(options.rig, model, names, options.keypoints) for model in models.values()]
        for small in self._small:
            small.check(cameras, config)


PAUSED, INACTIVE, UNCALIBRATED = "paused", "inactive", "uncalibrated"  # why images that have come are not used
_IDLE = (PAUSED, INACTIVE, UNCALIBRATED)


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """What is tracked with, from one change of parameters to the next.

    ``cameras`` are those in use, and ``rig`` is of these alone; it and ``tracker`` are None where lenses are not known yet.
    """

    config: TrackerConfig
    cameras: tuple[str, ...]
    rig: CameraRig | None = None
    tracker: Steppable | None = None


class StartRequests:
    """Keeps the newest request for each body, which comes from any thread, until an image set has been tracked as requested."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: dict[str, StartRequest] = {}

    def asked(self, body: str) -> StartRequest | None:
        """The newest for a body or for all, until it has been followed."""
        with self._lock:
            return self._asked.get(body, self._asked.get(""))

    def ask(self, request: StartRequest) -> None:
        """A new one; it takes the place of an earlier one, one for all bodies that of all."""
        with self._lock:
            self._asked = {**self._asked, request.body: request} if request.body else {"": request}

    def followed(self, requests: Iterable[StartRequest]) -> None:
        """An image set has been tracked as these said; what has been asked since is kept."""
        with self._lock:
            done = set(map(id, requests))
            self._asked = {body: request for body, request in self._asked.items() if id(request) not in done}


@dataclass
class WorkerCounts:
    """What became of images and image sets; read by the diagnostics."""

    tracked: int = 0
    skipped: int = 0  # sets not tracked since a newer one was there
    of_body: Counter[str] = field(default_factory=Counter)  # body -> sets of those tracked in which it was here
    lost: Counter[str] = field(default_factory=Counter)  # body -> sets of those in which it was LOST
    failed: int = 0  # sets at which the tracker raised an error
    refused: Counter[str] = field(default_factory=Counter)  # camera -> images that could not be used
    problems: dict[str, str] = field(default_factory=dict)  # camera -> why
    idle: dict[str, Counter[str]] = field(default_factory=lambda: {reason: Counter() for reason in _IDLE})
    # reason -> camera -> images that came while nothing was to be tracked


class SetupBuilder:
    """Makes what is asked for last, one at a time; `taken` hands it over to the event loop.

    What was asked for before something else is not handed over any more.

    Parameters
    ----------
    on_error : called with the details of what is not a `TrackerError`.
    """

    def __init__(self, on_error: Callable[[str], None] = lambda text: None):
        self._on_error = on_error
        self._condition = threading.Condition()
        self._asked: Callable[[], TrackingSetup] | None = None
        self._made: TrackingSetup | TrackerError | None = None
        self._at_work = False

    def ask(self, make: Callable[[], TrackingSetup]) -> None:
        """Make this, in a thread; ``make`` may raise."""
        with self._condition:
            self._asked, self._made = make, None
            if not self._at_work:
                self._at_work = True
                threading.Thread(target=self._run, name="make tracker", daemon=True).start()

    def forget(self) -> None:
        """Nothing is wanted any more."""
        with self._condition:
            self._asked = self._made = None

    @property
    def busy(self) -> bool:
        """Whether something that has been asked for has not been taken yet."""
        return self._asked is not None

    def taken(self) -> TrackingSetup | None:
        """What is made now, once; None while there is nothing.

        Raises
        ------
        TrackerError : it could not be made.
        """
        with self._condition:
            made = self._made
            if made is None:
                return None
            self._asked = self._made = None
        if isinstance(made, TrackerError):
            raise made
        return made

    def wait(self) -> None:
        """Until everything that is asked for is made."""
        with self._condition:
            self._condition.wait_for(lambda: self._asked is None or self._made is not None)

    def _run(self) -> None:
        while True:
            with self._condition:
                make = self._asked
                if make is None or self._made is not None:
                    self._at_work = False
                    return
            made = self._result(make)
            with self._condition:
                if self._asked is make:
                    self._made = made
                self._condition.notify_all()

    def _result(self, make: Callable[[], TrackingSetup]) -> TrackingSetup | TrackerError:
        try:
            return make()
        except TrackerError as error:
            return error
        except Exception as error:  # a mistake in the tracker must not leave its maker without an answer
            self._on_error("".join(traceback.format_exception(error)))
            return TrackerError(f"{type(error).__name__}: {error}")
