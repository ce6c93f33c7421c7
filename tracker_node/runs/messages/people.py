"""People in messages: what a detector has found in one image, there and back, and as a tracker can use it.

Where a detector should look, in messages: squares in images, there and back. Detectors are other programs: a message may hold 500
people, names that the body lacks, or the silhouette of another image. Live and from a bag it is used by the same rules, for the
same states.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import CalibrationError
from ...loaders.bag.message_types import stamp_ns_of
from ...observation.image_set import CameraImage
from ...observation.keypoints.crop import Crop
from ...observation.keypoints.people import People, Person, Silhouette, checked
from .cameras import image as image_message
from .parts import Content, header

_UNKNOWN = -1  # number of a person
_SKELETON = ("skeleton_x", "skeleton_y", "skeleton_z")
_NO_SKELETON = np.zeros((3, 0))
_NO_PIXELS = np.zeros((0, 0), np.uint8)


def keypoints(image: CameraImage, frame_id: str, detector: str = "") -> Content:
    """tracker_msgs/Keypoints: the people of an image, with the stamp of the image that they were found in.

    Parameters
    ----------
    image : in which a detector has looked.
    frame_id : name of the camera's optical frame.
    detector : what has looked, for people.

    Returns
    -------
    content : the message as field -> value.
    """
    people = image.people or ()
    stamp_ns = image.stamp_ns if image.people_stamp_ns is None else image.people_stamp_ns
    return {
        "header": header(stamp_ns, frame_id),
        "camera": image.camera,
        "detector": detector,
        "names": people[0].names if people else (),
        "persons": [_person(person, stamp_ns, frame_id) for person in people],
    }


def people_of(message: Any) -> People:
    """The people in a tracker_msgs/Keypoints of a graph or of a bag.

    Impossible points are as if they had not been found (`observation.keypoints.people`).

    Parameters
    ----------
    message : the Keypoints.

    Returns
    -------
    people : in the order of the message.

    Raises
    ------
    CalibrationError : not one number for each point, a box that is none, or a silhouette that is no image; names the camera.
    """
    names = tuple(str(name) for name in message.names)
    try:
        return tuple(_person_of(names, person) for person in message.persons)
    except ValueError as problem:
        raise CalibrationError(str(message.camera), f"keypoints at {stamp_ns_of(message.header.stamp)} ns: {problem}") from None


def _person(person: Person, stamp_ns: int, frame_id: str) -> Content:
    content = {
        "number": _UNKNOWN,
        "score": person.score,
        "box": np.asarray(person.box, dtype=np.float64),
        "u": person.pixels[:, 0],
        "v": person.pixels[:, 1],
        "scores": person.scores,
        "covariance_uu": person.covariances[:, 0, 0],
        "covariance_uv": person.covariances[:, 0, 1],
        "covariance_vv": person.covariances[:, 1, 1],
        **dict(zip(_SKELETON, _NO_SKELETON if person.skeleton is None else person.skeleton.T, strict=True)),
        "silhouette_u": 0,
        "silhouette_v": 0,
        "silhouette": image_message(stamp_ns, frame_id, _NO_PIXELS, "mono8"),
    }
    if person.silhouette is not None:
        content["silhouette_u"], content["silhouette_v"] = person.silhouette.origin
        content["silhouette"] = image_message(stamp_ns, frame_id, person.silhouette.probabilities, "mono8")
    return content


def _person_of(names: tuple[str, ...], message: Any) -> Person:
    pixels = _columns(message, names, ("u", "v"))
    uu, uv, vv = _columns(message, names, ("covariance_uu", "covariance_uv", "covariance_vv")).T
    covariances = np.stack([uu, uv, uv, vv], axis=1).reshape(-1, 2, 2)
    scores = _columns(message, names, ("scores",))[:, 0]
    left, top, right, bottom = (float(number) for number in message.box)
    box = left, top, right, bottom
    skeleton = _columns(message, names, _SKELETON) if any(len(getattr(message, field)) for field in _SKELETON) else None
    return checked(Person(names, pixels, covariances, scores, float(message.score), box, _silhouette_of(message), skeleton))


def _columns(message: Any, names: Sequence[str], fields: Sequence[str]) -> np.ndarray:
    """(n, k) float64 of k fields with one number for each of n points."""
    columns = [np.array(getattr(message, field), dtype=np.float64) for field in fields]
    for field, column in zip(fields, columns, strict=True):
        if len(column) != len(names):
            raise ValueError(f"expected {len(names)} numbers in {field}, one for each name, got {len(column)}")
    return np.stack(columns, axis=1)


def _silhouette_of(message: Any) -> Silhouette | None:
    image = message.silhouette
    width, height, step = int(image.width), int(image.height), int(image.step)
    if not width or not height:
        return None
    data = np.frombuffer(image.data, np.uint8)
    if image.encoding != "mono8" or step < width or data.size < height * step:
        got = f"{image.encoding} {width}x{height}, {step} bytes a row, {data.size} in all"
        raise ValueError(f"silhouette: expected mono8 with all of its bytes, got {got}")
    pixels = data[: height * step].reshape(height, step)[:, :width].copy()
    return Silhouette(pixels, (int(message.silhouette_u), int(message.silhouette_v)))


def crops(stamp_ns: int, frame_id: str, cameras: Sequence[str], squares: Sequence[Crop | None]) -> Content:
    """tracker_msgs/Crops.

    Parameters
    ----------
    stamp_ns : of the image set.
    frame_id : name of the world frame.
    cameras : names.
    squares : one a camera; None: the whole image.

    Returns
    -------
    content : the message as field -> value.
    """
    whole = Crop((0.0, 0.0), 0.0)
    found = [whole if square is None else square for square in squares]
    return {
        "header": header(stamp_ns, frame_id),
        "cameras": list(cameras),
        "u": [square.center[0] for square in found],
        "v": [square.center[1] for square in found],
        "size": [square.size for square in found],
        "angle": [square.angle for square in found],
    }


def crops_in(message: Any) -> dict[str, Crop]:
    """The squares of a tracker_msgs/Crops by camera; those that are no square are left out."""
    rows = zip(message.cameras, message.u, message.v, message.size, message.angle, strict=False)
    return {
        str(camera): Crop((float(u), float(v)), float(size), float(angle))
        for camera, u, v, size, angle in rows
        if all(map(math.isfinite, (u, v, size, angle))) and size > 0.0
    }


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
