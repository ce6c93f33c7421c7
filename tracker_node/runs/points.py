"""Points of a detector in messages, as a tracker can use them: live and from a bag by the same rules, for the same states.

Detectors are other programs: a message may hold five hundred people, names that no body has, or the silhouette of another image.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import CalibrationError
from ..loaders.bag.message_types import stamp_ns_of
from ..observation.image_set import CameraImage
from ..observation.keypoints.blazepose import NAMES
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
    people : with all points that a tracker knows; those that the detector lacks are not found.
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
    people : at most `MOST_PEOPLE`, with points of the names of `blazepose.NAMES`.

    Raises
    ------
    CalibrationError : naming the camera, a message that contradicts itself, or whose points have no name that is known.
    """
    stamp_ns, camera, notes = stamp_ns_of(message.header.stamp), str(message.camera), []
    persons = list(message.persons)
    if len(persons) > MOST_PEOPLE:
        notes.append(f"only the likeliest {MOST_PEOPLE} of {len(persons)} people are used")
        message = _Cut(message, sorted(persons, key=lambda person: -_score(person))[:MOST_PEOPLE])
    names = [str(name) for name in message.names]
    if persons and not set(names) & set(NAMES):
        raise CalibrationError(camera, f"keypoints at {stamp_ns} ns: no point has a name that is known, such as {NAMES[-1]}")
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        more = f" and {len(unknown) - _NAMED} more" if len(unknown) > _NAMED else ""
        notes.append(f"names that no body has are left out: {', '.join(name[:40] for name in unknown[:_NAMED])}{more}")
    return DetectedPeople(stamp_ns, tuple(map(_named, people_of(message))), tuple(notes))


class _Cut:
    """A message with fewer persons."""

    def __init__(self, message: Any, persons: list[Any]):
        self.header, self.camera, self.names, self.persons = message.header, message.camera, message.names, persons


def _score(person: Any) -> float:
    score = float(person.score)
    return score if math.isfinite(score) else -math.inf


def _named(person: Person) -> Person:
    """With the points of `blazepose.NAMES`, in their order; score 0 for those that the detector does not have."""
    if person.names == NAMES:
        return person
    n = len(NAMES)
    pixels, covariances, scores = np.zeros((n, 2)), np.tile(np.eye(2), (n, 1, 1)), np.zeros(n)
    for row, name in enumerate(person.names):
        if name in NAMES:
            k = NAMES.index(name)
            pixels[k], covariances[k], scores[k] = person.pixels[row], person.covariances[row], person.scores[row]
    return replace(person, names=NAMES, pixels=pixels, covariances=covariances, scores=scores)


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
