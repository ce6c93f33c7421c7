"""Points that a detector has found in earlier images, moved to where they are now by how the body has moved since.

A detector takes longer than the time from one image set to the next, so live its points come when their set has been tracked. The
body's motion in each image is summed from set to set. A set that had points itself counts as was predicted, without what its
points have corrected: points that are on their way were found in images of before, and would be corrected by the same again.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.humans.keypoints import KeypointTable
from ...model.humans.measures import mirrored_name
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.people import People, Person
from .modality import points_of

MOST_LATE_S = 1.0  # points that are older say nothing of the present
_KEPT = 256  # image sets
_WANDERS = 0.25  # error of the moved distance, as a fraction of it
_WANDERS_M_S = 0.1  # and of a body at rest, for each second
_HEIGHT_M = 1.7  # of a person, for meters in pixels


@dataclass(frozen=True, eq=False)
class _Place:
    """A body at one time; its points in the images are computed when asked for."""

    projector: _Projector
    state: State

    @cached_property
    def pixels(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_cameras, n_points, 2), and which are seen."""
        return self.projector.project(self.state)


@dataclass(frozen=True, eq=False)
class _Step:
    """How the body has moved from one image set to the next."""

    from_ns: int
    to_ns: int
    start: _Place
    end: _Place


class _Projector:
    """Points of a body in the images of a rig."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel, table: KeypointTable):
        self._rig = rig
        self.names, self._body = points_of(model, table)

    def project(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """(n_cameras, n_points, 2) pixels, and (n_cameras, n_points) whether they are seen."""
        points = self._body.places(state)
        pixels, seen = zip(*(camera.project(points) for camera in self._rig), strict=True)
        return np.array(pixels), np.array(seen)


class LatePoints:
    """Moves people that were found in earlier images.

    Parameters
    ----------
    rig, model : cameras and body.
    table : what the detector's points are on the body.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, table: KeypointTable):
        self._rig, self._projector = rig, _Projector(rig, model, table)
        own = self._projector.names
        self._needed = tuple(dict.fromkeys([*own, *map(mirrored_name, own)]))
        self.reset()

    def reset(self) -> None:
        """Nothing is known of how the body has moved."""
        self._steps: deque[_Step] = deque(maxlen=_KEPT)
        self._last: tuple[int, _Place] | None = None

    def add(self, stamp_ns: int, expected: State, state: State, corrected: bool) -> None:
        """An image set has been tracked.

        Parameters
        ----------
        stamp_ns : of the set.
        expected, state : where the body was expected, and where it was found.
        corrected : points of a detector had a part in that.
        """
        end = _Place(self._projector, state)
        if self._last is not None:
            from_ns, start = self._last
            moved_to = _Place(self._projector, expected) if corrected else end
            self._steps.append(_Step(from_ns, stamp_ns, start, moved_to))
        self._last = stamp_ns, end

    def brought(self, image_set: ImageSet, expected: State) -> list[People | None]:
        """The people in the images of a set, those found in earlier images moved.

        Parameters
        ----------
        image_set : the next one.
        expected : where the body is expected in it.

        Returns
        -------
        By camera of the rig; None where no detector has looked.
        """
        images = self._images(image_set)
        late = any(image is not None and image.people and image.people_stamp_ns is not None for image in images)
        steps = self._steps_to(image_set.stamp_ns, expected) if late else []
        return [None if image is None else self._people(i, image, image_set.stamp_ns, steps) for i, image in enumerate(images)]

    def found(self, image_set: ImageSet) -> list[People | None]:
        """The people in the images of a set where they were found, with all points of the body; None where none has looked."""
        return [None if image is None else image.people for image in self._images(image_set)]

    def _images(self, image_set: ImageSet) -> list[CameraImage | None]:
        return [self._completed(image_set.get(name)) for name in self._rig.names]

    def _completed(self, image: CameraImage | None) -> CameraImage | None:
        """With all points of the body, those that the detector lacks not found, and none that the other side lacks."""
        if image is None or not image.people or all(self._is_complete(person.names) for person in image.people):
            return image
        return replace(image, people=tuple(completed(person, self._needed) for person in image.people))

    def _is_complete(self, names: tuple[str, ...]) -> bool:
        given = set(names)
        return given.issuperset(self._needed) and given.issuperset(map(mirrored_name, names))

    def _steps_to(self, stamp_ns: int, expected: State) -> list[_Step]:
        if self._last is None:
            return []
        from_ns, start = self._last
        return [*self._steps, _Step(from_ns, stamp_ns, start, _Place(self._projector, expected))]

    def _people(self, i: int, image: CameraImage, stamp_ns: int, steps: list[_Step]) -> People | None:
        if not image.people or image.people_stamp_ns is None:
            return image.people
        late_ns = image.stamp_ns - image.people_stamp_ns
        shifts = np.zeros((len(self._projector.names), 2))
        for step in steps:
            span_ns, common_ns = step.to_ns - step.from_ns, step.to_ns - max(step.from_ns, stamp_ns - late_ns)
            if span_ns > 0 and common_ns > 0:
                (start, seen), (end, also) = step.start.pixels, step.end.pixels
                shifts += np.where((seen[i] & also[i])[:, None], end[i] - start[i], 0.0) * min(common_ns / span_ns, 1.0)
        return tuple(self._moved(person, shifts, 1e-9 * late_ns) for person in image.people)

    def _moved(self, person: Person, shifts: np.ndarray, late_s: float) -> Person:
        """The silhouette is left out: it is that of another time."""
        own, mean = dict(zip(self._projector.names, shifts, strict=True)), shifts.mean(axis=0)
        by_point = np.array([own.get(name, mean) for name in person.names]).reshape(-1, 2)
        left, top, right, bottom = person.box
        du, dv = mean.tolist()
        at_rest_px = _WANDERS_M_S * late_s * max(right - left, bottom - top) / _HEIGHT_M
        spread = (_WANDERS**2 * (by_point**2).sum(axis=1) + at_rest_px**2)[:, None, None] * np.eye(2)
        box = left + du, top + dv, right + du, bottom + dv
        return replace(person, pixels=person.pixels + by_point, covariances=person.covariances + spread, box=box, silhouette=None)


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
    given = {name: row for row, name in enumerate(person.names)}
    for k, row in ((k, given[name]) for k, name in enumerate(names) if name in given):
        pixels[k], covariances[k], scores[k] = person.pixels[row], person.covariances[row], person.scores[row]
    return replace(person, names=names, pixels=pixels, covariances=covariances, scores=scores)
