"""The thread in which people are found: newest image set -> detector -> points of all of its cameras at once.

The newest image set of ROS cameras, matched as a tracker matches its own; older ones are dropped and counted.
"""

from __future__ import annotations

import os
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from ...errors import TrackerError
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.crop import Crop
from ...runs.loop import SetFormation
from ...runs.people.detection import Detector, people_in
from ...tracking.config import SynchronizerConfig
from ..conversions import bgr_of_compressed, decode_raw_image
from ..diagnostics import QosMismatches
from ..qos import images_subscribed, overridable

_LOOK_S = 0.02  # between looks at who listens
_REMEMBERED = 50  # image sets that times are of
_MOST_WAITING = 64  # image sets, where none is to be left out: as many as a source sends ahead of the tracker


def be_nice(niceness: int) -> None:
    """Let others on this machine go before this thread, and before this process where it has a session of its own.

    Linux shares processors among sessions first (`sched(7)`, autogroups), and niceness counts within one. The session of a
    terminal is left as it is: the tracker may be in it.
    """
    with suppress(OSError, AttributeError):  # where a thread has no priority of its own
        own = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, own, min(os.getpriority(os.PRIO_PROCESS, own) + niceness, 19))
    with suppress(OSError):
        if os.getsid(0) == os.getpid():
            Path("/proc/self/autogroup").write_text(f"{niceness}\n")


class DetectionWorker:
    """Works on the newest image set, between `start` and `stop`; nothing that a detector raises ends it.

    The thread has less priority than everything else on this machine (``niceness``), so that a tracker beside it loses no image.

    Parameters
    ----------
    sets : where image sets come from.
    make_detector : made in the thread, whose priority its own threads have too.
    crops : camera -> where bodies are expected at a stamp; the whole image of the others is searched.
    on_people : called in the thread with the images of a set, with their people.
    rate_hz : at most so many sets a second; 0: as many as possible.
    niceness : 0 to 19, on top of the process's own.
    wanted : whether somebody listens; until then no set is taken.
    on_error : called with what a detector has raised.
    around : whether the whole images of a stamp are searched for people who have come in.

    Attributes
    ----------
    ready : the detector has been made, or has failed to.
    fatal : why there is no detector.
    detected, failed : image sets.
    problem : what the detector raised on the latest image set; empty if nothing.
    """

    def __init__(
        self,
        sets: NewestSet,
        make_detector: Callable[[], Detector],
        crops: Callable[[int], Mapping[str, Sequence[Crop]]],
        on_people: Callable[[list[CameraImage]], None],
        *,
        rate_hz: float = 0.0,
        niceness: int = 0,
        wanted: Callable[[], bool] = lambda: True,
        on_error: Callable[[str], None] = lambda text: None,
        around: Callable[[int], bool] = lambda stamp_ns: False,
    ):
        self._around = around
        self._sets, self._make, self._crops, self._on_people = sets, make_detector, crops, on_people
        self._period_s, self._niceness = (1.0 / rate_hz if rate_hz > 0.0 else 0.0), niceness
        self._wanted, self._on_error = wanted, on_error
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="find people", daemon=True)
        self._told: set[str] = set()
        self.ready = threading.Event()
        self.fatal: Exception | None = None
        self.detected = self.failed = self.in_crops = self.images = 0
        self.took_ms: deque[float] = deque(maxlen=_REMEMBERED)
        self.problem = ""

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout_s: float = 1.0) -> None:
        """End, after the image at work."""
        self._stopping.set()
        self._sets.wake()
        self._thread.join(timeout_s)

    # In the thread

    def _run(self) -> None:
        be_nice(self._niceness)
        try:
            detector = self._make()
        except Exception as error:
            self.fatal = error
            return
        finally:
            self.ready.set()
        due_s = 0.0
        while not self._stopping.is_set():
            wait_s = due_s - time.monotonic()
            if wait_s > 0.0:
                self._stopping.wait(min(wait_s, 0.1))
                continue
            if not self._wanted():
                self._stopping.wait(_LOOK_S)
                continue
            image_set = self._sets.take(timeout_s=0.1)
            if image_set is None:
                continue
            due_s = time.monotonic() + self._period_s
            self._work(detector, image_set)

    def _work(self, detector: Detector, image_set: ImageSet) -> None:
        began, crops, around = time.perf_counter(), self._crops(image_set.stamp_ns), self._around(image_set.stamp_ns)
        found = []
        try:
            for image in image_set.images:
                if self._stopping.is_set():
                    return
                people, in_crop = people_in(detector, image.bgr, crops.get(image.camera, ()), around)
                self.images, self.in_crops = self.images + 1, self.in_crops + in_crop
                found.append(replace(image, people=people))
            self._on_people(found)
        except Exception as error:  # no image may end the thread
            self.failed += 1
            self.problem = str(error) if isinstance(error, TrackerError) else f"{type(error).__name__}: {error}"
            if type(error).__name__ not in self._told:
                self._told.add(type(error).__name__)
                details = "" if isinstance(error, TrackerError) else f"\n{traceback.format_exc()}"
                self._on_error(f"image set {image_set.stamp_ns}: {self.problem}{details}")
            return
        self.problem = ""
        self.detected += 1
        self.took_ms.append(1e3 * (time.perf_counter() - began))


