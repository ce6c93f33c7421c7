"""Cameras of all kinds as ROS cameras: images and calibrations of a whole rig, or some cameras of it, in one process.

Recorded images go out from one thread, on one common clock; each live camera has threads of its own. The event loop only serves
diagnostics, services, the consumer's answers and the topics of other nodes.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field

import numpy as np
from rclpy.clock import Clock, ClockType

from ...errors import SourceError
from ...loaders.decoding import SourceImage
from ...loaders.images.feed import FeedSet, ImageFeed, SourceReport
from ...loaders.images.live_capture import LiveSource, open_capture
from ...loaders.images.recorded_source import SourceOptions
from ...loaders.source_address import TOPIC
from ..diagnostics import ERROR, OK, WARN, Diagnostics, QosMismatches
from ..direct_images import DirectImages
from ..guarded_node import GuardedNode
from ..parameter_overrides import check_qos_overrides
from .cameras import IngestCamera, OpenedCameras
from .live_camera import LiveCamera, LiveImages, TopicSource
from .outlet import CameraCounts, CameraOutlet, ConsumerWindow, InputRecorder, Pace

_LIVE_DEPTH, _LOSSLESS_DEPTH = 10, 50  # images of a camera that may wait for a slow subscriber
_DELIVERY_S = 4.0
_TELL_S = 5.0  # of waiting for subscribers
_SETTLE_S = 0.3  # between the discovery of a subscriber here and ours there


@dataclass(frozen=True)
class IngestOptions:
    """How a rig's sources are published.

    Parameters
    ----------
    source : which images, at what rate and size.
    live_stamps : stamps are moved so that the first is the time of its publication; otherwise they are the sources'.
    as_fast_as_consumed : the next image set goes out when the consumer has answered for an earlier one; nothing is skipped.
    consumer : node whose topic ``state``, or ``bodies``, answers.
    frame_skip : skip image sets that cannot go out in time, when a later one is ready.
    wait_for_subscribers, wait_for_info_subscribers : how many of them the images and calibration of every recorded camera must
        have before the first image.
    compressed : offer ``image_raw/compressed`` too (encoded only while somebody listens).
    direct : where images are handed to another node of this process.
    """

    source: SourceOptions = field(default_factory=SourceOptions)
    live_stamps: bool = True
    as_fast_as_consumed: bool = False
    consumer: str = "tracker"
    frame_skip: bool = True
    wait_for_subscribers: int = 0
    wait_for_info_subscribers: int = 0
    compressed: bool = False
    direct: DirectImages | None = None


def check_consumable(opened: OpenedCameras, options: IngestOptions) -> None:
    """Refuse live cameras that are to be as fast as they are consumed.

    Parameters
    ----------
    opened : the cameras.
    options : of the node.

    Raises
    ------
    SourceError : naming them.
    """
    if options.as_fast_as_consumed and opened.live:
        raise SourceError(", ".join(opened.live), "a live camera does not wait for its consumer; only recordings can")


class CameraIngestNode(GuardedNode):
    """Publishes ``<cam>/image_raw``, ``<cam>/camera_info`` and diagnostics; ``<cam>/set_camera_info`` takes calibrations.

    Parameters
    ----------
    opened : from `open_cameras`.
    recorder : writes the images as they come; None to record nothing.

    Raises
    ------
    SourceError : live cameras are to be as fast as they are consumed.
    TrackerError : overrides of quality of service that there are not.
    """

    def __init__(self, opened: OpenedCameras, options: IngestOptions | None = None, recorder: InputRecorder | None = None):
        super().__init__("camera_ingest")
        self._options = options = options or IngestOptions()
        check_consumable(opened, options)
        check_qos_overrides(self)
        self._opened, self.problems = opened, dict(opened.problems)
        self._recorder = recorder
        self._diagnostics = Diagnostics(self, "camera rig")
        depth = _LOSSLESS_DEPTH if options.as_fast_as_consumed else _LIVE_DEPTH
        self._mismatches = QosMismatches(self, self._diagnostics)
        self._outlets = {
            name: CameraOutlet(self, camera, depth, options.compressed, self._mismatches, options.direct)
            for name, camera in opened.cameras.items()
        }
        self._live = {name: self._live_camera(opened.cameras[name]) for name in opened.live}
        self._dropped_before = dict.fromkeys(self._live, 0)  # at the last report
        self._recorded = {name: CameraCounts() for name in opened.recorded}
        self._window = ConsumerWindow(self, options.consumer) if options.as_fast_as_consumed else None
        self._stop = threading.Event()
        self._feed: ImageFeed | None = None
        self._published_before = dict.fromkeys(opened.cameras, 0)
        self._reported_s = time.monotonic()
        self._timer = self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._thread = threading.Thread(target=self._run, name="publish images", daemon=True)
        self.finished = threading.Event()
        self._report()

    @property
    def counts(self) -> dict[str, CameraCounts]:
        """What became of the images, by camera."""
        live = {name: camera.counts for name, camera in self._live.items()}
        return {name: live.get(name) or self._recorded[name] for name in self._opened.cameras}

    def _live_camera(self, camera: IngestCamera) -> LiveCamera:
        outlet, source = self._outlets[camera.name], self._live_images(camera)

        def publish(image: SourceImage, native_size: tuple[int, int]) -> None:
            outlet.publish(image, native_size, image.stamp_ns)

        def record(stamp_ns: int, content: np.ndarray | bytes) -> None:
            if self._recorder is not None:
                self._recorder.record(outlet.camera, stamp_ns, content, camera.capture.bayer or source.connection.bayer)

        return LiveCamera(camera, source, self._options.source, publish, record)

    def _live_images(self, camera: IngestCamera) -> LiveImages:
        address, stamps = camera.address, camera.of_rig.stamps if camera.of_rig else None
        if address.kind == TOPIC:
            return TopicSource(self, address.target, own_clock=stamps == "capture")
        size = None if camera.lens is None else (camera.lens.width, camera.lens.height)
        threads = self._options.source.threads or 1
        return LiveSource(lambda: open_capture(address, size, camera.capture, stamps, threads))

    def start(self) -> None:
        """Begin to publish, in threads."""
        for camera in self._live.values():
            camera.start()
        if self._opened.recorded:
            self._thread.start()

    def close(self) -> None:
        """End the threads; what has been published is delivered first."""
        self._stop.set()
        if self._window is not None:
            self._window.close()
        for camera in self._live.values():
            camera.source.close()
        for camera in self._live.values():
            camera.close()
        if self._thread.is_alive():
            self._thread.join(timeout=20.0)
        self._report()
        self._diagnostics.wait_until_delivered()

    def _run(self) -> None:
        try:
            if self._wait_for_subscribers():
                with ImageFeed(self._opened.recorded) as self._feed:
                    self._publish_all(self._feed)
                for outlet in self._outlets.values():  # to the recorder, too: a tracker that has answered speaks for itself alone
                    outlet.wait_until_delivered(_DELIVERY_S)
        finally:
            if not self._live:
                self.finished.set()

    def _wait_for_subscribers(self) -> bool:
        images, infos = self._options.wait_for_subscribers, self._options.wait_for_info_subscribers
        tell_s, told = time.monotonic() + _TELL_S, ""
        while not self._stop.is_set() and (images or infos):
            lacking = [name for name in self._recorded if not self._outlets[name].has_subscribers(images, infos)]
            if not lacking:
                return not self._stop.wait(_SETTLE_S)
            said = f"waiting for subscribers to {', '.join(lacking)}"
            if time.monotonic() > tell_s and said != told:
                tell_s, told = time.monotonic() + _TELL_S, said
                self.get_logger().info(said)
            self._stop.wait(0.02)
        return not self._stop.is_set()

    def _publish_all(self, feed: ImageFeed) -> None:
        """Until the sources end or we are stopped, and the consumer, if one answers, has answered for everything."""
        clock = Pace()
        for feed_set in feed:
            if self._stop.is_set():
                return
            if self._window is not None:
                if not self._window.wait():
                    return
                self._window.sent(feed_set.stamp_ns, complete=len(feed_set.images) == len(self._recorded))
                self._publish(feed_set)
                continue
            lateness_s = clock.wait(feed_set.stamp_ns, self._stop)
            shift_ns = clock.epoch_ns if self._options.live_stamps else 0
            if self._options.frame_skip and lateness_s > feed.period_s:
                feed.skip_before(feed_set.stamp_ns + round(1e9 * lateness_s))
            if self._options.frame_skip and lateness_s > feed.period_s and feed.next_is_ready:
                for image in feed_set.images:
                    self._recorded[image.camera].dropped += 1
            elif not self._stop.is_set():
                self._publish(feed_set, shift_ns, late=lateness_s > 0.5 * feed.period_s)
        if self._window is not None:
            self._window.wait_for_all()

    def _publish(self, feed_set: FeedSet, shift_ns: int = 0, late: bool = False) -> None:
        for fed in feed_set.images:
            outlet, source, image = self._outlets[fed.camera], self._opened.recorded[fed.camera], fed.image
            stamp_ns = image.stamp_ns + shift_ns
            if self._recorder is not None and image.original is not None:
                self._recorder.record(outlet.camera, stamp_ns, image.original, source.bayer)
            outlet.publish(image, (source.native_width, source.native_height), stamp_ns)
            counts = self._recorded[fed.camera]
            counts.published += 1
            counts.late += late
            counts.duplicated += fed.repeats

    def _report(self) -> None:
        self._mismatches.recheck()
        now_s = time.monotonic()
        self._elapsed_s, self._reported_s = max(now_s - self._reported_s, 1e-3), now_s
        for name, problem in self._opened.problems.items():
            self._diagnostics.report(name, ERROR, problem)
        for name in self._recorded:
            self._report_recorded(name)
        for name in self._live:
            self._report_live(name)
        self._report_bag()

    def _report_recorded(self, name: str) -> None:
        counts, report = self._recorded[name], self._feed.reports[name] if self._feed is not None else None
        if report is not None:
            counts.missing, counts.unusable, counts.skipped = report.missing, report.unusable, report.skipped
            if report.problem:
                self.problems[name] = report.problem
        self._report_camera(name, *self._assessment(name, counts, report), counts.values())

    def _report_camera(self, name: str, level: bytes, message: str, values: dict[str, int]) -> None:
        published = values["published"] - self._published_before[name]
        self._published_before[name] = values["published"]
        rated = {"images per second": published / self._elapsed_s, **values}
        self._diagnostics.report(name, level, message, rated, hardware_id=name)

    def _assessment(self, name: str, counts: CameraCounts, report: SourceReport | None) -> tuple[bytes, str]:
        if name in self.problems:
            return ERROR, f"stopped: {self.problems[name]}" if report and report.ended else self.problems[name]
        if report is not None and report.ended:
            return OK, "ended"
        if counts.missing or counts.unusable:
            return WARN, "some images cannot be read"
        if counts.dropped or counts.skipped:
            return WARN, "images are skipped to keep the rate"
        return OK, "publishing" if counts.published else "waiting"

    def _report_live(self, name: str) -> None:
        camera, connection = self._live[name], self._live[name].source.connection
        camera.counts.connections = connection.times
        problem = connection.problem or camera.problem
        self.problems.pop(name, None)
        if problem:
            self.problems[name] = problem
            level, message = ERROR, problem
        elif camera.counts.dropped > self._dropped_before[name]:
            level, message = WARN, "images are dropped: they come faster than they can be published"
        else:
            level, message = OK, "publishing" if camera.counts.published else "connecting"
        self._dropped_before[name] = camera.counts.dropped
        self._report_camera(name, level, message, camera.counts.values() | {"received": connection.received})

    def _report_bag(self) -> None:
        bag = self._recorder
        if bag is None:
            return
        values = {"messages": bag.written, "dropped": bag.dropped}
        if bag.problem:
            self._diagnostics.report("bag", ERROR, bag.problem, values)
        elif bag.dropped:
            self._diagnostics.report("bag", WARN, "the disk is too slow: images are not recorded", values)
        else:
            self._diagnostics.report("bag", OK, "recording", values)
