"""The very image sets of an earlier run: its states list the stamps of the images that were used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..camera.rig import CameraRig
from ..errors import SourceError
from ..loaders.bag.images import only_topic
from ..loaders.bag.message_types import TRACKED_STATE, stamp_ns_of
from ..loaders.bag.reader import BagReader
from ..loaders.images.source import ImageSource, SourceOptions
from ..observation.image_set import CameraImage, ImageSet
from ..tracking.estimate import Status, TrackEstimate
from .image_sets import ImageSetStream, bag_images, merged_images, opened_sources, topics_with_images
from .load import state_messages
from .messages import CAMERA_INFO
from .messages.people import with_people
from .people.recorded import BagPoints

_SAME_M = 0.001  # states made again are the same to the last bit on one machine


@dataclass(frozen=True)
class RecordedSet:
    """The images that one recorded state was made from, and the points of a detector that were used with them."""

    stamp_ns: int
    images: tuple[tuple[str, int], ...]  # camera, stamp
    points: tuple[tuple[str, int], ...] = ()  # camera, stamp of the image that they were found in
    root: tuple[float, float, float] | None = None  # where the body was, meters, world; None: there was no state yet


class RecordedRunStream(ImageSetStream):
    """The very sets that an earlier run used, as its states list them.

    Parameters
    ----------
    reader : bag with the states, and the images unless ``options`` are given.
    options : take the images from the rig's sources, whose stamps must be the recorded ones.
    topic : of the states, where the bag has those of several bodies.

    Raises
    ------
    SourceError : no states in the bag, or no images.
    """

    AHEAD = 64  # sets that may be waiting for their images; a set that more have overtaken gets none any more

    def __init__(self, rig: CameraRig, reader: BagReader, options: SourceOptions | None = None, topic: str | None = None):
        super().__init__(rig)
        self._reader = reader
        self._options: SourceOptions | None = None
        topic = topic or only_topic(reader, TRACKED_STATE)
        self.sets = [recorded_set(message) for message in state_messages(reader, topic)]
        self.n_expected = len(self.sets)
        self._needed = Counter(key for recorded in self.sets for key in recorded.images)
        self._read: Counter[str] = Counter()
        self._used: Counter[str] = Counter()
        with_points = {key for recorded in self.sets for key in recorded.points}
        self._points = BagPoints(reader, with_points) if with_points else None
        self.incomplete_sets = 0
        self._to_compare = iter(self.sets)
        self._differs_from_ns: int | None = None
        self._most_m = 0.0
        if reader.recovered:
            self.errors.append(f"bag {reader.path} is unfinished: {reader.problem}")
        if options is None:
            self._topics = topics_with_images(reader, rig)
        else:
            self._options = replace(options, base_stamp_ns=self._base_stamp_ns(options))

    @property
    def source_options(self) -> SourceOptions | None:
        """By which the rig's sources give the recorded stamps; None where the images come from the bag."""
        return self._options

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        return {camera: {"received": self._read[camera], "used": self._used[camera]} for camera in self.rig.names}

    @property
    def difference(self) -> str:
        """How the estimates that were compared differ from the recorded ones, for people; empty where they do not."""
        if self._differs_from_ns is None or self.incomplete_sets:  # which is told already
            return ""
        after_s, most_mm = (self._differs_from_ns - self.sets[0].stamp_ns) * 1e-9, 1000.0 * self._most_m
        told = f"states differ from the recorded ones from {after_s:.2f} s on, by up to {most_mm:.0f} mm"
        return f"{told}: was the tracker restarted then, or given other parameters? Or is it another body, start, or version?"

    def compare(self, estimate: TrackEstimate) -> None:
        """To be told of each estimate that is made as the recorded ones were."""
        root = next((recorded.root for recorded in self._to_compare if recorded.stamp_ns == estimate.stamp_ns), None)
        if root is None or not estimate.status.has_state:
            return
        apart_m = float(np.linalg.norm(estimate.state.T_world_root[:3, 3] - root))
        self._most_m = max(self._most_m, apart_m)
        if apart_m > _SAME_M and self._differs_from_ns is None:
            self._differs_from_ns = estimate.stamp_ns

    def __iter__(self) -> Iterator[ImageSet]:
        waiting = list(reversed(self.sets))
        images: dict[tuple[str, int], CameraImage] = {}
        for image in self._images():
            self._read[image.camera] += 1
            key = (image.camera, image.stamp_ns)
            if self._needed[key]:
                images[key] = image  # in a loop its stamp comes again, with its next pass
                yield from self._complete(waiting, images, final=False)
        yield from self._complete(waiting, images, final=True)

    def _complete(self, waiting: list[RecordedSet], images: dict, final: bool) -> Iterator[ImageSet]:
        """Sets from the front of the queue (its end) whose images are all there."""
        while waiting:
            recorded = waiting[-1]
            missing = [key for key in recorded.images if key not in images]
            lacking = [key for key in recorded.points if self._points is None or key not in self._points]
            if missing and not final and len(images) <= self.AHEAD * max(len(recorded.images), 1):
                return
            waiting.pop()
            if lacking or missing or not recorded.images:
                self._note_incomplete(recorded, missing, lacking)
            if not missing and recorded.images:
                found = tuple(self._with_points(images[key], recorded) for key in recorded.images)
                self._used.update(image.camera for image in found)
                yield ImageSet(recorded.stamp_ns, found)
            for key in recorded.images:
                self._needed[key] -= 1
                images.pop(key, None)

    def _with_points(self, image: CameraImage, recorded: RecordedSet) -> CameraImage:
        """The image with the people that were used with it; with none where none were."""
        for key in recorded.points:
            if key[0] == image.camera and self._points is not None and key in self._points:
                return with_people(image, self._points.people(key))
        return image

    def _note_incomplete(self, recorded: RecordedSet, missing: list[tuple[str, int]], lacking: list[tuple[str, int]]) -> None:
        self.incomplete_sets += 1
        if self.incomplete_sets == 1:
            kind = "points" if lacking and not missing else "images"
            what = ", ".join(f"{camera} at {stamp_ns} ns" for camera, stamp_ns in missing or lacking) or "it names no image"
            self.errors.append(
                f"the set at {recorded.stamp_ns} ns of {self._reader.path} cannot be made again, {kind} are missing: {what};"
                " states from here on may differ from the recorded ones"
            )

    def _images(self) -> Iterator[CameraImage]:
        if self._options is not None:
            merged = merged_images(opened_sources(self.rig, self._options, self.errors), self.errors)
            yield from (item for item in merged if isinstance(item, CameraImage))
            return
        for image, problem in bag_images(self._reader, self._topics):
            problem = problem or self.size_problem(image)
            if problem and problem not in self.errors:
                self.errors.append(problem)
            if not problem:
                yield image

    def _base_stamp_ns(self, options: SourceOptions) -> int:
        """Stamp of image 0 that makes every recorded stamp one of the sources' stamps."""
        wanted: dict[str, set[int]] = {}
        for camera, stamp_ns in self._needed:
            wanted.setdefault(camera, set()).update({stamp_ns} - {0})  # a set at 0 may mean that there was no image
        sources = opened_sources(self.rig, options, [])
        for base_ns in [options.base_stamp_ns, *self._announced_bases(sources)]:
            shift = base_ns - options.base_stamp_ns
            stamps = {c: {source.stamp_ns(i) + shift for i in source.numbers} for c, source in sources.items()}
            if all(wanted[c] <= stamps[c] for c in sources if c in wanted):
                self._drop_absent({c for c in sources if 0 not in stamps[c]})
                return base_ns
        raise SourceError(
            self._reader.path,
            "its stamps are not those of the rig's sources; give the stamp of image 0 that the run had, and its rate and start",
        )

    def _drop_absent(self, cameras: set[str]) -> None:
        """In sets at stamp 0, whose message says 0 for "no image" too: these cameras had none."""
        absent = {(camera, 0) for camera in cameras}
        self.sets = [replace(s, images=tuple(key for key in s.images if key not in absent)) for s in self.sets]
        for key in absent & set(self._needed):
            del self._needed[key]

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
    images = tuple((camera, ns) for camera, ns in pairs if ns or stamp_ns <= 0)
    used = zip(getattr(message, "keypoint_cameras", ()), getattr(message, "keypoint_stamps", ()), strict=True)
    points = tuple((camera, stamp_ns_of(stamp)) for camera, stamp in used)
    place = message.root_pose.position
    root = (place.x, place.y, place.z) if Status(message.status).has_state else None
    return RecordedSet(stamp_ns, images, points, root)
