"""Where an offline run gets its image sets: the sources of a rig, the images of a bag, or the very sets of an earlier run.

What breaks on the way is noted and the rest goes on. A camera whose recording breaks off is taken out of the matching, so
the others still make sets; one that merely ends earlier is matched as the configuration says, like a live one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..camera.rig import CameraRig
from ..errors import CalibrationError, SourceError, TrackerError
from ..loaders.bag.images import image_of, image_topics
from ..loaders.bag.reader import BagReader
from ..loaders.images.feed import ImageFeed
from ..loaders.images.source import ImageSource, SourceOptions, open_camera_source
from ..observation.image_set import CameraImage, ImageSet
from ..tracking.config import SynchronizerConfig
from .loop import SetFormation
from .messages import CAMERA_INFO, lens_of
from .messages.people import with_people
from .people.recorded import BagPoints

_ALWAYS_NAMED = ("received", "used")
_UNEQUAL_ENDS_S = 0.1  # cameras that are switched off together end within this


class ImageSetStream(ABC):
    """Iterable of image sets; the other attributes are complete when the iteration is over.

    Attributes
    ----------
    errors : what went wrong, one sentence each; what is in it before the iteration is known beforehand.
    notes : what is unusual about the sources and good to know.
    n_expected : number of sets, as far as it is known beforehand.
    """

    def __init__(self, rig: CameraRig):
        self.rig = rig
        self.errors: list[str] = []
        self.notes: list[str] = []
        self.n_expected: int | None = None

    @abstractmethod
    def __iter__(self) -> Iterator[ImageSet]: ...

    @property
    @abstractmethod
    def counters(self) -> dict[str, dict[str, int]]:
        """Camera -> what became of its images."""

    @property
    def sets_not_formed(self) -> dict[str, int]:
        """Time steps without a set, by the reasons of the synchronizer; none where sets are not matched anew."""
        return {}

    def size_problem(self, image: CameraImage) -> str:
        """As `CameraModel.size_problem`, with the camera's name."""
        problem = self.rig[image.camera].model.size_problem(image.pixels)
        return str(CalibrationError(image.camera, problem)) if problem else ""


class _MatchedStream(ImageSetStream):
    """Sets of images that are matched as they come."""

    def __init__(self, rig: CameraRig, cameras: tuple[str, ...], config: SynchronizerConfig):
        super().__init__(rig)
        self._config, self._formation = config, SetFormation(cameras, config)
        self._last_ns: dict[str, int] = {}

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Reasons by which an image is in no set are named where they occur."""
        found = {camera: counts for camera, counts in self._formation.counters.items() if any(counts.values())}
        others = sorted({reason for counts in found.values() for reason in counts} - {*_ALWAYS_NAMED})
        reasons = (*_ALWAYS_NAMED, *others)
        named = {c: {r: counts.get(r, 0) for r in reasons} for c, counts in found.items()}
        return {c: {r: n for r, n in counts.items() if n or r in _ALWAYS_NAMED} for c, counts in named.items()}

    @property
    def sets_not_formed(self) -> dict[str, int]:
        return {reason: n for reason, n in self._formation.sets_not_formed.items() if n}

    def _add(self, image: CameraImage) -> list[ImageSet]:
        self._last_ns[image.camera] = max(image.stamp_ns, self._last_ns.get(image.camera, image.stamp_ns))
        return self._formation.add(image)

    def _finish(self) -> Iterator[ImageSet]:
        yield from self._formation.flush()
        self.errors += self._early_ends()

    def _early_ends(self) -> list[str]:
        """A sentence for each camera that was still asked for when its images ended long before the others'."""
        latest_ns = max(self._last_ns.values(), default=0)
        sentences = []
        for camera in self._formation.cameras:
            silent_s = (latest_ns - self._last_ns.get(camera, latest_ns)) * 1e-9
            if silent_s > max(_UNEQUAL_ENDS_S, 2 * self._config.image_period_s):
                needed = "all cameras" if not self._config.min_cameras else f"at least {self._config.min_cameras} cameras"
                sentences.append(f"camera '{camera}' stopped {silent_s:.2f} s before the others; a set needs {needed}")
        return sentences


