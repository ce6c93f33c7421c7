"""Points of a detector in messages, as a tracker can use them: live and from a bag by the same rules, for the same states.

Detectors are other programs: a message may hold 500 people, names that the body lacks, or the silhouette of another image.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

from ..errors import CalibrationError
from ..loaders.bag.message_types import stamp_ns_of
from ..observation.image_set import CameraImage
from ..observation.keypoints.people import People, Person
from .messages import people_of

MOST_PEOPLE = 16  # in one image; of more, the likeliest
_NAMED = 4  # unknown names in a message for people


@dataclass(frozen=True, eq=False)
class DetectedPeople:
    """The people in one image, from a message.

    Attributes
    ----------
    stamp_ns : of the image.
    people : the likeliest.
    notes : what was left out, one sentence each.
    """

    stamp_ns: int
    people: People
    notes: tuple[str, ...] = ()


def detected_people(message: Any) -> DetectedPeople:
    """What a tracker uses of a tracker_msgs/Keypoints, of a graph or of a bag.

    Parameters
    ----------
    message : the Keypoints; its persons are not changed.

    Returns
    -------
    people : at most `MOST_PEOPLE`.

    Raises
    ------
    CalibrationError : naming the camera, a message that contradicts itself.
    """
    notes: tuple[str, ...] = ()
    persons = list(message.persons)
    if len(persons) > MOST_PEOPLE:
        notes = (f"only the likeliest {MOST_PEOPLE} of {len(persons)} people are used",)
        message = _Cut(message, sorted(persons, key=lambda person: -_score(person))[:MOST_PEOPLE])
    return DetectedPeople(stamp_ns_of(message.header.stamp), people_of(message), notes)


def with_known_names(detected: DetectedPeople, known: Collection[str], camera: str) -> DetectedPeople:
    """The same people, with a note of the names that are not known; the tracker leaves these points out.

    Parameters
    ----------
    detected : of a message.
    known : names of points that the body has.
    camera : name, for messages.

    Returns
    -------
    people : as they are.

    Raises
    ------
    CalibrationError : no name is known.
    """
    names = detected.people[0].names if detected.people else ()
    unknown = [name for name in names if name not in known]
    if names and len(unknown) == len(names):
        some = ", ".join(sorted(known)[:_NAMED])
        raise CalibrationError(camera, f"keypoints at {detected.stamp_ns} ns: no point has a name that is known, such as {some}")
    if not unknown:
        return detected
    more = f" and {len(unknown) - _NAMED} more" if len(unknown) > _NAMED else ""
    note = f"names that the body lacks are left out: {', '.join(name[:40] for name in unknown[:_NAMED])}{more}"
    return replace(detected, notes=(*detected.notes, note))


class _Cut:
    """A message with fewer persons."""

    def __init__(self, message: Any, persons: list[Any]):
        self.header, self.camera, self.names, self.persons = message.header, message.camera, message.names, persons


def _score(person: Any) -> float:
    score = float(person.score)
    return score if math.isfinite(score) else -math.inf


def with_people(image: CameraImage, detected: DetectedPeople) -> CameraImage:
    """An image with the people of a message.

    Parameters
    ----------
    image : the one that they were found in, or a later one of the camera.
    detected : people, with the stamp of their image.

    Returns
    -------
    image : with the people; silhouettes that reach beyond it are left out.
    """
    people = tuple(_within(person, image.pixels.shape[:2]) for person in detected.people)
    return replace(image, people=people, people_stamp_ns=None if detected.stamp_ns == image.stamp_ns else detected.stamp_ns)


def _within(person: Person, size: Collection[int]) -> Person:
    if person.silhouette is None:
        return person
    (u, v), (height, width), (rows, columns) = person.silhouette.origin, person.silhouette.probabilities.shape, size
    fits = u >= 0 and v >= 0 and u + width <= columns and v + height <= rows
    return person if fits else replace(person, silhouette=None)
