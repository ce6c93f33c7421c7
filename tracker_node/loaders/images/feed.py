"""Several image sources as one stream of time steps on a common clock.

Each source is decoded in a thread of its own, a few images ahead, or by whoever iterates. A source that fails ends, with its
problem named; the others go on.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...closing import Closing
from ...errors import TrackerError
from ..decoding import SourceImage
from .recorded_source import ImageSource, ReadCounts

_AHEAD = 3  # decoded images that wait, per camera
_SAME_TIME = 0.4  # of the shortest image period


@dataclass(frozen=True)
class FeedImage:
    """One image of a camera; ``repeats`` when its pixels are those of the camera's image before."""

    camera: str
    image: SourceImage
    repeats: bool

    @property
    def stamp_ns(self) -> int:
        return self.image.stamp_ns

    @property
    def bgr(self) -> np.ndarray:
        return self.image.bgr


@dataclass(frozen=True)
class FeedSet:
    """Images that belong together; ``stamp_ns`` is that of the earliest."""

    stamp_ns: int
    images: tuple[FeedImage, ...]


@dataclass
class SourceReport(ReadCounts):
    """What became of one camera's source; images that wait are not counted as read."""

    ended: bool = False
    problem: str = ""


class ImageFeed(Closing):
    """Iterates the `FeedSet`s of several sources in order of time.

    Parameters
    ----------
    sources : camera name -> its images; the order is that of the images in a time step.
    ahead : decode in threads; False: image by image, as they are asked for.

    Use it as a context manager, or call `close`, so that the decoding threads end.
    """

    def __init__(self, sources: Mapping[str, ImageSource], ahead: bool = True):
        self._sources = dict(sources)
        shortest_s = min((1.0 / source.rate_hz for source in self._sources.values()), default=1.0)
        self.period_s = shortest_s
        self._tolerance_ns = round(_SAME_TIME * shortest_s * 1e9)
        self.reports = {camera: SourceReport() for camera in self._sources}
        self._stop = threading.Event()
        self._queues: dict[str, queue.Queue] = {camera: queue.Queue(_AHEAD) for camera in self._sources}
        self._decoded = {camera: self._decode(camera) for camera in self._sources}
        self._ahead = ahead
        self._threads = [
            threading.Thread(target=self._decode_ahead, args=(camera,), name=f"decode {camera}", daemon=True)
            for camera in (self._sources if ahead else ())
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End the decoding threads."""
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout=10.0)

    def skip_before(self, stamp_ns: int) -> None:
        """Images before this stamp are late already: where that saves work, they are left out and counted."""
        for source in self._sources.values():
            source.skip_before(stamp_ns)

    @property
    def next_is_ready(self) -> bool:
        """Whether the time step after the current one is decoded already."""
        return all(report.ended or not self._queues[camera].empty() for camera, report in self.reports.items())

    def __iter__(self) -> Iterator[FeedSet]:
        heads = {camera: self._next(camera) for camera in self._sources}
        while True:
            waiting = {camera: image for camera, image in heads.items() if image is not None}
            if not waiting or self._stop.is_set():
                return
            first_ns = min(image.stamp_ns for image in waiting.values())
            group = [camera for camera, image in waiting.items() if image.stamp_ns <= first_ns + self._tolerance_ns]
            yield FeedSet(first_ns, tuple(waiting[camera] for camera in group))
            for camera in group:
                heads[camera] = self._next(camera)

    def _next(self, camera: str) -> FeedImage | None:
        report, source = self.reports[camera], self._sources[camera]
        while not self._stop.is_set():
            try:
                item = self._queues[camera].get(timeout=0.2) if self._ahead else next(self._decoded[camera])
            except queue.Empty:
                continue
            if isinstance(item, FeedImage):
                report.read += 1
                self._copy_counts(report, source)
                return item
            report.ended = True
            self._copy_counts(report, source)
            report.problem = item or (report.problems[-1] if report.problems else "")
            return None
        return None

    @staticmethod
    def _copy_counts(report: SourceReport, source: ImageSource) -> None:
        counts = source.counts
        report.missing, report.unusable, report.skipped = counts.missing, counts.unusable, counts.skipped
        report.problems = counts.problems

    def _decode(self, camera: str) -> Iterator[FeedImage | str]:
        """Images, and at last why there are no more."""
        try:
            yield from _marked(camera, self._sources[camera].images())
            yield ""
        except TrackerError as error:
            yield str(error)
        except Exception as error:  # a decoder's own failure must not silence the other cameras
            yield f"{type(error).__name__}: {error}"

    def _decode_ahead(self, camera: str) -> None:
        for item in self._decoded[camera]:
            if not self._put(camera, item):
                return

    def _put(self, camera: str, item: FeedImage | str) -> bool:
        while not self._stop.is_set():
            try:
                self._queues[camera].put(item, timeout=0.2)
            except queue.Full:
                continue
            return True
        return False


def _marked(camera: str, images: Iterable[SourceImage]) -> Iterator[FeedImage]:
    before: SourceImage | None = None
    for image in images:
        yield FeedImage(camera, image, before is not None and is_repetition(before, image))
        before = image


def is_repetition(before: SourceImage, image: SourceImage) -> bool:
    """Whether two images of a camera are the same to the last bit.

    Parameters
    ----------
    before, image : images that follow each other.

    Returns
    -------
    True for the same pixels, or the same JPEG.
    """
    a, b = before.pixels, image.pixels
    if a is None or b is None:
        return before.jpeg == image.jpeg
    # A few pixels tell almost all images apart, the rest only confirms.
    return bool(np.array_equal(a[::16, ::16], b[::16, ::16]) and np.array_equal(a, b))
