"""People in the images of an offline run: a detector looks where the tracker expects the body, before each step.

Where it looks depends on the states before, and on nothing else: the same run finds the same people. A live tracker gets them
from a node of their own instead. `people_of_sets` detects people in whole images, where nobody knows yet where the body is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

import numpy as np

from ...camera.rig import CameraRig
from ...errors import FileFormatError, TrackerError
from ...loaders.fetched_files import detector_name, usable_weights
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.blazepose import BlazePose, PointNetwork
from ...observation.keypoints.crop import Crop
from ...observation.keypoints.people import People, Person, checked
from ...parallel import Workers
from ...tracking.config import KEYPOINTS, TrackerConfig
from ...tracking.modality import PeopleSeen

AROUND_S = 0.3  # between searches of whole images where people may join, who are known after two
_SAME = 0.1  # median distance of points, as a fraction of a person's size, within which two are one
_TRIAL = np.zeros((64, 64, 3), np.uint8)  # shows nobody


class Detector(Protocol):
    """Finds people in one image; not in several threads at once."""

    def detect(self, image: np.ndarray, expected: Sequence[Crop] = ()) -> People:
        """The people in an image.

        Parameters
        ----------
        image : (height, width, 3) BGR.
        expected : around those whose places are known; empty: anywhere.

        Returns
        -------
        In no particular order.
        """
        ...


def people_in(detector: Detector, image: np.ndarray, crops: Sequence[Crop], around: bool = False) -> tuple[People, bool]:
    """People where bodies are expected; where nobody is, in the whole image. Live and offline look by this rule.

    Parameters
    ----------
    detector : looks.
    image : (height, width, 3) BGR.
    crops : where bodies are expected; empty: anywhere.
    around : look in the whole image for others too, such as people who have come in.

    Returns
    -------
    people : in no particular order, each once.
    expected : whether there are some in the crops.
    """
    image = np.ascontiguousarray(image)
    people = detector.detect(image, crops) if crops else ()
    if not people:
        return detector.detect(image), False
    return distinct((*people, *detector.detect(image)) if around else people), True


def distinct(people: People) -> People:
    """People each of whom is found once, the surest of those with points in the same places."""
    found: list[Person] = []
    for person in sorted(people, key=lambda person: -float(person.scores.sum())):
        size = max(person.box[2] - person.box[0], person.box[3] - person.box[1], 1.0)
        apart = [np.median(np.linalg.norm(person.pixels - other.pixels, axis=1)) / size for other in found]
        if min(apart, default=1.0) > _SAME:
            found.append(person)
    return tuple(found)


class Around:
    """When whole images are searched again, by their stamps.

    Parameters
    ----------
    period_s : so often; None: never.
    """

    def __init__(self, period_s: float | None):
        self._period_ns, self._last_ns = None if period_s is None else round(1e9 * period_s), 0

    def due(self, stamp_ns: int) -> bool:
        """Whether it is time to; a stamp that goes back begins anew."""
        if self._period_ns is None or 0 <= stamp_ns - self._last_ns < self._period_ns:
            return False
        self._last_ns = stamp_ns
        return True


class Expecting(Protocol):
    """What detection needs of a tracker."""

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]: ...


@dataclass(frozen=True, eq=False)
class DetectionOptions:
    """How people are found where `keypoints` is among the modalities.

    Parameters
    ----------
    weights : of the network that finds points, such as those of ``heavy``; None: ``full``, which is fetched.
    every_sets : look at every n-th image set; the others go by what else is compared.
    around_s : so often whole images are searched for people who have come in; None: only while a body is not known.
    make : makes another detector, one for each thread; None: BlazePose.
    """

    weights: Path | None = None
    every_sets: int = 1
    around_s: float | None = None
    make: Callable[[], Detector] | None = None

    def __post_init__(self):
        if self.every_sets < 1:
            raise ValueError(f"expected every_sets of 1 or more, got {self.every_sets}")

    @property
    def name(self) -> str:
        """Of the detector, for people."""
        return detector_name(self.weights) if self.make is None else ""


class PeopleDetection:
    """Puts people into image sets, camera by camera on the threads of the configuration.

    Images that have people already, from a bag or from files, are left as they are.

    Parameters
    ----------
    rig, config : as for the `Tracker`; ``keypoints`` is among the modalities.
    options : how.

    Raises
    ------
    TrackerError : weights or the package that runs them are missing, or only points are compared and not in every set.

    Attributes
    ----------
    ms : of each image that was looked at.
    """

    def __init__(self, rig: CameraRig, config: TrackerConfig, options: DetectionOptions):
        if options.every_sets > 1 and config.modalities == (KEYPOINTS,):
            raise TrackerError(f"points in every {options.every_sets}th image set take the modality region beside, got none")
        self._names, self._options = rig.names, options
        self._workers = Workers(config.threads)
        self._idle: SimpleQueue[Detector] = SimpleQueue()
        for detector in detectors_of(options, min(config.threads, len(rig))):
            self._idle.put(detector)
        self._count, self._last_ns, self._around = 0, 0, Around(options.around_s)
        self.ms: list[float] = []

    def with_people(self, tracker: Expecting, image_set: ImageSet) -> ImageSet:
        """The image set with the people in its images.

        Parameters
        ----------
        tracker : knows where the body is expected in them.
        image_set : the next one to be tracked.

        Returns
        -------
        The same images, their ``people`` filled where a detector was to look.
        """
        if image_set.stamp_ns < self._last_ns:
            self._count = 0  # a recording began again
        self._last_ns, turn = image_set.stamp_ns, self._count % self._options.every_sets
        self._count += 1
        if turn or all(image.people is not None for image in image_set.images):
            return image_set
        crops = dict(zip(self._names, tracker.expected_crops(image_set.stamp_ns), strict=True))
        around = self._around.due(image_set.stamp_ns)
        found = self._workers.map(lambda image: self._looked_at(image, crops.get(image.camera, ()), around), image_set.images)
        self.ms += [ms for _, ms in found if ms is not None]
        return replace(image_set, images=tuple(image for image, _ in found))

    def _looked_at(self, image: CameraImage, crops: Sequence[Crop], around: bool) -> tuple[CameraImage, float | None]:
        if image.people is not None:
            return image, None
        detector, began = self._idle.get(), time.perf_counter()
        try:
            people, _ = people_in(detector, image.bgr, crops, around)
        finally:
            self._idle.put(detector)
        usable = tuple(checked(person) for person in people)
        return replace(image, people=usable), 1e3 * (time.perf_counter() - began)

    @property
    def detector(self) -> str:
        """Name of what looks, for people."""
        return self._options.name

    def summary(self) -> dict[str, Any]:
        """For ``run.json``: what has looked, and at how many images."""
        options, ms = self._options, float(np.mean(self.ms)) if self.ms else None
        return {"detector": options.name, "every_sets": options.every_sets, "images": len(self.ms), "ms_per_image": ms}


def detectors_of(options: DetectionOptions, n: int = 1) -> list[Detector]:
    """So many of the same kind, since one cannot be used by two threads.

    Parameters
    ----------
    options : of which kind.
    n : how many.

    Returns
    -------
    The detectors.

    Raises
    ------
    TrackerError : weights or the package that runs them are missing, or they are of another network.
    """
    if options.make is not None:
        return [options.make() for _ in range(n)]
    files = usable_weights(options.weights)
    try:
        PointNetwork(files.points).read(_TRIAL, Crop((31.5, 31.5), 64.0))
    except (ValueError, RuntimeError, IndexError) as error:
        expected = "a network with the inputs and outputs of pose_landmark_full.tflite"
        raise FileFormatError(files.points, "(network)", expected, str(error).splitlines()[0]) from error
    return [BlazePose(files) for _ in range(n)]


FindPeople = Callable[[Expecting, ImageSet], ImageSet]


class Recording(Protocol):
    """Image sets of a rig, such as an `ImageSetStream`; ``n_expected``: how many, where that is known."""

    @property
    def rig(self) -> CameraRig: ...

    @property
    def n_expected(self) -> int | None: ...

    def __iter__(self) -> Iterator[ImageSet]: ...


class _Anywhere:
    """Expects nobody at any place."""

    def __init__(self, n_cameras: int):
        self._n_cameras = n_cameras

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]:
        return [()] * self._n_cameras


def people_of_sets(
    recording: Recording, n_sets: int, find: FindPeople, progress: Callable[[str, int, int], None] = lambda *_: None
) -> list[PeopleSeen]:
    """Everybody in some image sets, spread over a recording.

    Parameters
    ----------
    recording : its first sets are taken where its length is not known.
    n_sets : image sets, at most.
    find : `with_people` of a `PeopleDetection`, or of `RecordedPeople`.
    progress : called with what is done, how often it has been done, and how often it will be.

    Returns
    -------
    By image set and camera, empty where a camera has no image.
    """
    n = min(n_sets, recording.n_expected or n_sets)
    wanted = {k * (recording.n_expected or n) // n for k in range(n)}
    nowhere, found = _Anywhere(len(recording.rig)), list[PeopleSeen]()
    for row, image_set in enumerate(recording):
        if row in wanted:
            seen = find(nowhere, image_set)
            of_camera = {image.camera: image.people or () for image in seen.images}
            found.append([of_camera.get(name, ()) for name in recording.rig.names])
            progress("people", len(found), n)
            if len(found) == n:
                break
    return found
