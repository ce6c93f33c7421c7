"""Image sets that have been tracked, kept for points that a detector finds in them later.

A detector takes longer than the time from one image set to the next, so live its points come when their set has been tracked.
They are used in that set: what was known before it is known again, and one of the sets since is fitted anew, a fixed-lag update.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.humans.keypoints import KeypointTable
from ...model.humans.measures import mirrored_name
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.people import People, Person
from ..modality import PeopleSeen
from ..motion.model import MotionModel
from .modality import points_of

MOST_LATE_S = 1.0  # points that are older say nothing of the present
_MOST_BYTES = 256_000_000  # of images that are kept


@dataclass(frozen=True, eq=False)
class PastSet:
    """An image set that has been tracked, who has been found in it, by camera, and what was known of the motion before it."""

    image_set: ImageSet
    people: PeopleSeen
    motion: MotionModel


class LatePoints:
    """Keeps image sets as long as points may come for them; none where those of every set come with it.

    Parameters
    ----------
    rig, model : cameras and body.
    table : what the detector's points are on the body.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, table: KeypointTable):
        self._rig, own = rig, points_of(model, table)[0]
        self._needed = tuple(dict.fromkeys([*own, *map(mirrored_name, own)]))
        self._complete: dict[tuple[str, ...], bool] = {}  # whether these names are all that are needed
        self._have_come = False  # points of image sets before, ever
        self.reset()

    def reset(self) -> None:
        """No image set is kept."""
        self._late = False
        self._since_ns: int | None = None
        self._kept: deque[PastSet] = deque()

    def add(self, past: PastSet) -> None:
        """Keep an image set that has been tracked, after those before it."""
        if self._since_ns is None:
            self._since_ns = past.image_set.stamp_ns
        self._late |= any(image.people is None or image.people_stamp_ns is not None for image in past.image_set.images)
        if not self._late:
            return
        self._kept.append(past)
        newest_ns, size = past.image_set.stamp_ns, sum(_size(each.image_set) for each in self._kept)
        while len(self._kept) > 1 and (size > _MOST_BYTES or newest_ns - self._kept[0].image_set.stamp_ns > 1e9 * MOST_LATE_S):
            size -= _size(self._kept.popleft().image_set)

    def may_come(self, stamp_ns: int) -> bool:
        """Whether a detector may yet find somebody in the image sets since the last reset: its points come later than they."""
        return self._have_come and (self._since_ns is None or stamp_ns - self._since_ns < 1e9 * MOST_LATE_S)

    def in_time(self, image_set: ImageSet) -> list[People | None]:
        """The people in the images themselves, by camera of the rig; None where no detector has looked, or not at these."""
        images = [image_set.get(name) for name in self._rig.names]
        return [None if image is None or image.people_stamp_ns is not None else self._people(image) for image in images]

    def found(self, image_set: ImageSet) -> list[People | None]:
        """The people who come with the images, whichever they were found in; otherwise as `in_time`."""
        images = [image_set.get(name) for name in self._rig.names]
        return [None if image is None else self._people(image) for image in images]

    def since(self, image_set: ImageSet) -> list[PastSet]:
        """Take out the image sets from that on in which the late points of ``image_set`` were found, which has them then.

        Returns
        -------
        The oldest first; empty where no points are late, or their set is not kept: it is the one whose stamp is nearest, by half
        the time between two sets.
        """
        late = {image.camera: image for image in image_set.images if image.people_stamp_ns is not None}
        self._have_come |= bool(late)
        if not late or not self._kept:
            return []
        delays = [image.stamp_ns - (image.people_stamp_ns or 0) for image in late.values()]
        stamps = np.array([each.image_set.stamp_ns for each in self._kept])
        off = np.abs(stamps - (image_set.stamp_ns - int(np.median(delays))))
        at = int(np.argmin(off))
        if off[at] > 0.5 * float(np.median(np.diff([*stamps, image_set.stamp_ns]))):
            return []
        kept = list(self._kept)
        self._kept = deque(kept[:at])
        people = [
            self._people(late[name]) if name in late else before
            for name, before in zip(self._rig.names, kept[at].people or [None] * len(self._rig), strict=True)
        ]
        return [replace(kept[at], people=people), *kept[at + 1 :]]

    def _people(self, image: CameraImage) -> People | None:
        """With all points of the body, those that the detector lacks not found, and none that the other side lacks."""
        if not image.people or all(self._is_complete(person.names) for person in image.people):
            return image.people
        return tuple(completed(person, self._needed) for person in image.people)

    def _is_complete(self, names: tuple[str, ...]) -> bool:
        if names not in self._complete:
            given = set(names)
            self._complete[names] = given.issuperset(self._needed) and given.issuperset(map(mirrored_name, names))
        return self._complete[names]


def _size(image_set: ImageSet) -> int:
    return sum(image.pixels.nbytes for image in image_set.images)


def completed(person: Person, names: tuple[str, ...]) -> Person:
    """A person with the points of these names alone.

    Parameters
    ----------
    person, names : of any detector; names that the body needs.

    Returns
    -------
    In the order of ``names``; points that the detector lacks have score 0.
    """
    n = len(names)
    pixels, covariances, scores = np.zeros((n, 2)), np.tile(np.eye(2), (n, 1, 1)), np.zeros(n)
    skeleton = None if person.skeleton is None else np.full((n, 3), np.nan)
    given = {name: row for row, name in enumerate(person.names)}
    for k, row in ((k, given[name]) for k, name in enumerate(names) if name in given):
        pixels[k], covariances[k], scores[k] = person.pixels[row], person.covariances[row], person.scores[row]
        if skeleton is not None and person.skeleton is not None:
            skeleton[k] = person.skeleton[row]
    return replace(person, names=names, pixels=pixels, covariances=covariances, scores=scores, skeleton=skeleton)