class SourceStream(_MatchedStream):
    """Sets from the videos and folders that the rig names.

    Raises
    ------
    SourceError : not a single source can be opened.
    """

    def __init__(
        self, rig: CameraRig, config: SynchronizerConfig, options: SourceOptions | None = None, rig_file: str = "rig"
    ):  # fmt: skip
        options = options or SourceOptions()
        errors: list[str] = []
        self._sources = opened_sources(rig, options, errors, rig_file)
        super().__init__(resampled_rig(rig, options), tuple(self._sources), config)
        self.errors += errors
        self.notes += [f"camera '{name}': {source.note}" for name, source in self._sources.items() if source.note]
        self.notes += unequal_numbers(self._sources, [camera.name for camera in rig if camera.time_offset_ns])
        self.n_expected = min(source.n_images for source in self._sources.values())

    @property
    def sources(self) -> Mapping[str, ImageSource]:
        """Camera -> source, of those that can be used."""
        return self._sources

    def image_numbers(self) -> dict[str, dict[int, int]]:
        """Camera -> stamp, ns -> number of the image in its source, from 0."""
        return {name: {source.stamp_ns(i): i for i in source.numbers} for name, source in self._sources.items()}

    def __iter__(self) -> Iterator[ImageSet]:
        for item in merged_images(self._sources, self.errors):
            if isinstance(item, BrokenOff):
                self._formation.drop(item.camera, item.last_stamp_ns)
            else:
                yield from self._add(item)
        yield from self._finish()


class BagStream(_MatchedStream):
    """Sets from the images of a bag, matched in the order in which they were recorded, as the live tracker got them.

    Parameters
    ----------
    rig, config, reader : cameras; how images become sets; of the bag.
    with_points : give each image the people that a message of the bag has found in it.

    Raises
    ------
    SourceError : the bag has no images of the rig's cameras.
    """

    def __init__(self, rig: CameraRig, config: SynchronizerConfig, reader: BagReader, with_points: bool = False):
        self._reader, self._topics = reader, topics_with_images(reader, rig)
        self._points = BagPoints(reader) if with_points else None
        self._without_points: set[str] = set()
        present = tuple(camera for camera in rig.names if camera in self._topics.values())
        super().__init__(rig, present, config)
        self.errors += [f"camera '{c}': no images in {reader.path}" for c in rig.names if c not in present]
        if reader.recovered:
            self.errors.append(f"bag {reader.path} is unfinished: {reader.problem}")
        self.n_expected = min(reader.topics[topic].message_count for topic in self._topics)

    def __iter__(self) -> Iterator[ImageSet]:
        refused: set[str] = set()
        for image, problem in bag_images(self._reader, self._topics):
            if image.camera in refused:
                continue
            problem = problem or self.size_problem(image)
            if problem:
                refused.add(image.camera)
                self.errors.append(f"{problem}; this camera is left out from here on")
                self._formation.drop(image.camera, image.stamp_ns - 1)
            else:
                yield from self._add(self._with_points(image))
        yield from self._finish()

    def _with_points(self, image: CameraImage) -> CameraImage:
        """The image with the people of the bag; a message that cannot be used is noted, once a camera."""
        key = image.camera, image.stamp_ns
        if self._points is None or key not in self._points:
            return image
        try:
            detected = self._points.people(key)
        except TrackerError as error:
            if image.camera not in self._without_points:
                self._without_points.add(image.camera)
                self.errors.append(f"{error}; such points are left out")
            return image
        return with_people(image, detected)


@dataclass(frozen=True)
class BrokenOff:
    camera: str
    last_stamp_ns: int


def opened_sources(
    rig: CameraRig, options: SourceOptions, errors: list[str], rig_file: str = "rig"
) -> dict[str, ImageSource]:  # fmt: skip
    """Sources by camera; those that cannot be opened are noted.

    Parameters
    ----------
    rig : cameras with sources.
    options : which images, at what rate, stamps and size.
    errors : gets a sentence for each source that cannot be opened.
    rig_file : path of the rig, for the message where none can be opened.

    Returns
    -------
    sources : camera -> source, in the order of the rig.

    Raises
    ------
    SourceError : none can be opened; each cause is named once.
    """
    sources: dict[str, ImageSource] = {}
    causes: dict[str, list[str]] = {}
    for camera in rig:
        try:
            sources[camera.name] = open_camera_source(camera, options)
        except (SourceError, CalibrationError) as error:
            text = str(error) if camera.name in str(error) else f"camera '{camera.name}': {error}"
            errors.append(f"{text}; this camera is left out")
            source = error.source if isinstance(error, SourceError) and error.source != camera.name else ""
            causes.setdefault(error.problem, []).append(f"{camera.name} ({source})" if source else camera.name)
    if not sources:
        why = "; ".join(f"{problem}: {', '.join(cameras)}" for problem, cameras in causes.items())
        raise SourceError(rig_file, f"no camera has a source that can be used: {why or 'the rig is empty'}")
    return sources


