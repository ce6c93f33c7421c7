"""Recorded cameras as ROS cameras: images and calibrations of a whole rig, or one camera of it, on one common clock.

The images go out from a thread of their own, the event loop only serves diagnostics and the consumer's answers.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ..camera.camera_rig import CameraRig
from ..errors import SourceError, TrackerError
from ..loaders.image_feed import FeedImage, ImageFeed, Instant
from ..loaders.image_source import ImageSource, PreloadedSource, SourceOptions, open_camera_source
from .consumer_window import ConsumerWindow
from .conversions import ImageBuffer, camera_info_message, compressed_message
from .diagnostics import ERROR, OK, WARN, Diagnostics
from .qos import RESULT, images_published

_LIVE_DEPTH, _LOSSLESS_DEPTH = 10, 50  # images of a camera that may wait for a slow subscriber
_DELIVERY_S = 4.0
_SETTLE_S = 0.3  # between the discovery of a subscriber here and ours there


@dataclass(frozen=True)
class IngestOptions:
    """How a rig's sources are published.

    Parameters
    ----------
    source : which images, at what rate and size.
    live_stamps : stamps are moved so that the first is the time of its publication; otherwise they are the sources'.
    as_fast_as_consumed : the next instant goes out when the consumer has answered for an earlier one; nothing is skipped.
    consumer : node whose ``state`` topic answers.
    frame_skip : skip instants that cannot go out in time, when a later one is ready.
    wait_for_subscribers, wait_for_info_subscribers : how many of them every camera's images and calibration must have before
        the first image.
    compressed : offer ``image_raw/compressed`` too (encoded only while somebody listens).
    preload : decode all images before the first goes out.
    """

    source: SourceOptions = field(default_factory=SourceOptions)
    live_stamps: bool = True
    as_fast_as_consumed: bool = False
    consumer: str = "tracker"
    frame_skip: bool = True
    wait_for_subscribers: int = 0
    wait_for_info_subscribers: int = 0
    compressed: bool = False
    preload: bool = False


@dataclass
class CameraCounts:
    """What became of a camera's images."""

    published: int = 0
    dropped: int = 0  # skipped to keep the rate
    late: int = 0  # published more than half a period after their time
    duplicated: int = 0  # same pixels as the image before (published all the same)
    missing: int = 0  # announced by the file, but not there

    def values(self) -> dict[str, int]:
        return dict(self.__dict__)


class _Outlet:
    """Publishers and message memory of one camera."""

    def __init__(self, node: Node, rig: CameraRig, name: str, source: ImageSource, options: IngestOptions):
        camera = rig[name]
        depth = _LOSSLESS_DEPTH if options.as_fast_as_consumed else _LIVE_DEPTH
        self.frame_id = camera.frame_id
        lens = camera.model
        if (source.width, source.height) != (lens.width, lens.height):
            lens = lens.resized(source.width, source.height)
        self.images = node.create_publisher(Image, f"{name}/image_raw", images_published(depth))
        self.infos = node.create_publisher(CameraInfo, f"{name}/camera_info", RESULT)
        self.compressed = None
        if options.compressed:
            topic = f"{name}/image_raw/compressed"
            self.compressed = node.create_publisher(CompressedImage, topic, images_published(depth))
        self._buffer = ImageBuffer(self.frame_id, source.width, source.height)
        self._info = camera_info_message(0, self.frame_id, lens)

    def publish(self, image: FeedImage, stamp_ns: int) -> None:
        message = self._buffer.fill(stamp_ns, image.bgr)
        self._info.header.stamp = message.header.stamp
        self.infos.publish(self._info)
        self.images.publish(message)
        if self.compressed is not None and self.compressed.get_subscription_count():
            self.compressed.publish(compressed_message(stamp_ns, self.frame_id, image.bgr))

    def has_subscribers(self, to_images: int, to_infos: int) -> bool:
        return self.images.get_subscription_count() >= to_images and self.infos.get_subscription_count() >= to_infos

    def wait_until_delivered(self, timeout_s: float) -> None:
        for publisher in (self.images, self.infos):
            publisher.wait_for_all_acked(Duration(seconds=timeout_s))


def open_sources(
    rig: CameraRig, options: IngestOptions, cameras: list[str] | None = None
) -> tuple[dict[str, ImageSource], dict[str, str]]:
    """Sources of the rig's cameras and, for those that cannot be used, the problem.

    ``cameras`` limits them; without it cameras of the rig that have no source are left to others.

    Raises
    ------
    TrackerError : when not a single one can be used.
    """
    chosen = [rig[name] for name in cameras] if cameras else [camera for camera in rig if camera.source]
    if not chosen:
        raise SourceError("rig", "none of its cameras has a source")
    sources: dict[str, ImageSource] = {}
    problems: dict[str, str] = {}
    for camera in chosen:
        try:
            source = open_camera_source(camera, options.source)
            sources[camera.name] = PreloadedSource(source) if options.preload else source
        except TrackerError as error:
            problems[camera.name] = str(error)
            first = error
    if not sources:
        raise first
    return sources, problems


