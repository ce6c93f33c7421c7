"""Where an offline run gets its image sets: the sources of a rig, the images of a bag, or the very sets of an earlier run.

What breaks on the way is noted and the rest goes on. A camera whose recording breaks off is taken out of the matching, so
the others still make sets; one that merely ends earlier is matched as the configuration says, like a live one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..camera.camera_rig import CameraRig
from ..errors import CalibrationError, SourceError, TrackerError
from ..loaders.bag_images import image_of, image_topics, only_topic, stamp_ns_of
from ..loaders.bag_reader import BagReader
from ..loaders.image_feed import ImageFeed
from ..loaders.image_source import ImageSource, SourceOptions, open_camera_source
from ..loaders.message_types import TRACKED_STATE
from ..observation.image_set import CameraImage, ImageSet
from ..observation.image_synchronizer import ImageSynchronizer
from ..tracking.config import SynchronizerConfig
from .estimate_messages import lens_of

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


def make_synchronizer(cameras: tuple[str, ...], config: SynchronizerConfig) -> ImageSynchronizer:
    """The synchronizer that the node uses too; with fewer cameras than ``min_cameras`` all of them are asked for."""
    return ImageSynchronizer(
        cameras,
        image_period_s=config.image_period_s,
        tolerance=config.tolerance,
        queue_s=config.queue_s,
        min_cameras=min(config.min_cameras, len(cameras)),
    )


class ImageSetStream(ABC):
    """Iterable of image sets; the other attributes are complete when the iteration is over.

    Attributes
    ----------
    errors : what went wrong, one sentence each.
    n_expected : number of sets, as far as it is known beforehand.
    """

    def __init__(self, rig: CameraRig):
        self.rig = rig
        self.errors: list[str] = []
        self.n_expected: int | None = None

    @abstractmethod
    def __iter__(self) -> Iterator[ImageSet]: ...

    @property
    @abstractmethod
    def counters(self) -> dict[str, dict[str, int]]:
        """Camera -> what became of its images."""

    def _size_problem(self, image: CameraImage) -> str:
        model = self.rig[image.camera].model
        height, width = image.pixels.shape[:2]
        if (width, height) == (model.width, model.height):
            return ""
        expected = f"expected {model.width}x{model.height}, got {width}x{height}"
        return str(CalibrationError(image.camera, f"image size contradicts the calibration: {expected}"))


class _Matcher:
    """An `ImageSynchronizer` that cameras can be taken out of."""

    def __init__(self, cameras: tuple[str, ...], config: SynchronizerConfig):
        self._config = config
        self._tolerance_ns = round(config.tolerance * config.image_period_s * 1e9)
        self._synchronizer = make_synchronizer(cameras, config)
        self._done: Counter[tuple[str, str]] = Counter()
        self._leaving: dict[str, int] = {}

    def drop(self, camera: str, last_stamp_ns: int) -> None:
        """No image of ``camera`` comes after this stamp; its sets up to there are still made."""
        self._leaving[camera] = last_stamp_ns

    def add(self, image: CameraImage) -> list[ImageSet]:
        gone = [c for c, last_ns in self._leaving.items() if image.stamp_ns > last_ns + self._tolerance_ns]
        sets = self._without(gone) if gone else []
        return sets + self._synchronizer.add(image)

    def flush(self) -> list[ImageSet]:
        return self._synchronizer.flush()

    def _without(self, gone: list[str]) -> list[ImageSet]:
        sets = self._synchronizer.flush()
        self._done.update(self._flat(self._synchronizer))
        for camera in gone:
            del self._leaving[camera]
        remaining = tuple(camera for camera in self._synchronizer.cameras if camera not in gone)
        self._synchronizer = make_synchronizer(remaining, self._config)
        return sets

    @staticmethod
    def _flat(synchronizer: ImageSynchronizer) -> dict[tuple[str, str], int]:
        return {(c, reason): n for c, counts in synchronizer.counters.items() for reason, n in counts.items()}

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        total = self._done + Counter(self._flat(self._synchronizer))
        names = [*dict.fromkeys(camera for camera, _ in total)]
        reasons = ("received", "used", *sorted({r for _, r in total} - {"received", "used"}))
        return {c: {r: total[c, r] for r in reasons if total[c, r] or r in reasons[:2]} for c in names}


class SourceStream(ImageSetStream):
    """Sets from the videos and folders that the rig names.

    Raises
    ------
    SourceError : not a single source can be opened.
    """

    def __init__(self, rig: CameraRig, config: SynchronizerConfig, options: SourceOptions | None = None):
        super().__init__(rig)
        self._sources = _opened(rig, options or SourceOptions(), self.errors)
        self._matcher = _Matcher(tuple(self._sources), config)
        self.n_expected = min(source.n_images for source in self._sources.values())

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        return self._matcher.counters

    def __iter__(self) -> Iterator[ImageSet]:
        for item in _merged(self._sources, self.errors):
            if isinstance(item, _BrokenOff):
                self._matcher.drop(item.camera, item.last_stamp_ns)
            else:
                yield from self._matcher.add(item)
        yield from self._matcher.flush()


class BagStream(ImageSetStream):
    """Sets from the images of a bag, matched in the order in which they were recorded, as the live tracker got them.

    Raises
    ------
    SourceError : the bag has no images of the rig's cameras.
    """

    def __init__(self, rig: CameraRig, config: SynchronizerConfig, reader: BagReader):
        super().__init__(rig)
        self._reader = reader
        self._topics = _topics_with_images(reader, rig)
        present = tuple(camera for camera in rig.names if camera in self._topics.values())
        self.errors += [f"camera '{c}': no images in {reader.path}" for c in rig.names if c not in present]
        if reader.recovered:
            self.errors.append(f"bag {reader.path} is unfinished: {reader.problem}")
        self._matcher = _Matcher(present, config)
        self.n_expected = min(reader.topics[topic].message_count for topic in self._topics)

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        return self._matcher.counters

    def __iter__(self) -> Iterator[ImageSet]:
        refused: set[str] = set()
        for image, problem in _bag_images(self._reader, self._topics):
            if image.camera in refused:
                continue
            problem = problem or self._size_problem(image)
            if problem:
                refused.add(image.camera)
                self.errors.append(f"{problem}; this camera is left out from here on")
                self._matcher.drop(image.camera, image.stamp_ns - 1)
            else:
                yield from self._matcher.add(image)
        yield from self._matcher.flush()


@dataclass(frozen=True)
class RecordedSet:
    """The images that one recorded state was made from."""

    stamp_ns: int
    images: tuple[tuple[str, int], ...]  # camera, stamp


class RecordedRunStream(ImageSetStream):
    """The very sets that an earlier run used, as its states list them.

    Parameters
    ----------
    reader : bag with the states, and the images unless ``options`` are given.
    options : take the images from the rig's sources, whose stamps must be the recorded ones.
    tracked_state_topic : needed when the bag has states of several trackers.

    Raises
    ------
    SourceError : no states in the bag, or no images.
    """

    AHEAD = 64  # sets that may be waiting for their images; a set that more have overtaken gets none any more

    def __init__(self, rig: CameraRig, reader: BagReader, options: SourceOptions | None = None, tracked_state_topic: str = ""):
        super().__init__(rig)
        self._reader = reader
        self._options: SourceOptions | None = None
        topic = only_topic(reader, TRACKED_STATE, [tracked_state_topic] if tracked_state_topic else [])
        self.sets = [recorded_set(message) for _, message in reader.decoded(topic)]
        self.n_expected = len(self.sets)
        self._needed = Counter(key for recorded in self.sets for key in recorded.images)
        self._read: Counter[str] = Counter()
        self._used: Counter[str] = Counter()
        self.incomplete_sets = 0
        if reader.recovered:
            self.errors.append(f"bag {reader.path} is unfinished: {reader.problem}")
        if options is None:
            self._topics = _topics_with_images(reader, rig)
        else:
            self._options = replace(options, base_stamp_ns=self._base_stamp_ns(options))

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        return {camera: {"received": self._read[camera], "used": self._used[camera]} for camera in self.rig.names}

    def __iter__(self) -> Iterator[ImageSet]:
        waiting = list(reversed(self.sets))
        images: dict[tuple[str, int], CameraImage] = {}
        for image in self._images():
            self._read[image.camera] += 1
            key = (image.camera, image.stamp_ns)
            if self._needed[key] and key not in images:
                images[key] = image
                yield from self._complete(waiting, images, final=False)
        yield from self._complete(waiting, images, final=True)

    def _complete(self, waiting: list[RecordedSet], images: dict, final: bool) -> Iterator[ImageSet]:
        """Sets from the front of the queue (its end) whose images are all there."""
        while waiting:
            recorded = waiting[-1]
            missing = [key for key in recorded.images if key not in images]
            if missing and not final and len(images) <= self.AHEAD * max(len(recorded.images), 1):
                return
            waiting.pop()
            if missing or not recorded.images:
                self._note_incomplete(recorded, missing)
            else:
                found = tuple(images[key] for key in recorded.images)
                self._used.update(image.camera for image in found)
                yield ImageSet(recorded.stamp_ns, found)
            for key in recorded.images:
                self._needed[key] -= 1
                if not self._needed[key]:
                    images.pop(key, None)

    def _note_incomplete(self, recorded: RecordedSet, missing: list[tuple[str, int]]) -> None:
        self.incomplete_sets += 1
        if self.incomplete_sets == 1:
            what = ", ".join(f"{camera} at {stamp_ns} ns" for camera, stamp_ns in missing) or "it names no image"
            self.errors.append(
                f"the set at {recorded.stamp_ns} ns of {self._reader.path} cannot be made again, images are missing: {what};"
                " states from here on may differ from the recorded ones"
            )

    def _images(self) -> Iterator[CameraImage]:
        if self._options is not None:
            merged = _merged(_opened(self.rig, self._options, self.errors), self.errors)
            yield from (item for item in merged if isinstance(item, CameraImage))
            return
        for image, problem in _bag_images(self._reader, self._topics):
            problem = problem or self._size_problem(image)
            if problem and problem not in self.errors:
                self.errors.append(problem)
            if not problem:
                yield image

    def _base_stamp_ns(self, options: SourceOptions) -> int:
        """Stamp of image 0 that makes every recorded stamp one of the sources' stamps."""
        wanted: dict[str, set[int]] = {}
        for camera, stamp_ns in self._needed:
            wanted.setdefault(camera, set()).add(stamp_ns)
        sources = _opened(self.rig, options, [])
        for base_ns in [options.base_stamp_ns, *self._announced_bases(sources)]:
            shift = base_ns - options.base_stamp_ns
            if all(wanted[c] <= {s + shift for s in _stamps(source)} for c, source in sources.items() if c in wanted):
                return base_ns
        raise SourceError(
            self._reader.path,
            "its stamps are not those of the rig's sources; give the stamp of image 0 that the run had, and its rate and start",
        )

    def _announced_bases(self, sources: dict[str, ImageSource]) -> Iterator[int]:
        """Candidates from the first camera_info of each camera, which an image of the run had."""
        for camera, source in sources.items():
            for topic in self._reader.topics_of_type(CAMERA_INFO):
                first = next(self._reader.decoded(topic), None)
                if f"/{topic}".endswith(f"/{camera}/camera_info") and first is not None:
                    start_ns = source.stamp_ns(source.options.start)
                    yield stamp_ns_of(first[1].header.stamp) - start_ns + source.options.base_stamp_ns