class NewestSet:
    """Image sets of ``<cam>/image_raw``, once `subscribe` is called; one thread of the node's own takes.

    Parameters
    ----------
    cameras : names, in the order of the rig.
    config : how images are matched.
    lossless : older sets wait for their turn, for a source that waits for us.

    Attributes
    ----------
    formed, dropped : image sets, and those of them that a newer one has replaced.
    problems : camera -> why its latest image cannot be used.
    """

    def __init__(self, cameras: Sequence[str], config: SynchronizerConfig, lossless: bool = False):
        self._cameras, self._lossless = tuple(cameras), lossless
        self._formation = SetFormation(self._cameras, config)
        self._condition = threading.Condition()
        self._waiting: deque[ImageSet] = deque(maxlen=_MOST_WAITING if lossless else 1)
        self.formed = self.dropped = 0
        self.problems: dict[str, str] = {}

    def subscribe(self, node: Node, compressed: bool, mismatches: QosMismatches) -> None:
        """Ask for images.

        Parameters
        ----------
        node : subscribes.
        compressed : JPEG images instead of raw ones.
        mismatches : is informed when a publisher offers what we cannot take.
        """
        kind, topic = (CompressedImage, "image_raw/compressed") if compressed else (Image, "image_raw")
        for camera in self._cameras:
            name, qos = f"{camera}/{topic}", overridable(images_subscribed(self._lossless))
            mismatches.of_subscription(camera, name)
            node.create_subscription(kind, name, partial(self._add, camera), **qos, raw=kind is Image)

    def _add(self, camera: str, data: Any) -> None:
        """``data``: a serialized image, or a compressed one."""
        try:
            image = bgr_of_compressed(camera, data) if isinstance(data, CompressedImage) else decode_raw_image(camera, data)
        except TrackerError as error:
            self.problems[camera] = str(error)
            return
        self.problems.pop(camera, None)
        for image_set in self._formation.add(image):
            with self._condition:
                self.formed += 1
                self.dropped += len(self._waiting) == self._waiting.maxlen
                self._waiting.append(image_set)
                self._condition.notify()

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Camera -> what became of its images."""
        return self._formation.counters

    def take(self, timeout_s: float) -> ImageSet | None:
        """The newest set, or the next, once; waits for one if there is none, and returns None if none comes."""
        with self._condition:
            if not self._waiting:
                self._condition.wait(timeout=timeout_s)
            return self._waiting.popleft() if self._waiting else None

    def wake(self) -> None:
        """Let `take` return at once."""
        with self._condition:
            self._condition.notify()