class CameraIngestNode(Node):
    """Publishes ``<cam>/image_raw``, ``<cam>/camera_info`` and diagnostics.

    Parameters
    ----------
    rig : lenses and names.
    sources, problems : from `open_sources`.
    """

    def __init__(
        self,
        rig: CameraRig,
        sources: Mapping[str, ImageSource],
        problems: Mapping[str, str],
        options: IngestOptions | None = None,
    ):
        super().__init__("camera_ingest")
        self._options = options = options or IngestOptions()
        self._sources, self.problems = dict(sources), dict(problems)
        self.counts = {name: CameraCounts() for name in sources}
        self._diagnostics = Diagnostics(self, "camera rig")
        self._outlets = {name: _Outlet(self, rig, name, source, options) for name, source in sources.items()}
        self._window = ConsumerWindow(self, f"{options.consumer}/state") if options.as_fast_as_consumed else None
        self._stop = threading.Event()
        self._feed: ImageFeed | None = None
        self._timer = self.create_timer(1.0, self._report)
        self._thread = threading.Thread(target=self._run, name="publish images", daemon=True)
        self.finished = threading.Event()
        self._report()

    def start(self) -> None:
        """Begin to publish, in a thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread; what has been published is delivered first."""
        self._stop.set()
        if self._window is not None:
            self._window.close()
        if self._thread.is_alive():
            self._thread.join(timeout=20.0)
        self._report()

    def _run(self) -> None:
        try:
            if self._wait_for_subscribers():
                with ImageFeed(self._sources) as self._feed:
                    answered = self._publish_all(self._feed)
                if not answered:  # a writer may take seconds to learn that everything has arrived
                    for outlet in self._outlets.values():
                        outlet.wait_until_delivered(_DELIVERY_S)
        finally:
            self.finished.set()

    def _wait_for_subscribers(self) -> bool:
        images, infos = self._options.wait_for_subscribers, self._options.wait_for_info_subscribers
        asked = time.monotonic()
        while not self._stop.is_set() and (images or infos):
            lacking = [name for name, outlet in self._outlets.items() if not outlet.has_subscribers(images, infos)]
            if not lacking:
                return not self._stop.wait(_SETTLE_S)
            if time.monotonic() - asked > 5.0:
                asked = time.monotonic()
                self.get_logger().info(f"waiting for subscribers to {', '.join(lacking)}")
            self._stop.wait(0.02)
        return not self._stop.is_set()

    def _publish_all(self, feed: ImageFeed) -> bool:
        """Until the sources end or we are stopped; True if the consumer has answered for everything."""
        clock = _Pace()
        for instant in feed:
            if self._stop.is_set():
                return False
            if self._window is not None:
                if not self._window.wait():
                    return False
                self._window.sent(instant.stamp_ns, complete=len(instant.images) == len(self._sources))
                self._publish(instant)
                continue
            lateness_s = clock.wait(instant.stamp_ns, self._stop)
            shift_ns = clock.epoch_ns if self._options.live_stamps else 0
            if self._options.frame_skip and lateness_s > feed.period_s and feed.next_is_ready:
                for image in instant.images:
                    self.counts[image.camera].dropped += 1
            elif not self._stop.is_set():
                self._publish(instant, shift_ns, late=lateness_s > 0.5 * feed.period_s)
        return self._window is not None and self._window.wait_for_all()

    def _publish(self, instant: Instant, shift_ns: int = 0, late: bool = False) -> None:
        for image in instant.images:
            self._outlets[image.camera].publish(image, image.stamp_ns + shift_ns)
            counts = self.counts[image.camera]
            counts.published += 1
            counts.late += late
            counts.duplicated += image.repeats

    def _report(self) -> None:
        for name, problem in self.problems.items():
            if name not in self._sources:
                self._diagnostics.report(name, ERROR, problem)
        for name, counts in self.counts.items():
            report = self._feed.reports[name] if self._feed is not None else None
            if report is not None:
                counts.missing = report.missing
                if report.problem:
                    self.problems[name] = report.problem
            level, message = self._verdict(name, counts, report)
            self._diagnostics.report(name, level, message, counts.values())

    def _verdict(self, name: str, counts: CameraCounts, report) -> tuple[bytes, str]:
        if name in self.problems:
            return ERROR, f"stopped: {self.problems[name]}" if report and report.ended else self.problems[name]
        if report is not None and report.ended:
            return OK, "ended"
        if counts.missing:
            return WARN, "some images cannot be read"
        if counts.dropped:
            return WARN, "images are skipped to keep the rate"
        return OK, "publishing" if counts.published else "waiting"


class _Pace:
    """When an instant is due: its distance in stamps from the first, on the steady clock.

    ``epoch_ns`` added to a stamp gives the time of day at which it is due.
    """

    def __init__(self) -> None:
        self._epoch_s: float | None = None
        self.epoch_ns = 0

    def wait(self, stamp_ns: int, stop: threading.Event) -> float:
        """Sleep until it is due; returns by how much that was missed, in seconds."""
        now = time.monotonic()
        if self._epoch_s is None:
            self._epoch_s, self.epoch_ns = now - 1e-9 * stamp_ns, time.time_ns() - stamp_ns
        due = self._epoch_s + 1e-9 * stamp_ns
        if due > now:
            stop.wait(due - now)
        return max(0.0, time.monotonic() - due)
