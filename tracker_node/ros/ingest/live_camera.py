"""One live camera: a thread that takes its images as they come, and one that publishes them."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np

from ...errors import TrackerError
from ...loaders.decoding import Preparation, SourceImage, content_size
from ...loaders.images.feed import is_repetition
from ...loaders.images.live_capture import Connection
from ...loaders.images.recorded_source import SourceOptions
from ...loaders.images.stamps import common_ns
from ...observation.deinterlace import deinterlace
from .cameras import IngestCamera, check_size
from .counts import CameraCounts

_INTERVALS = 15  # between images, of which the median is their period
WAITING = 3  # images that may wait to be published; then the oldest is dropped and counted


class LiveImages(Protocol):
    """What `LiveSource` and `TopicSource` are."""

    connection: Connection

    def close(self) -> None: ...

    def __iter__(self) -> Iterator[tuple[int, np.ndarray | bytes]]: ...


class LiveCamera:
    """Takes, prepares and publishes the images of one camera.

    Parameters
    ----------
    camera : its lens is held against the images' size.
    source : its images.
    options : size, and whether originals are kept.
    publish : called in a thread of this camera's own with each image and the size (width, height) that it has in the source.
    record : called before, with the stamp and the image as it came.

    Attributes
    ----------
    counts : what became of the images.
    problem : why images are not published, as of the latest image; empty if they are.
    """

    def __init__(
        self,
        camera: IngestCamera,
        source: LiveImages,
        options: SourceOptions,
        publish: Callable[[SourceImage, tuple[int, int]], None],
        record: Callable[[int, np.ndarray | bytes], None] = lambda stamp_ns, content: None,
    ):
        self._camera, self.source, self._options = camera, source, options
        self._publish, self._record = publish, record
        self.counts, self.problem = CameraCounts(), ""
        self._waiting: deque[tuple[int, np.ndarray | bytes]] = deque()
        self._condition = threading.Condition()
        self._ended = False
        self._before: SourceImage | None = None
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._intervals_ns: deque[int] = deque(maxlen=_INTERVALS)
        self._preparation: Preparation | None = None
        self._prepared_for: tuple[tuple[int, int], str | None] = ((0, 0), None)
        self._threads = [
            threading.Thread(target=target, name=f"{what} {camera.name}", daemon=True)
            for target, what in ((self._take, "read"), (self._publish_all, "publish"))
        ]

    def start(self) -> None:
        """Begin."""
        for thread in self._threads:
            thread.start()

    def close(self, timeout_s: float = 10.0) -> None:
        """End both threads; what waits is published first."""
        self.source.close()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(timeout=timeout_s)

    def _take(self) -> None:
        for item in self.source:
            with self._condition:
                if len(self._waiting) >= WAITING:
                    self._waiting.popleft()
                    self.counts.dropped += 1
                self._waiting.append(item)
                self._condition.notify()
        with self._condition:
            self._ended = True
            self._condition.notify()

    def _publish_all(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: bool(self._waiting) or self._ended)
                if not self._waiting:
                    return
                own_ns, content = self._waiting.popleft()
            try:
                self._handle(self._common(own_ns), content)
                self.problem = ""
            except TrackerError as error:
                self.counts.unusable += 1
                self.problem = str(error)
            except Exception as error:  # a decoder's own failure must not end the camera
                self.counts.unusable += 1
                self.problem = f"{type(error).__name__}: {error}"

    def _common(self, own_ns: int) -> int:
        self._first_ns = own_ns if self._first_ns is None else self._first_ns
        of_rig = self._camera.of_rig
        return own_ns if of_rig is None else common_ns(own_ns, self._first_ns, of_rig.time_offset_ns, of_rig.time_drift_ppm)

    def _handle(self, stamp_ns: int, content: np.ndarray | bytes) -> None:
        native_size = content_size(content)
        check_size(self._camera, native_size)
        self._record(stamp_ns, content)
        preparation = self._prepared(native_size)
        for at_ns, part in self._instants(stamp_ns, content, preparation):
            image = preparation.image(at_ns, part)
            self.counts.duplicated += self._before is not None and is_repetition(self._before, image)
            self._before = image
            self._publish(image, native_size)
            self.counts.published += 1
        self._last_ns = stamp_ns

    def _prepared(self, native_size: tuple[int, int]) -> Preparation:
        bayer = self._camera.capture.bayer or self.source.connection.bayer
        if self._preparation is None or self._prepared_for != (native_size, bayer):
            size = self._options.output_size(*native_size)
            settings = replace(self._camera.capture, bayer=bayer)
            self._preparation = Preparation(settings, size if size != native_size else None, self._camera.address.shown)
            self._prepared_for = native_size, bayer
        return self._preparation

    def _instants(
        self, stamp_ns: int, content: np.ndarray | bytes, preparation: Preparation
    ) -> Iterable[tuple[int, np.ndarray | bytes]]:
        """The image, or its two fields, the second half a period after the first."""
        order = self._camera.interlaced
        if order is None:
            return [(stamp_ns, content)]
        woven = replace(preparation, size=None).image(stamp_ns, content).bgr
        earlier, later = deinterlace(woven, order)
        period_ns = self._period_ns(stamp_ns)
        if not period_ns:
            self.counts.unstamped += 1  # when the second field was exposed is not known before the second image
            return [(stamp_ns, earlier)]
        return [(stamp_ns, earlier), (stamp_ns + period_ns // 2, later)]

    def _period_ns(self, stamp_ns: int) -> int:
        if self._camera.capture.rate_hz is not None:
            return round(1e9 / self._camera.capture.rate_hz)
        if self._last_ns is not None:
            self._intervals_ns.append(stamp_ns - self._last_ns)
        return int(np.median(self._intervals_ns)) if self._intervals_ns else 0  # a dropped image makes one interval longer
