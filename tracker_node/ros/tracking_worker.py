"""The thread in which images become estimates: inbox -> synchronizer -> tracker -> outputs."""

from __future__ import annotations

import queue
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Protocol

import numpy as np

from ..camera.camera_rig import CameraRig
from ..errors import TrackerError
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from ..observation.image_set import CameraImage, ImageSet
from ..observation.image_synchronizer import ImageSynchronizer
from ..tracking.config import TrackerConfig
from ..tracking.estimate import CameraReport, Status, Timings, TrackEstimate
from .image_inbox import ImageInbox, Received

_AT_ONCE = 2  # image sets that may wait in a graph that is watched live


class Steppable(Protocol):
    """What the worker needs of a tracker."""

    def step(self, image_set: ImageSet) -> TrackEstimate: ...
    def reset(self) -> None: ...
    def set_state(self, state: State) -> None: ...


@dataclass
class WorkerCounts:
    """What became of images and image sets; read by the diagnostics."""

    tracked: int = 0
    superseded: int = 0  # sets not tracked since a newer one was there
    lost: int = 0
    failed: int = 0  # sets at which the tracker raised an error
    refused: dict[str, int] = field(default_factory=dict)  # camera -> images that could not be used
    problems: dict[str, str] = field(default_factory=dict)  # camera -> why