def recorded_set(message) -> RecordedSet:
    """The set that a TrackedState was made from.

    Stamp 0 says that the camera gave no image, except in a set whose own stamp is 0 or earlier.
    """
    stamp_ns = stamp_ns_of(message.header.stamp)
    pairs = [(camera, stamp_ns_of(stamp)) for camera, stamp in zip(message.cameras, message.camera_stamps, strict=True)]
    return RecordedSet(stamp_ns, tuple((camera, ns) for camera, ns in pairs if ns or stamp_ns <= 0))


@dataclass(frozen=True)
class _BrokenOff:
    camera: str
    last_stamp_ns: int


def _opened(rig: CameraRig, options: SourceOptions, errors: list[str]) -> dict[str, ImageSource]:
    """Sources by camera; those that cannot be opened are noted."""
    sources = {}
    for camera in rig:
        try:
            sources[camera.name] = open_camera_source(camera, options)
        except (SourceError, CalibrationError) as error:
            text = str(error) if camera.name in str(error) else f"camera '{camera.name}': {error}"
            errors.append(f"{text}; this camera is left out")
    if not sources:
        raise SourceError("rig", f"no camera has a source that can be used: {'; '.join(errors) or 'the rig is empty'}")
    return sources


def _merged(sources: dict[str, ImageSource], errors: list[str]) -> Iterator[CameraImage | _BrokenOff]:
    """Images of all sources, instant by instant in the order of the rig; a source that breaks off is noted once.

    They are decoded ahead in threads; what comes, and in what order, does not depend on these.
    """
    last_ns = {camera: source.stamp_ns(source.options.start) - 1 for camera, source in sources.items()}
    told: set[str] = set()

    def broken_off() -> Iterator[_BrokenOff]:
        for camera, report in feed.reports.items():
            if report.ended and report.problem and camera not in told:
                told.add(camera)
                what = "; ".join(report.problems[:3]) or report.problem
                errors.append(f"camera '{camera}' after {report.read} images of '{sources[camera].path}': {what}")
                yield _BrokenOff(camera, last_ns[camera])

    with ImageFeed(sources) as feed:
        for instant in feed:
            yield from broken_off()
            for image in instant.images:
                last_ns[image.camera] = image.stamp_ns
                yield CameraImage(image.camera, image.stamp_ns, image.bgr)
        yield from broken_off()


