"""The thread in which images become estimates: inbox -> image sets -> tracker -> outputs.

It works in turns, and between them does what other threads ask of it.
"""

from __future__ import annotations

import gc
import queue
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...observation.image_set import CameraImage, ImageSet
from ...runs.loop import SetFormation, StartRequest, TrackingLoop
from ...tracking.config import KEYPOINTS, TrackerConfig
from ...tracking.estimate import Status, TrackEstimate, unknown_estimate
from ...tracking.together.bodies import Bodies
from ..joint_states import JointStateInbox
from .image_inbox import ImageInbox, Received
from .keypoint_inbox import PointMatching
from .setup import INACTIVE, PAUSED, UNCALIBRATED, StartRequests, TrackingSetup, WorkerCounts

T = TypeVar("T")


class CommandThread(Generic[T]):
    """Runs between `start` and `stop`, as often as these are called.

    Parameters
    ----------
    wait : waits for something to do, not for long. wake : lets that return at once.
    work : does it. at_end : called in the thread when it is to end.
    on_error : called with the reason why the thread has ended by itself.

    Attributes
    ----------
    stopping : the thread is to end.
    busy : at work, or getting ready to.
    fatal : why the thread has ended by itself.
    """

    def __init__(
        self,
        wait: Callable[[], T],
        wake: Callable[[], None],
        work: Callable[[T], None],
        at_end: Callable[[], None],
        on_error: Callable[[Exception], None],
    ):
        self._wait, self._wake, self._work, self._at_end, self._on_error = wait, wake, work, at_end, on_error
        self._thread: threading.Thread | None = None
        self._commands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self.stopping = threading.Event()
        self.busy = True
        self.fatal: Exception | None = None

    def start(self, name: str) -> None:
        """Begin."""
        self.stopping.clear()
        self._thread = threading.Thread(target=self.run, name=name, daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float) -> bool:
        """End; whether that has come about within the timeout. If not, the thread goes on."""
        self.stopping.set()
        self._wake()
        if self._thread is not None:
            self._thread.join(timeout=timeout_s)
            if self._thread.is_alive():
                self.stopping.clear()
                return False
        self._thread = None
        return True

    @property
    def started(self) -> bool:
        """Whether it has been started, and not stopped since."""
        return self._thread is not None

    def command(self, action: Callable[[], None]) -> None:
        """Have something done in the thread, soon."""
        self._commands.put(action)
        self._wake()

    def obey(self) -> None:
        """In the thread: do what has been commanded."""
        while True:
            try:
                action = self._commands.get_nowait()
            except queue.Empty:
                return
            action()

    def run(self) -> None:
        """What the thread does."""
        try:
            while not self.stopping.is_set():
                self.busy = False
                found = self._wait()
                self.busy = True
                self.obey()
                self._work(found)
            self._at_end()
        except Exception as error:  # who has started it must know, or would wait for ever
            self.fatal = error
            self._on_error(error)


_FORMED = 60  # image sets of which the time from one to the next is known
_AT_ONCE = 4  # image sets that may wait in a graph that is watched live: a search takes as long as three, 0.1 s at 30 Hz
_AT_ONCE_MS = 100.0  # or as many as take so long: those that have waited for a camera that stopped come together


