"""People in the images of an offline run from the files of any detector, by the numbers of the images.

Points of people in a bag, by the images that they were found in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np

from ...camera.rig import CameraRig
from ...errors import FileFormatError, TrackerError
from ...loaders.bag.message_types import KEYPOINTS, stamp_ns_of
from ...loaders.bag.reader import BagMessage, BagReader
from ...loaders.keypoints.camera_people import CameraPeople, PointsByCamera, match_files
from ...loaders.keypoints.formats import load_points
from ...loaders.keypoints.table import load_keypoint_table, load_point_names
from ...model.articulated import ArticulatedModel
from ...model.humans.keypoints import KeypointTable, table_of
from ...model.humans.measures import mirrored_name
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.people import People, Person
from ..messages.people import DetectedPeople, detected_people

ImageNumbers = Mapping[str, Mapping[int, int]]
"""Camera -> stamp, ns -> number of the image in its source, from 0."""
_MOST_USED = 50  # people in an image; of more, the likeliest


@dataclass(frozen=True)
class PointFiles:
    """Points of a detector in files.

    Attributes
    ----------
    path : file or folder, see `loaders.keypoints.formats.load_points`.
    table : keypoints.yaml; None: the built-in table whose points the detector has.
    first : number of the image that the first image of the files is.
    """

    path: Path
    table: Path | None = None
    first: int = 0


class RecordedPeople:
    """Gives the people in a camera's images.

    Parameters
    ----------
    points : people by file.
    table : what points are on the body.
    rig, delivered : cameras with lenses for the images in which the detector has looked; and for those that are tracked.
    numbers : camera -> stamp, ns -> number of the image in its source, from 0.
    first : number of the image that the first image of the files is.

    Raises
    ------
    UnknownNameError : no file belongs to a camera.

    Attributes
    ----------
    table : as given.
    detector : name of what has looked, for people: files do not say it.
    notes : a sentence for each camera without points.
    """

    detector = "files"

    def __init__(
        self, points: PointsByCamera, table: KeypointTable, rig: CameraRig, delivered: CameraRig, numbers: ImageNumbers,
        first: int = 0,
    ):  # fmt: skip
        files = match_files(points, rig.names)
        self.table, self._numbers, self._first = table, numbers, first
        self.notes = [f"camera '{name}': no points in {', '.join(sorted(points))}" for name in rig.names if name not in files]
        self._cameras: dict[str, CameraPeople] = {}
        for name, key in files.items():
            lens, to = rig[name].model, delivered[name].model
            self._cameras[name] = points[key].for_images(lens.width, lens.height, (to.width, to.height))
        self._given: Counter[str] = Counter()

    def of(self, camera: str, image: int) -> People | None:
        """The people in an image.

        Parameters
        ----------
        camera, image : name; number of the image in its source, from 0.

        Returns
        -------
        People with all points of the table, score 0 where the detector has none; None where the files do not mention the image.
        """
        people = self._cameras.get(camera)
        if people is None or image - self._first not in people:
            return None
        found = people[image - self._first]
        if len(found) > _MOST_USED:
            found = tuple(sorted(found, key=lambda person: -person.score)[:_MOST_USED])
        return tuple(_padded(person, self.table) for person in found)

    def with_people(self, tracker: object, image_set: ImageSet) -> ImageSet:
        """The image set with the people in its images.

        Parameters
        ----------
        tracker : does not matter.
        image_set : the next one to be tracked.

        Returns
        -------
        The same images, their ``people`` filled where the files tell of them.
        """
        return replace(image_set, images=tuple(map(self._with_people, image_set.images)))

    def _with_people(self, image: CameraImage) -> CameraImage:
        number = self._numbers.get(image.camera, {}).get(image.stamp_ns)
        people = None if number is None else self.of(image.camera, number)
        if people is None:
            return image
        self._given[image.camera] += 1
        return replace(image, people=people)

    def summary(self) -> dict[str, Any]:
        """For ``run.json``: the points, and of how many images the files have told."""
        given = {name: self._given[name] for name in self._cameras}
        return {"detector": self.detector, "points": sorted(self.table), "images": given}


def open_recorded_people(
    files: PointFiles, model: ArticulatedModel, rig: CameraRig, delivered: CameraRig, numbers: ImageNumbers
) -> RecordedPeople:
    """The people in files.

    Parameters
    ----------
    files, model : files with points; body that is tracked.
    rig, delivered, numbers : see `RecordedPeople`.

    Returns
    -------
    With the table of the file, or a built-in one.

    Raises
    ------
    FileFormatError, UnknownNameError : naming file and field; or a detector for which a table is needed.
    TrackerError : the body has none of the points' landmarks.
    """
    names = load_point_names(files.table) if files.table is not None else ()
    points = load_points(files.path, names)
    known = next((people.names for people in points.values() if people.names), ())
    if not known:
        raise TrackerError(f"{files.path}: nobody in any image")
    if files.table is None:
        table = table_of(known)
    else:
        table = load_keypoint_table(files.table, model)
        _check_spelling(files.table, table, known)
    usable = [name for name, point in table.items() if name in known and point.landmark in model.landmark_names]
    if not usable:
        told = f"the table has {', '.join(sorted(table)[:6])}, the files {', '.join(sorted(known)[:6])}"
        raise TrackerError(f"{files.path}: no point that {model.name} has a landmark for: {told}")
    return RecordedPeople(points, table, rig, delivered, numbers, files.first)


def _check_spelling(file: Path, table: KeypointTable, known: Sequence[str]) -> None:
    """Refuse a point that no file has, where it is nearly one that the table leaves out."""
    left_out = [name for name in known if name not in table]
    for name in (name for name in table if name not in known):
        if near := get_close_matches(name, left_out, n=1, cutoff=0.8):
            raise FileFormatError(file, f"points.{name}", f"a point of the files, such as '{near[0]}'", name)


def _padded(person: Person, table: KeypointTable) -> Person:
    """The person with the points that only the table has, or only the other side, as points that were not found."""
    wanted = dict.fromkeys([*person.names, *table])
    names = tuple(dict.fromkeys([*wanted, *map(mirrored_name, wanted)]))
    n, more = len(person.names), len(names) - len(person.names)
    if not more:
        return person
    center = 0.5 * np.array([person.box[0] + person.box[2], person.box[1] + person.box[3]])
    return replace(
        person,
        names=names,
        pixels=np.vstack([person.pixels, np.tile(center, (more, 1))]),
        covariances=np.concatenate([person.covariances, np.tile(np.eye(2), (more, 1, 1))]),
        scores=np.concatenate([person.scores[:n], np.zeros(more)]),
    )


ImageKey = tuple[str, int]
"""Camera, and stamp of an image in nanoseconds."""


class BagPoints:
    """The messages of a bag with people, the first of those of one image, as live; packed, since silhouettes are large and even.

    Parameters
    ----------
    reader : of the bag.
    needed : images whose people are asked for; None: all.
    """

    def __init__(self, reader: BagReader, needed: Container[ImageKey] | None = None):
        self._reader = reader
        self._messages: dict[ImageKey, BagMessage] = {}
        topics = reader.topics_of_type(KEYPOINTS)
        for message in reader.messages(topics) if topics else ():
            content = reader.decode(message)
            key = str(content.camera), stamp_ns_of(content.header.stamp)
            if key not in self._messages and (needed is None or key in needed):
                self._messages[key] = replace(message, data=lz4.frame.compress(message.data))

    def __contains__(self, key: ImageKey) -> bool:
        return key in self._messages

    def people(self, key: ImageKey) -> DetectedPeople:
        """Who was found in an image.

        Raises
        ------
        CalibrationError : the message contradicts itself.
        """
        message = self._messages[key]
        return detected_people(self._reader.decode(replace(message, data=lz4.frame.decompress(message.data))))
