"""The same people in several cameras, without knowing where anybody is: by points that meet in space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

import numpy as np

from ...camera.rig import CameraRig
from ...model.humans.measures import mirrored_rows
from ...observation.keypoints.people import Person, rearranged
from ..modality import PeopleSeen

_MOST_PEOPLE = 6  # of an image: the surest and largest
_SURE = 0.5  # score of a point that has a say
_LEAST_POINTS = 6  # that two cameras have in common
_CLOSE = 0.06  # median distance of points from where they meet, as a fraction of the person's size in the image


@dataclass(frozen=True, eq=False)
class PersonGroup:
    """One person in several cameras.

    Attributes
    ----------
    persons : by camera; None where the person is not seen. Left and right are exchanged where that fits better.
    points : (n, 3) meters, world, in the order of the person's names; nan where fewer than two cameras are sure of one.
    misfit : median distance of points from their images, as a fraction of the person's size.
    size_px : of the person, in all cameras together.
    n_exchanged : cameras in which left and right are exchanged.
    """

    persons: tuple[Person | None, ...]
    points: np.ndarray
    misfit: float
    size_px: float
    n_exchanged: int = 0

    @property
    def count(self) -> int:
        """Cameras that see the person."""
        return sum(person is not None for person in self.persons)

    def exchanged(self) -> PersonGroup:
        """The same with left and right exchanged in all cameras, whose points meet as well."""
        names = next(person.names for person in self.persons if person is not None)
        persons = tuple(None if person is None else mirrored(person) for person in self.persons)
        points = self.points[list(_exchanged(names))]
        return replace(self, persons=persons, points=points, n_exchanged=self.count - self.n_exchanged)


def mirrored(person: Person) -> Person:
    """The person with the points of left and right exchanged."""
    return rearranged(person, _exchanged(person.names))


@lru_cache(maxsize=16)
def _exchanged(names: tuple[str, ...]) -> tuple[int, ...]:
    """Rows of the other sides."""
    return mirrored_rows(names)


def grouped(rig: CameraRig, people: PeopleSeen) -> list[PersonGroup]:
    """Groups of people, each person of an image in one of them at most.

    Pairs whose points meet are the beginnings; other cameras join where one of their people agrees.

    Parameters
    ----------
    rig : cameras.
    people : whom a detector has found, by camera.

    Returns
    -------
    Those seen by the most cameras first, then the largest ones.
    """
    seen = [sorted(persons or (), key=_rank)[:_MOST_PEOPLE] for persons in people]
    found: list[PersonGroup] = []
    while True:
        best = _best_group(rig, seen)
        if best is None:
            return sorted(found, key=lambda group: (-group.count, -group.size_px))
        as_found = [any(person is each for each in persons) for person, persons in zip(best.persons, seen, strict=True)]
        found.append(replace(best, n_exchanged=best.count - sum(as_found)))
        for i, person in enumerate(best.persons):
            if person is not None:
                seen[i] = [each for each in seen[i] if each.score != person.score or each.box != person.box]


def groups_of_one(
    n_cameras: int, i: int, persons: Sequence[Person], lifted: Callable[[int, Person], np.ndarray]
) -> list[PersonGroup]:
    """Groups of the people of a single camera.

    Parameters
    ----------
    n_cameras, i : of the rig, and which of them sees the people.
    persons : whom it sees.
    lifted : (n, 3) meters, world, where the points of a person in camera ``i`` are taken to be.

    Returns
    -------
    One a person, the surest and largest first.
    """
    found = []
    for person in sorted(persons, key=_rank)[:_MOST_PEOPLE]:
        by_camera = [person if k == i else None for k in range(n_cameras)]
        found.append(PersonGroup(tuple(by_camera), lifted(i, person), 0.0, _size(person)))
    return found


def _best_group(rig: CameraRig, seen: Sequence[Sequence[Person]]) -> PersonGroup | None:
    best: PersonGroup | None = None
    for i, j in combinations(range(len(seen)), 2):
        for one in seen[i]:
            for other in (each for person in seen[j] for each in (person, mirrored(person))):
                if one.names != other.names:
                    continue
                pair: list[Person | None] = [None] * len(seen)
                pair[i], pair[j] = one, other
                group = met(rig, pair)
                if group is not None and group.misfit < _CLOSE:
                    grown = _grown(rig, group, seen)
                    if best is None or (grown.count, -grown.misfit) > (best.count, -best.misfit):
                        best = grown
    return best


def _grown(rig: CameraRig, group: PersonGroup, seen: Sequence[Sequence[Person]]) -> PersonGroup:
    """With people of other cameras who agree, the best of each."""
    for i, persons in enumerate(seen):
        if group.persons[i] is not None:
            continue
        tried = []
        for each in (each for person in persons for each in (person, mirrored(person))):
            more = met(rig, [each if k == i else person for k, person in enumerate(group.persons)])
            if more is not None and more.misfit < _CLOSE:
                tried.append(more)
        group = min(tried, key=lambda each: each.misfit, default=group)
    return group


def met(rig: CameraRig, persons: Sequence[Person | None]) -> PersonGroup | None:
    """One person in several cameras, wherever that is.

    Parameters
    ----------
    rig : cameras.
    persons : who it is, by camera.

    Returns
    -------
    None where cameras have too few points in common.
    """
    first = next(person for person in persons if person is not None)
    n = len(first.names)
    A, b, count = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n)
    for camera, person in zip(rig, persons, strict=True):
        if person is None:
            continue
        rays, valid = camera.model.rays(np.ascontiguousarray(person.pixels))
        directions = rays @ camera.T_cam_world[:3, :3]
        across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
        has = valid & (person.scores >= _SURE) & np.isfinite(person.pixels).all(axis=1)
        weights, across = np.where(has, 1.0, 0.0) / _size(person) ** 2, np.where(has[:, None, None], across, 0.0)
        A += weights[:, None, None] * across
        b += weights[:, None] * (across @ camera.center)
        count += weights > 0.0
    sure = (count >= 2) & (np.linalg.eigvalsh(A)[:, 0] > 1e-4 * np.linalg.eigvalsh(A)[:, 2])
    if sure.sum() < _LEAST_POINTS:
        return None
    points = np.full((n, 3), np.nan)
    points[sure] = np.linalg.solve(A[sure], b[sure][:, :, None])[:, :, 0]
    misfits = []
    for camera, person in zip(rig, persons, strict=True):
        if person is not None:
            pixels, seen = camera.project(points[sure])
            distances = np.linalg.norm(pixels - person.pixels[sure], axis=1) / _size(person)
            own = (person.scores[sure] >= _SURE) & np.isfinite(distances)
            misfits.append(float(np.median(np.where(seen, distances, 1.0)[own])) if own.any() else 1.0)
    total = sum(_size(person) for person in persons if person is not None)
    return PersonGroup(tuple(persons), points, max(misfits), total)


def _rank(person: Person) -> float:
    """Less for people who are surer and larger."""
    return -person.score * _size(person)


def _size(person: Person) -> float:
    left, top, right, bottom = person.box
    return max(right - left, bottom - top, 1.0)
