"""The thread in which people are found: newest image set -> detector -> points of all of its cameras at once."""

from __future__ import annotations

import os
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from ...errors import TrackerError
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.crop import Crop
from ...observation.keypoints.people import People
from .newest_set import NewestSet

_REMEMBERED = 50  # image sets that times are of


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


class Detector(Protocol):
    """Finds people in an image."""

    def detect(self, image: np.ndarray, expected: Sequence[Crop] = ()) -> People:
        """The people in an image.

        Parameters
        ----------
        image : (height, width, 3) BGR.
        expected : around people whose places are known; without any the whole image is searched.

        Returns
        -------
        Those with a person in it.
        """


class DetectionWorker:
    """Works on the newest image set, between `start` and `stop`; nothing that a detector raises ends it.

    The thread has less priority than everything else on this machine (``niceness``), so that a tracker beside it loses no image.

    Parameters
    ----------
    sets : where image sets come from.
    make_detector : made in the thread, whose priority its own threads have too.
    crops : camera -> where the body is expected at a stamp; the whole image of the others is searched.
    on_people : called in the thread with the images of a set, with their people.
    rate_hz : at most so many sets a second; 0: as many as possible.
    niceness : 0 to 19, on top of the process's own.
    wanted : whether anybody listens.
    on_error : called with what a detector has raised.

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
        crops: Callable[[int], Mapping[str, Crop]],
        on_people: Callable[[list[CameraImage]], None],
        *,
        rate_hz: float = 0.0,
        niceness: int = 0,
        wanted: Callable[[], bool] = lambda: True,
        on_error: Callable[[str], None] = lambda text: None,
    ):
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
            image_set = self._sets.take(timeout_s=0.1)
            if image_set is None or not self._wanted():
                continue
            due_s = time.monotonic() + self._period_s
            self._work(detector, image_set)

    def _work(self, detector: Detector, image_set: ImageSet) -> None:
        began, crops = time.perf_counter(), self._crops(image_set.stamp_ns)
        found = []
        try:
            for image in image_set.images:
                if self._stopping.is_set():
                    return
                found.append(replace(image, people=self._people(detector, image, crops.get(image.camera))))
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

    def _people(self, detector: Detector, image: CameraImage, crop: Crop | None) -> People:
        """In the crop; where nobody is in it, in the whole image."""
        self.images += 1
        if crop is not None:
            people = detector.detect(image.bgr, [crop])
            if people:
                self.in_crops += 1
                return people
        return detector.detect(image.bgr)