def _stamps(source: ImageSource) -> set[int]:
    first = source.options.start
    return {source.stamp_ns(i) for i in range(first, first + source.n_images)}


def rig_of_bag(rig: CameraRig, reader: BagReader) -> CameraRig:
    """The rig for the images of a bag: lenses from its camera_info where that tells of another image size than the rig.

    So a run with resampled images can be made again with the rig file that it was made with.

    Raises
    ------
    CalibrationError : a camera_info that cannot be used.
    """
    cameras = []
    for camera in rig:
        for topic in reader.topics_of_type(CAMERA_INFO):
            first = next(reader.decoded(topic), None) if f"/{topic}".endswith(f"/{camera.name}/camera_info") else None
            if first is not None and (first[1].width, first[1].height) != (camera.model.width, camera.model.height):
                camera = replace(camera, model=lens_of(camera.name, first[1]))
        cameras.append(camera)
    return CameraRig(tuple(cameras), rig.world_frame)


def _topics_with_images(reader: BagReader, rig: CameraRig) -> dict[str, str]:
    topics = image_topics(reader, rig.names)
    if not topics:
        cameras = ", ".join(rig.names)
        raise SourceError(reader.path, f"no images of {cameras} in the bag (topics <camera>/image_raw[/compressed])")
    return topics


def _bag_images(reader: BagReader, topics: dict[str, str]) -> Iterator[tuple[CameraImage, str]]:
    """Images and, for one that cannot be used, an empty one with the problem."""
    for message in reader.messages(topics):
        camera = topics[message.topic]
        try:
            yield image_of(reader, message, camera), ""
        except TrackerError as error:
            yield CameraImage(camera, message.stamp_ns, np.zeros((0, 0), np.uint8), "mono8"), str(error)