def unequal_numbers(sources: Mapping[str, ImageSource], with_offset: Collection[str]) -> list[str]:
    """A sentence where folders begin at different numbers, and nothing says whether their first images belong together.

    Parameters
    ----------
    sources, with_offset : camera -> source; cameras whose time offset is known.

    Returns
    -------
    At most one.
    """
    firsts = {name: source.first_number for name, source in sources.items() if source.first_number is not None}
    if len(set(firsts.values())) < 2 or with_offset:
        return []
    begin = ", ".join(f"'{name}' at {number}" for name, number in firsts.items())
    same = "their first images are taken to be of the same time; time_offset_s in the rig says otherwise"
    return [f"image folders begin at different numbers: {begin}; {same}"]


def merged_images(sources: dict[str, ImageSource], errors: list[str]) -> Iterator[CameraImage | BrokenOff]:
    """Images of all sources, one time step after the other, in the order of the rig; a source that breaks off is noted once.

    They are decoded ahead in threads, unless options say otherwise; what comes, and in what order, does not depend on these.

    Parameters
    ----------
    sources : camera -> source.
    errors : gets a sentence for each source that breaks off.

    Yields
    ------
    item : an image; or a camera of which none comes any more.
    """
    last_ns = {camera: source.stamp_ns(source.options.start) - 1 for camera, source in sources.items()}
    told: set[str] = set()

    def broken_off() -> Iterator[BrokenOff]:
        for camera, report in feed.reports.items():
            if report.ended and report.problem and camera not in told:
                told.add(camera)
                ending = [] if report.problem in report.problems else [report.problem]
                what = "; ".join([*report.problems[:3], *ending])
                errors.append(f"camera '{camera}' after {report.read} images of '{sources[camera].path}': {what}")
                yield BrokenOff(camera, last_ns[camera])

    with ImageFeed(sources, all(source.options.ahead for source in sources.values())) as feed:
        for feed_set in feed:
            yield from broken_off()
            for image in feed_set.images:
                last_ns[image.camera] = image.stamp_ns
                yield CameraImage(image.camera, image.stamp_ns, image.bgr)
        yield from broken_off()


def resampled_rig(rig: CameraRig, options: SourceOptions) -> CameraRig:
    """The rig for the images that these options deliver; lenses are scaled as `camera_ingest` scales its ``camera_info``.

    Parameters
    ----------
    rig : with the lenses of the rig file.
    options : with the size of the images.

    Returns
    -------
    rig : the same cameras, with lenses for that size.

    Raises
    ------
    SourceError : a size of another aspect.
    """
    cameras = []
    for camera in rig:
        options.check_aspect(camera.model.width, camera.model.height, camera.name)
        size = options.output_size(camera.model.width, camera.model.height)
        same = size == (camera.model.width, camera.model.height)
        cameras.append(camera if same else replace(camera, model=camera.model.resized(*size)))
    return replace(rig, cameras=tuple(cameras))


def rig_of_bag(rig: CameraRig, reader: BagReader) -> CameraRig:
    """The rig for the images of a bag: lenses from its camera_info where that tells of another image size than the rig.

    So a run with resampled images can be made again with the rig file that it was made with.

    Parameters
    ----------
    rig : with the lenses of the rig file.
    reader : of a bag with images of its cameras.

    Returns
    -------
    rig : the same cameras, with lenses for the images of the bag.

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
    return replace(rig, cameras=tuple(cameras))


def topics_with_images(reader: BagReader, rig: CameraRig) -> dict[str, str]:
    """The topics of a bag that hold images of a rig.

    Parameters
    ----------
    reader : of the bag.
    rig : by whose names of cameras topics are known.

    Returns
    -------
    topics : topic -> camera.

    Raises
    ------
    SourceError : none.
    """
    topics = image_topics(reader, rig.names)
    if not topics:
        cameras = ", ".join(rig.names)
        raise SourceError(reader.path, f"no images of {cameras} in the bag (topics <camera>/image_raw[/compressed])")
    return topics


def bag_images(reader: BagReader, topics: dict[str, str]) -> Iterator[tuple[CameraImage, str]]:
    """Images and, for one that cannot be used, an empty one with the problem.

    Parameters
    ----------
    reader : of the bag.
    topics : topic -> camera.

    Yields
    ------
    image, problem : in the order of recording; the problem is empty for an image that can be used.
    """
    for message in reader.messages(topics):
        camera = topics[message.topic]
        try:
            yield image_of(reader, message, camera), ""
        except TrackerError as error:
            yield CameraImage(camera, message.stamp_ns, np.zeros((0, 0), np.uint8), "mono8"), str(error)