class TrackingWorker(threading.Thread):
    """Tracks what the inbox receives until it is stopped.

    Parameters
    ----------
    make_tracker : builds the tracker for a rig, a configuration and a first state; called in this thread.
    on_estimate : called in this thread with each estimate and its image set.
    lossless : every image set is tracked, in order; otherwise only the newest two of those that wait, and the others are
        counted: one that came late is made up for, a tracker that is too slow does not fall behind.
    rig : its lenses are those of the images, or None where they are not known yet (`set_rig`): images wait.
    """

    def __init__(
        self,
        inbox: ImageInbox,
        make_tracker: Callable[[CameraRig, TrackerConfig, State | None], Steppable],
        on_estimate: Callable[[TrackEstimate, ImageSet], None],
        *,
        model: ArticulatedModel,
        config: TrackerConfig,
        cameras: tuple[str, ...],
        lossless: bool = False,
        on_error: Callable[[str], None] = lambda text: None,
    ):
        super().__init__(name="track", daemon=True)
        self._inbox, self._make_tracker, self._on_estimate = inbox, make_tracker, on_estimate
        self._model, self._config, self._lossless, self._on_error = model, config, lossless, on_error
        self._rig: CameraRig | None = None
        self._tracker: Steppable | None = None
        self._commands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._last_ns: int | None = None
        self._not_yet: list[Received] = []
        self._synchronizer = ImageSynchronizer(cameras, **asdict(config.synchronizer))
        self.counts = WorkerCounts()
        self.latest: TrackEstimate | None = None
        self.busy = True  # tracking, or getting ready to
        self.fatal: Exception | None = None

    @property
    def synchronizer(self) -> ImageSynchronizer:
        """For its counters."""
        return self._synchronizer

    def set_rig(self, rig: CameraRig) -> None:
        """The cameras are known: tracking can begin."""

        def begin() -> None:
            self._rig = rig
            self._tracker = self._make_tracker(rig, self._config, None)

        self._command(begin)

    def reset(self) -> None:
        """Forget everything, as after a backward jump of time."""

        def forget() -> None:
            self._synchronizer.reset()
            self._reset_tracker()

        self._command(forget)

    def set_state(self, state: State) -> None:
        """Go on from a state at the next image set."""
        self._command(lambda: self._tracker.set_state(state) if self._tracker is not None else None)

    def reconfigure(self, config: TrackerConfig) -> None:
        """Other parameters from the next image set on; the tracker goes on from where it is, what it has learnt is lost."""

        def change() -> None:
            if config.synchronizer != self._config.synchronizer:
                self._synchronizer = ImageSynchronizer(self._synchronizer.cameras, **asdict(config.synchronizer))
            self._config = config
            if self._rig is not None:
                self._tracker = self._make_tracker(self._rig, config, None if self.latest is None else self.latest.state)

        self._command(change)

    def stop(self, timeout_s: float = 30.0) -> None:
        """End; a lossless worker tracks what has come in before."""
        self._stopping.set()
        self._inbox.wake()
        if self.is_alive():
            self.join(timeout=timeout_s)

    def _command(self, action: Callable[[], None]) -> None:
        self._commands.put(action)
        self._inbox.wake()

    def run(self) -> None:
        """The thread's loop."""
        try:
            while not self._stopping.is_set():
                self.busy = False
                received = self._inbox.take(timeout_s=0.1)
                self.busy = True
                self._obey()
                self._handle(received)
            if self._lossless and self._tracker is not None:
                self._handle(self._inbox.take(timeout_s=0.0))
                self._track(self._synchronizer.flush())
        except Exception as error:  # the node must know, or it would idle for ever
            self.fatal = error
            self._on_error(f"the tracking thread has ended: {_described(error)}")

    def _obey(self) -> None:
        while True:
            try:
                action = self._commands.get_nowait()
            except queue.Empty:
                return
            action()

    def _handle(self, received: list[Received]) -> None:
        if self._tracker is None:
            self._not_yet += received
            del self._not_yet[: 0 if self._lossless else -len(self._synchronizer.cameras)]
            return
        received, self._not_yet = self._not_yet + received, []
        sets: list[ImageSet] = []
        for item in received:
            image = self._usable(item)
            if image is not None:
                sets += self._synchronizer.add(image)
        self._track(sets)

    def _usable(self, received: Received) -> CameraImage | None:
        assert self._rig is not None
        camera, counts = received.camera, self.counts
        try:
            image = received.decode()
            lens = self._rig[camera].model
            height, width = image.pixels.shape[:2]
            if (width, height) != (lens.width, lens.height):
                raise TrackerError(f"expected images of {lens.width}x{lens.height} as calibrated, got {width}x{height}")
        except TrackerError as error:
            counts.refused[camera] = counts.refused.get(camera, 0) + 1
            counts.problems[camera] = str(error)
            return None
        counts.problems.pop(camera, None)
        return image

    def _track(self, sets: list[ImageSet]) -> None:
        if not self._lossless and len(sets) > _AT_ONCE:
            self.counts.superseded += len(sets) - _AT_ONCE
            sets = sets[-_AT_ONCE:]
        for image_set in sets:
            self._step(image_set)
            self._obey()

    def _step(self, image_set: ImageSet) -> None:
        assert self._tracker is not None and self._rig is not None
        if self._last_ns is not None and image_set.stamp_ns < self._last_ns:
            self._tracker.reset()  # the clock went backward: a recording began again
        self._last_ns = image_set.stamp_ns
        began = time.perf_counter()
        try:
            estimate = self._tracker.step(image_set)
        except Exception as error:
            self.counts.failed += 1
            self._on_error(f"image set {image_set.stamp_ns}: {_described(error)}")
            estimate = self._lost(image_set, f"{type(error).__name__}: {error}", 1e3 * (time.perf_counter() - began))
        self.counts.tracked += 1
        self.counts.lost += estimate.status == Status.LOST
        self.latest = estimate
        self._on_estimate(estimate, image_set)

    def _reset_tracker(self) -> None:
        self._last_ns, self.latest = None, None
        if self._tracker is not None:
            self._tracker.reset()

    def _lost(self, image_set: ImageSet, reason: str, total_ms: float) -> TrackEstimate:
        """What is said when the tracker could not say anything: the last state, and that it is lost."""
        assert self._rig is not None
        n = self._model.n_dof
        blank = TrackEstimate(
            stamp_ns=image_set.stamp_ns,
            status=Status.LOST,
            status_reason=reason,
            state=State.neutral(self._model),
            velocity=np.zeros(n),
            covariance=np.eye(n) * 1e6,
            score=0.0,
            residual_px=0.0,
            cameras=tuple(CameraReport(name, 0, 0.0, 0) for name in self._rig.names),
            iterations=0,
            evaluations=0,
            timings=Timings(0.0, 0.0, total_ms),
        )
        return blank if self.latest is None else replace(blank, state=self.latest.state)


def _described(error: Exception) -> str:
    """What a user can mend in one line, the rest with where it came from."""
    return str(error) if isinstance(error, TrackerError) else f"{error!r}\n{traceback.format_exc()}"