class TrackingWorker:
    """Tracks what the inbox receives between `start` and `stop`; what it knows outlives a stop.

    Parameters
    ----------
    setup : as it is at first; images wait while it has no tracker. Later ones come by `use`.
    on_estimate : called in the thread with each estimate and its image set.
    initial_state : what is said of the body, together with that it is lost, when image sets fail before any was tracked.
    initial_states : the same of several bodies, by name; None: there is one.
    lossless : every image set is tracked, in order; otherwise only the newest four of those that wait, and the others are
        counted: one that came late is made up for, a tracker that is too slow does not fall behind.
    points : of a detector, for the image sets, for which a lossless worker waits; None: none are used.
    joint_states : of a robot, likewise.

    Attributes
    ----------
    formation : the image sets, and what became of the images.
    latest : the latest estimate since the last reset, also that of an image set that failed; of several bodies, of whoever is
        worst off.
    estimates : the same by the name of the body; "" of one that is alone. Also of those who may join, or have left.
    step_ms : that the latest image set took, all bodies together.
    at_work_since_s : steady time at which the image set at work was begun; None while there is none.
    paused : images are counted, and not used.
    formed_ns : stamps of the latest image sets, those left out among them.
    """

    def __init__(
        self,
        inbox: ImageInbox,
        setup: TrackingSetup,
        on_estimate: Callable[[TrackEstimate, ImageSet], None],
        *,
        initial_state: State,
        initial_states: Mapping[str, State] | None = None,
        lossless: bool = False,
        points: PointMatching | None = None,
        joint_states: JointStateInbox | None = None,
        on_error: Callable[[str], None] = lambda text: None,
    ):
        self._inbox, self._setup, self._on_estimate = inbox, setup, on_estimate
        self._initial_states, self._lossless, self._on_error = initial_states or {"": initial_state}, lossless, on_error
        self._thread = CommandThread(lambda: inbox.take(timeout_s=0.1), inbox.wake, self._handle, self._finish, self._on_end)
        self._finishing, self._points, self._newest_ns = False, points, 0
        self._joint_states = joint_states
        self._requests = StartRequests()
        self._loop = TrackingLoop(setup.tracker)
        self._not_yet: list[Received] = []
        self._unset: dict[str, bool] = {}  # camera -> whether the stamp of its latest image was 0
        self.formation = SetFormation(setup.cameras, setup.config.synchronizer)
        self.counts = WorkerCounts()
        self.latest: TrackEstimate | None = None
        self.estimates: Mapping[str, TrackEstimate] = {}
        self.paused, self.step_ms = False, 0.0
        self.at_work_since_s: float | None = None
        self.formed_ns: deque[int] = deque(maxlen=_FORMED)

    @property
    def lossless(self) -> bool:
        """Whether every image set is tracked, however long that takes."""
        return self._lossless

    @property
    def busy(self) -> bool:
        """Tracking, or getting ready to."""
        return self._thread.busy

    @property
    def fatal(self) -> Exception | None:
        """Why the thread has ended by itself: neither an image, nor its set, nor a report of it does that."""
        return self._thread.fatal

    @property
    def rig(self) -> CameraRig | None:
        """The cameras in use, None while their lenses are not known."""
        return self._setup.rig

    @property
    def config(self) -> TrackerConfig:
        """The parameters in use."""
        return self._setup.config

    @property
    def models(self) -> Mapping[str, ArticulatedModel]:
        """By the name of the body, as it is tracked; of several."""
        tracker = self._loop.tracker
        return tracker.models if isinstance(tracker, Bodies) else {}

    @property
    def absent(self) -> Mapping[str, TrackEstimate]:
        """What is said of those who may join, or have left, by the name of the body."""
        tracker = self._loop.tracker
        return tracker.absent if isinstance(tracker, Bodies) else {}

    @property
    def turned_away(self) -> str:
        """What is said where somebody has come for whom no name was left."""
        tracker = self._loop.tracker
        return tracker.turned_away if isinstance(tracker, Bodies) else ""

    def use(self, setup: TrackingSetup) -> None:
        """From the next image set on; the tracker takes over the body from the old one, and learns from the latest image set."""

        def change() -> None:
            self._setup = setup
            self.formation.change(setup.cameras, setup.config.synchronizer)
            self._loop.exchange(setup.tracker)
            gc.collect()  # the old tracker: it is in reference cycles, and large

        self._thread.command(change)

    def start_state(self, body: str = "") -> State | None:
        """Where the next image set begins as far as is known: as asked, else where the body was. None: not at a given state."""
        request, tracked = self._requests.asked(body), self._loop.estimates.get(body)
        if request is not None:
            return request.state
        return None if tracked is None else tracked.state

    def reset(self) -> None:
        """Forget everything, as after a backward jump of time."""
        self._begin(StartRequest(lambda tracker: tracker.reset(), forgets_state=True, forgets_clock=True))

    def set_state(self, state: State, body: str = "") -> None:
        """Go on from a state at the next image set.

        Parameters
        ----------
        state, body : where, and which of several.
        """
        self._begin(StartRequest(lambda tracker: tracker.set_state(state), state, body=body))

    def reinitialize(self, near: np.ndarray | None = None, body: str = "") -> None:
        """Search the body wherever it may be; what has been learned stays.

        Parameters
        ----------
        near : see `Tracker.reinitialize`.
        body : which of several; "": all.
        """
        request = StartRequest(lambda tracker: tracker.reinitialize(near), forgets_state=not body, body=body)
        self._begin(request)

    def _begin(self, request: StartRequest) -> None:
        def begin() -> None:
            if request.forgets_clock:
                self.formation.reset()
                if self._points is not None:
                    self._points.restart()
            if request.forgets_state:
                self.latest, self.estimates = None, {}
            self._loop.begin(request)

        self._requests.ask(request)
        self._thread.command(begin)

    def pause(self, paused: bool) -> None:
        """Count images instead of using them, or use them again."""

        def change() -> None:
            if paused and not self.paused:
                self.formation.reset()
            self.paused = paused

        self._thread.command(change)

    def start(self) -> None:
        """Begin to track, in a thread."""
        self._thread.start("track")

    def stop(self, finish: bool = True, timeout_s: float = 30.0) -> None:
        """End the thread. A lossless worker that is to ``finish`` tracks what has come in; otherwise that is counted.

        Parameters
        ----------
        finish : whether a lossless worker tracks what has come in.
        timeout_s : for the image set at work.

        Raises
        ------
        TrackerError : an image set takes longer than the timeout.
        """
        if not self._thread.started:
            return
        self._finishing = finish and self._lossless
        if not self._thread.stop(timeout_s):
            raise TrackerError(f"the tracking thread has not ended within {timeout_s:g} s")
        self._leave([*self._not_yet, *self._inbox.take(timeout_s=0.0)], INACTIVE)
        self._not_yet = []
        self.formation.reset()

    # In the thread

    def _finish(self) -> None:
        if self._finishing and self._setup.tracker is not None and not self.paused:
            self._handle(self._inbox.take(timeout_s=0.0))
            self._track(self.formation.flush())

    def _on_end(self, error: Exception) -> None:
        self._on_error(f"the tracking thread has ended: {_described(error)}")

    def _leave(self, received: list[Received], reason: str) -> None:
        self.counts.idle[reason].update(item.camera for item in received)
        self._pass(received)

    def _pass(self, received: list[Received]) -> None:
        """Points of these images need not wait any more: what can be tracked is."""
        if self._points is not None:
            for camera, stamp_ns in {item.camera: item.stamp_ns for item in received}.items():
                if stamp_ns is not None:
                    self._points.passed(camera, stamp_ns)

    def _handle(self, received: list[Received]) -> None:
        if self.paused:
            self._leave([*self._not_yet, *received], PAUSED)
            self._not_yet = []
            return
        if self._setup.tracker is None:
            self._not_yet += received
            self._leave(self._beyond_waiting(), UNCALIBRATED)
            return
        received, self._not_yet = self._not_yet + received, []
        self._track(self._formed(received))
        self._pass(received)

    def _formed(self, received: list[Received]) -> list[ImageSet]:
        images = (self._usable(item) for item in received)
        sets = [image_set for image in images if image is not None for image_set in self.formation.add(image)]
        self.formed_ns.extend(image_set.stamp_ns for image_set in sets)
        return sets

    def _beyond_waiting(self) -> list[Received]:
        """Images that are too many to wait for lenses: all but the newest; where nothing may be lost, those beyond the limit."""
        if not self._lossless:
            n = max(0, len(self._not_yet) - len(self._setup.cameras))
            dropped, self._not_yet = self._not_yet[:n], self._not_yet[n:]
            return dropped
        size, most = 0, self._inbox.most_bytes
        for n, item in enumerate(self._not_yet):
            size += item.size
            if most is not None and size > most:
                dropped, self._not_yet = self._not_yet[n:], self._not_yet[:n]
                return dropped
        return []

    def _usable(self, received: Received) -> CameraImage | None:
        assert self._setup.rig is not None
        camera, counts = received.camera, self.counts
        if camera not in self._setup.cameras:  # it has been taken out of use since
            self._leave([received], INACTIVE)
            return None
        try:
            image = received.decode()
            if problem := self._setup.rig[camera].model.size_problem(image.pixels):
                raise TrackerError(problem)
            unset_before, self._unset[camera] = self._unset.get(camera, False), image.stamp_ns == 0
            if unset_before and self._unset[camera]:  # a single one is the beginning of a recording
                raise TrackerError("header.stamp: expected the time of the exposure, got 0 again")
        except Exception as error:  # no image may end the thread
            counts.refused[camera] += 1
            if not isinstance(error, TrackerError):
                self._on_error(f"{camera}: {_described(error)}")
            counts.problems[camera] = str(error)
            return None
        counts.problems.pop(camera, None)
        return image

    def _track(self, sets: list[ImageSet]) -> None:
        while sets:
            too_many = len(sets) if self._ends() else 0 if self._lossless else max(0, len(sets) - self._most_at_once())
            self.counts.skipped += too_many
            sets = sets[too_many:]
            if not sets:
                return
            self.at_work_since_s = time.monotonic()
            self._step(sets.pop(0))
            self.at_work_since_s = None
            self._thread.obey()
            if not self._lossless and not self.paused and self._setup.tracker is not None:  # what came meanwhile is newer
                newer = self._inbox.take(timeout_s=0.0)
                sets += self._formed(newer)
                self._pass(newer)

    def _most_at_once(self) -> int:
        return max(_AT_ONCE, int(_AT_ONCE_MS / self.step_ms)) if self.step_ms else _AT_ONCE

    def _ends(self) -> bool:
        return self._thread.stopping.is_set() and not self._finishing

    def _step(self, image_set: ImageSet) -> None:
        loop = self._loop
        if loop.tracker is None:  # a camera has been added since whose lens is not known
            self.counts.skipped += 1
            return
        if self._points is not None and KEYPOINTS in self._setup.config.modalities:
            if image_set.stamp_ns < self._newest_ns:
                self._points.restart()
            if self._lossless:
                self._points.wait(image_set, self._ends)
            image_set = self._points.attached(image_set)
        self._newest_ns = image_set.stamp_ns
        if self._joint_states is not None:
            image_set = self._joint_states.attached(image_set, waits=self._lossless)
        requests, began = loop.requests, time.perf_counter()
        try:
            estimate = self.latest = loop.step(image_set)
            self.estimates = {**loop.estimates, **self.absent}
            self._requests.followed(requests.values())
        except Exception as error:
            self.estimates = self._failed(image_set, error, 1e3 * (time.perf_counter() - began))
            estimate = self.latest = next(iter(self.estimates.values()))
        self.step_ms = 1e3 * (time.perf_counter() - began)
        self.counts.tracked += 1
        absent = self.absent
        for name, of_body in self.estimates.items():
            self.counts.of_body[name] += name not in absent
            self.counts.lost[name] += name not in absent and of_body.status == Status.LOST
        try:
            self._on_estimate(estimate, image_set)
        except Exception as error:  # what cannot be reported of one image set does not end the tracking of the next
            self.counts.failed += 1
            self._on_error(f"image set {image_set.stamp_ns}: not published: {_described(error)}")
        try:
            loop.learn()
        except Exception as error:  # it is tracked on with what was learned before
            self.counts.failed += 1
            self._on_error(f"image set {image_set.stamp_ns}: not learned from: {_described(error)}")

    def _failed(self, image_set: ImageSet, error: Exception, total_ms: float) -> dict[str, TrackEstimate]:
        self.counts.failed += 1
        self._on_error(f"image set {image_set.stamp_ns}: {_described(error)}")
        reason, tracked = f"{type(error).__name__}: {error}", self._loop.estimates
        states = {name: tracked[name].state if name in tracked else state for name, state in self._initial_states.items()}
        cameras = self._setup.cameras
        said = {name: unknown_estimate(image_set.stamp_ns, reason, state, cameras, total_ms) for name, state in states.items()}
        return said | {name: replace(estimate, stamp_ns=image_set.stamp_ns) for name, estimate in self.absent.items()}


def _described(error: Exception) -> str:
    """What a user can mend in one line, the rest with where it came from."""
    return str(error) if isinstance(error, TrackerError) else f"{error!r}\n{traceback.format_exc()}"
