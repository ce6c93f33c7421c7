"""The detector of people as a ROS node: ``<cam>/image_raw`` in, ``<cam>/keypoints`` out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile
from tracker_msgs.msg import Crops, Keypoints

from ...loaders.bag.message_types import stamp_ns_of
from ...observation.image_set import CameraImage
from ...observation.keypoints.crop import Crop
from ...runs import messages
from ...runs.people.detection import AROUND_S, Around
from ...tracking.config import SynchronizerConfig
from ..conversions import message_of
from ..diagnostics import ERROR, OK, WARN, Diagnostics, QosMismatches
from ..guarded_node import GuardedNode
from ..parameter_overrides import check_qos_overrides
from ..qos import LIVE_IMAGES, overridable
from .worker import DetectionWorker, Detector, NewestSet

NICENESS = 5  # others have three times as much of a busy processor; with 10 a busy machine gave no points at all
_CROPS_NS = 500_000_000  # between the stamps of crops and images; older crops say nothing
_SILENT_S, _FIRST_S = 5.0, 30.0  # without an image set, and without the first one: cameras may be started after us
_LOOK_S = 0.1  # between two looks whether the networks are loaded
_POINTS = QoSProfile(depth=10)  # reliable: late points are better than none


@dataclass(frozen=True, eq=False)
class KeypointsOptions:
    """What a detector node is made of.

    Parameters
    ----------
    cameras : name -> frame of the camera, as its messages have it.
    make_detector : of people and points; may raise.
    name : of the detector, for people.
    synchronizer : how images are matched.
    trackers : nodes, and bodies of nodes, whose ``crops`` say where bodies are; empty: whole images are searched.
    joining : the same of bodies who come and go; whole images are then searched every `AROUND_S`, too.
    compressed : subscribe to JPEG images.
    rate_hz : at most so many image sets a second; 0: as many as possible.
    lossless : look at every image set, in order, instead of the newest.
    wait_for_subscribers : to the points of each camera, before the first image set is looked at: reliable messages are lost, too,
        before a publisher knows its subscriber.
    niceness : of the thread that detects.
    """

    cameras: Mapping[str, str]
    make_detector: Callable[[], Detector]
    name: str = ""
    synchronizer: SynchronizerConfig = field(default_factory=SynchronizerConfig)
    trackers: tuple[str, ...] = ("tracker",)
    joining: tuple[str, ...] = ()
    compressed: bool = False
    rate_hz: float = 0.0
    lossless: bool = False
    wait_for_subscribers: int = 0
    niceness: int = NICENESS


class KeypointsNode(GuardedNode):
    """Finds people in the newest image set, again and again; works only while somebody listens.

    Raises
    ------
    TrackerError : overrides of quality of service that there are not.
    """

    def __init__(self, options: KeypointsOptions):
        super().__init__("keypoints")
        check_qos_overrides(self)
        self._options = options
        self._diagnostics = Diagnostics(self, options.name)
        self._mismatches = QosMismatches(self, self._diagnostics)
        self._sets = NewestSet(tuple(options.cameras), options.synchronizer, options.lossless)
        self._points_of = {
            camera: self.create_publisher(Keypoints, f"{camera}/keypoints", **overridable(_POINTS)) for camera in options.cameras
        }
        for camera in options.cameras:
            self._mismatches.of_publisher(f"points of {camera}", f"{camera}/keypoints")
        followed = (*options.trackers, *options.joining)
        self._crops: dict[str, tuple[int, Mapping[str, Crop]]] = {name: (0, {}) for name in followed}
        self._waits = options.wait_for_subscribers > 0
        for name in followed:
            self.create_subscription(Crops, f"{name}/crops", partial(self._take_crops, name), LIVE_IMAGES)
        self.worker = DetectionWorker(
            self._sets, options.make_detector, self._expected, self._publish, rate_hz=options.rate_hz,
            niceness=options.niceness, wanted=self._listened_to, on_error=self.get_logger().error,
            around=Around(AROUND_S if options.joining else None).due,
        )  # fmt: skip
        self._before_s, self._before, self._formed_s = time.monotonic(), (0, 0), time.monotonic()
        self._begins = self.create_timer(_LOOK_S, self._subscribe_when_ready, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer_of_node = self.create_timer(1.0, self.report, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.worker.start()

    @property
    def fatal(self) -> Exception | None:
        """Why there is no detector."""
        return self.worker.fatal

    def close(self) -> None:
        """End the work."""
        self.worker.stop()

    def _subscribe_when_ready(self) -> None:
        """Sources wait for subscribers: with one that is still loading its networks, a recording would be half over."""
        if self.worker.ready.is_set():
            self._begins.cancel()
            self._formed_s = time.monotonic()
            self._sets.subscribe(self, self._options.compressed, self._mismatches)

    def _take_crops(self, name: str, message: Crops) -> None:
        self._crops[name] = stamp_ns_of(message.header.stamp), messages.crops_in(message)

    def _expected(self, stamp_ns: int) -> Mapping[str, tuple[Crop, ...]]:
        """By camera, around everybody; empty while one of the bodies is not known, which may be anywhere."""
        recent = {name: crops for name, (crops_ns, crops) in self._crops.items() if abs(stamp_ns - crops_ns) <= _CROPS_NS}
        known = {name: crops for name, crops in recent.items() if crops}
        if any(name not in known for name in self._options.trackers):
            return {}
        return {camera: tuple(crops[camera] for crops in known.values() if camera in crops) for camera in self._options.cameras}

    def _listened_to(self) -> bool:
        counts = [publisher.get_subscription_count() for publisher in self._points_of.values()]
        self._waits = self._waits and min(counts) < self._options.wait_for_subscribers
        return any(counts) and not self._waits

    def _publish(self, images: list[CameraImage]) -> None:
        """All cameras at once, so that a tracker has them together."""
        contents = [(i.camera, messages.keypoints(i, self._options.cameras[i.camera], self._options.name)) for i in images]
        for camera, message in [(camera, message_of(Keypoints, content)) for camera, content in contents]:
            self._points_of[camera].publish(message)

    def report(self) -> None:
        """Once a second: rate, times, and what is dropped."""
        self._mismatches.recheck()
        now, worker, sets = time.monotonic(), self.worker, self._sets
        rate = (worker.detected - self._before[0]) / max(now - self._before_s, 1e-3)
        if sets.formed > self._before[1]:
            self._formed_s = now
        self._before_s, self._before = now, (worker.detected, sets.formed)
        took = list(worker.took_ms)
        values: dict[str, object] = {
            "image sets per second": rate,
            "image sets": sets.formed,
            "image sets with points": worker.detected,
            "image sets dropped": sets.dropped,
            "image sets failed": worker.failed,
            "images": worker.images,
            "images searched around the body alone": worker.in_crops,
        }
        if took:
            values |= {"processing p50 [ms]": float(np.median(took)), "processing max [ms]": float(max(took))}
        self._diagnostics.report("detector", *self._assessment(now), values)

    def _assessment(self, now: float) -> tuple[bytes, str]:
        worker = self.worker
        if worker.fatal is not None:
            return ERROR, str(worker.fatal)
        if not worker.ready.is_set():
            return OK, "loading the networks"
        if self._sets.problems:
            return ERROR, next(iter(self._sets.problems.values()))
        if worker.problem:
            return WARN, worker.problem
        if now - self._formed_s > (_SILENT_S if self._sets.formed else _FIRST_S):
            return WARN, "no image sets"
        if not self._sets.formed:
            return OK, "waiting for images"
        if self._listened_to():
            return OK, "detecting"
        return OK, "waiting for subscribers" if self._waits else "nobody listens: no image is searched"
