"""Several bodies in the same images: each has a tracker of its own, which knows where the others are expected.

Before the trackers take an image set, everybody is where the sets before say. A body is compared with images in which the others
stand about: what is behind one of them says nothing of it, what shows one of them is no background. Whom a detector has found
is at most one body in each camera; of people who hold each other only outlines tell.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
import scipy  # imports its modules when they are first used

from ...model.articulated import ArticulatedModel
from ...model.configuration import Neighbor, State, configured
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.crop import Crop
from ...parallel import Workers
from ..config import KEYPOINTS
from ..estimate import Status, TrackEstimate
from ..keypoints.late import MOST_LATE_S
from ..modality import PeopleSeen
from ..tracker import Tracker
from .joining import Joining

_IN_TOUCH_M = 0.4  # between landmarks of two people; nearer, a detector mixes up whose arms are whose
_APART_M = 0.3  # roots of two bodies that begin at once
_NOWHERE = 100.0  # what it costs that a body begins nowhere, meters or information a point
_NEVER = 1e6
_REACH_M, _REACH_M_S = 1.0, 3.0  # as far as somebody who was not seen for a moment may have come, and more by the second
_BY_TROUBLE = (Status.TRACKING, Status.DEGRADED, Status.INITIALIZING, Status.LOST)


@dataclass(frozen=True, eq=False)
class _Shares:
    """Whose body people are (``owners``, by camera): where bodies were ``expected``, and with those who have ``begun`` there."""

    expected: Mapping[str, State | None]
    owners: Sequence[dict[int, str]]
    begun: Mapping[str, State | None]


class Bodies:
    """Follows several bodies as a `Tracker` follows one.

    Parameters
    ----------
    trackers : by the name of the body, all of one rig.
    at_once : bodies that are worked on at once, each on a thread and those of its tracker (`shared_threads`).
    joining : people who come and go, beside these; None: nobody does.

    Attributes
    ----------
    trackers : the same, and those of who has joined and not left.
    estimates : of the latest image set, by the name of the body.
    absent : the same of those who may join, or have left.
    """

    def __init__(self, trackers: Mapping[str, Tracker], at_once: int = 1, joining: Joining | None = None):
        self._named, self._joining = dict(trackers), joining
        self.estimates, self.absent = dict[str, TrackEstimate](), dict[str, TrackEstimate]()
        self._past = deque[tuple[int, dict[str, State]]]()  # stamp and states of the image sets that late points may be of
        self._last = dict[str, tuple[int, np.ndarray]]()  # stamp and place where a body was last known to be
        self._now_ns = 0
        self._workers = Workers(at_once)

    def estimate(self, image_set: ImageSet) -> TrackEstimate:
        """Estimate all states for one image set; returned is that of whoever is worst off, all are in ``estimates``."""
        self.learn()  # what others look like is as of the set before, whenever somebody has asked for that
        self._now_ns = image_set.stamp_ns
        shares = None if self._joining is None else self._admit(self._joining, image_set)
        sets, names = self._image_sets(image_set, shares), list(self.trackers)
        estimates = self._workers.map(lambda name: self.trackers[name].estimate(sets[name]), names)
        self.estimates = dict(zip(names, estimates, strict=True))
        self._remember(image_set.stamp_ns)
        if self._joining is not None:
            self._joining.dismiss(self.estimates)
            self.absent = self._joining.absent(image_set.stamp_ns)
        said = max if self.estimates else min  # to have left is no trouble
        return said((self.estimates or self.absent).values(), key=lambda estimate: _BY_TROUBLE.index(estimate.status))

    @property
    def trackers(self) -> dict[str, Tracker]:
        """By the name of the body, also of who has joined and not left."""
        return self._named if self._joining is None else {**self._named, **self._joining.trackers}

    @property
    def models(self) -> dict[str, ArticulatedModel]:
        """By the name of the body, also of all who may join."""
        named = {name: tracker.model for name, tracker in self._named.items()}
        return named if self._joining is None else named | self._joining.models

    @property
    def turned_away(self) -> str:
        """See `Joining.turned_away`."""
        return "" if self._joining is None else self._joining.turned_away

    def keep_joined(self, other: Bodies) -> None:
        """Those who have joined others are here too.

        Parameters
        ----------
        other : has tracked until now, who has joined is taken over from there.
        """
        if self._joining is not None and other._joining is not None:
            self._joining.keep(other._joining)

    def _admit(self, joining: Joining, image_set: ImageSet) -> _Shares | None:
        """Give a body to somebody new in the images, as the detector has seen them; whose the people are, where that holds on."""
        people = joining.found(image_set)
        if not any(people):
            return None
        late_ns = _people_stamp_ns(image_set)
        stamp_ns = image_set.stamp_ns if late_ns is None else late_ns
        shares = self._shares(image_set)
        others = [state.T_world_root[:3, 3] for state in _known(shares.begun).values()]
        joined = joining.admit(stamp_ns, image_set.stamp_ns - stamp_ns, _without(people, shares.owners, ""), others)
        return None if joined else shares

    def learn(self) -> None:
        """See `Tracker.learn`."""
        self._workers.map(Tracker.learn, list(self.trackers.values()))

    def reset(self) -> None:
        """See `Tracker.reset`."""
        self._past.clear()
        self._last.clear()
        self.estimates, self.absent = {}, {}
        if self._joining is not None:
            self._joining.reset()
        for tracker in self.trackers.values():
            tracker.reset()

    def set_state(self, state: State) -> None:
        """See `Tracker.set_state`; of a body that is alone."""
        (tracker,) = self.trackers.values()
        tracker.set_state(state)

    def reinitialize(self, near: np.ndarray | None = None) -> None:
        """See `Tracker.reinitialize`; all of them."""
        for tracker in self.trackers.values():
            tracker.reinitialize(near)

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]:
        """Where a detector of people should look for those of the bodies that go by points.

        Parameters
        ----------
        stamp_ns : of the images.

        Returns
        -------
        By camera; none, for the whole image, while one of the bodies is not known.
        """
        trackers = [tracker for tracker in self.trackers.values() if KEYPOINTS in tracker.config.modalities]
        if not trackers or any(tracker.expected(stamp_ns) is None for tracker in trackers):
            return [()] * len(next(iter(self.trackers.values())).rig if self._joining is None else self._joining.rig)
        crops = [tracker.expected_crops(stamp_ns) for tracker in trackers]
        return [tuple(crop for each in of_camera for crop in each) for of_camera in zip(*crops, strict=True)]

    def image_sets(self, image_set: ImageSet) -> dict[str, ImageSet]:
        """The image set as each tracker is to take it: with the others as neighbors, and without the people who are others."""
        return self._image_sets(image_set, None)

    def _image_sets(self, image_set: ImageSet, shares: _Shares | None) -> dict[str, ImageSet]:
        if len(self.trackers) < 2 and (self._joining is None or not self.trackers):
            return dict.fromkeys(self.trackers, image_set)
        neighbors = {name: tracker.as_neighbor(image_set.stamp_ns) for name, tracker in self.trackers.items()}
        people = self._people_of_each(image_set, shares or self._shares(image_set))
        return {
            name: replace(image_set, images=people[name], own=neighbors[name], neighbors=_others(neighbors, name))
            for name in self.trackers
        }

    def _shares(self, image_set: ImageSet) -> _Shares:
        """Whose body each of the people in the images is."""
        seen = self._seen_by_each(image_set)
        expected = self._expected_of_people(image_set, seen)
        begun = dict(expected)
        return _Shares(expected, self._owners_begun(seen, begun), begun)

    def _people_of_each(self, image_set: ImageSet, shares: _Shares) -> dict[str, tuple[CameraImage, ...]]:
        """By body, the images without those people who are other bodies."""
        in_touch, owners = self._in_touch(_known(shares.expected)), shares.owners
        unknown = {name for name, state in shares.expected.items() if state is None}
        cameras = next(iter(self.trackers.values())).rig.names
        return {
            name: tuple(_left(image, cameras, owners, name, name in in_touch, name in unknown) for image in image_set.images)
            for name in self.trackers
        }

    def _seen_by_each(self, image_set: ImageSet) -> dict[str, PeopleSeen]:
        """Whom a detector has found, by the bodies that take points."""
        seen = {name: tracker.people_of(image_set) for name, tracker in self.trackers.items()}
        return {name: people for name, people in seen.items() if people}

    def _expected_of_people(self, image_set: ImageSet, seen: Mapping[str, PeopleSeen]) -> dict[str, State | None]:
        """Where bodies were expected in the images that people were found in; None of who is not known."""
        past = self._states_at(_people_stamp_ns(image_set))
        trackers = {name: tracker for name, tracker in self.trackers.items() if name in seen}
        return {name: past.get(name, tracker.expected(image_set.stamp_ns)) for name, tracker in trackers.items()}

    def _owners_begun(self, seen: Mapping[str, PeopleSeen], expected: dict[str, State | None]) -> list[dict[int, str]]:
        """By camera, whose body some of the people are, also of bodies that begin among them, whose states are filled in."""
        owners = self._owners(seen, _known(expected))
        unknown = [name for name, state in expected.items() if state is None]
        if not unknown:
            return owners
        free = {name: _without(seen[name], owners, "") for name in unknown}
        taken = list(_known(expected).values())  # one person may be found twice in an image
        candidates = {name: self.trackers[name].candidates(free[name]) for name in unknown}
        expected |= _begun({
            name: [(state, cost) for state, cost in found if _are_apart(state, taken) and self._in_reach(name, state)]
            for name, found in candidates.items()
        })  # fmt: skip
        return self._owners(seen, _known(expected))

    def _in_reach(self, name: str, state: State) -> bool:
        """Whether a body that has been LOST for a while can be there by now; else somebody else is, if people may join."""
        if self._joining is None or name not in self._last:
            return True
        last_ns, place = self._last[name]
        far = np.linalg.norm(state.T_world_root[:3, 3] - place)
        return bool(far <= _REACH_M + _REACH_M_S * 1e-9 * max(self._now_ns - last_ns, 0))

    def _remember(self, stamp_ns: int) -> None:
        known = {name: each.state for name, each in self.estimates.items() if each.status.known}
        self._past.append((stamp_ns, known))
        self._last |= {name: (stamp_ns, state.T_world_root[:3, 3]) for name, state in known.items()}
        while stamp_ns - self._past[0][0] > 1e9 * MOST_LATE_S:
            self._past.popleft()

    def _states_at(self, stamp_ns: int | None) -> Mapping[str, State]:
        """Of those who were known in an image set that has been tracked; nobody's where it is too long ago."""
        if stamp_ns is None or not self._past or stamp_ns < self._past[0][0]:
            return {}
        return min(self._past, key=lambda past: abs(past[0] - stamp_ns))[1]

    def _in_touch(self, expected: Mapping[str, State]) -> set[str]:
        """People who are so near to each other that points say little of them, and whom outlines hold."""
        places = {name: configured(self.trackers[name].model, state).landmarks_world for name, state in expected.items()}
        found = set()
        for one, other in combinations(places, 2):
            apart = np.linalg.norm(places[one][:, None] - places[other], axis=2)
            if apart.size and apart.min() < _IN_TOUCH_M:
                found |= {one, other}
        return {name for name in found if self.trackers[name].config.contours}

    def _owners(self, seen: Mapping[str, PeopleSeen], expected: Mapping[str, State]) -> list[dict[int, str]]:
        """By camera, whose body some of the people are: those together suit best."""
        names = list(expected)
        claims = [self.trackers[name].claims(seen[name], expected[name]) for name in names]
        if not any(claims):
            return []
        owners: list[dict[int, str]] = []
        for of_camera in zip(*claims, strict=True):
            suits = np.where(np.isfinite(table := np.array(of_camera)), table, -_NEVER)
            rows, columns = scipy.optimize.linear_sum_assignment(suits, maximize=True)
            pairs = zip(rows.tolist(), columns.tolist(), strict=True)
            owners.append({column: names[row] for row, column in pairs if suits[row, column] > -_NEVER})
        return owners


def shared_threads(threads: int, bodies: int) -> tuple[int, int]:
    """How threads are shared out: to have a body for each is faster than to have all of them at one after the other.

    Parameters
    ----------
    threads, bodies : how many there are.

    Returns
    -------
    Bodies at once, and threads of each tracker.
    """
    at_once = max(1, min(threads, bodies))
    return at_once, max(1, threads // at_once)


def _known(expected: Mapping[str, State | None]) -> dict[str, State]:
    return {name: state for name, state in expected.items() if state is not None}


def _others(neighbors: Mapping[str, Neighbor | None], name: str) -> tuple[Neighbor, ...]:
    return tuple(neighbor for other, neighbor in neighbors.items() if other != name and neighbor is not None)


def _left(
    image: CameraImage, cameras: Sequence[str], owners: Sequence[dict[int, str]], name: str, in_touch: bool, own_only: bool
) -> CameraImage:
    """The image without the people who are other bodies, or (``own_only``) who are nobody's, or without any."""
    if not image.people or not (owners or own_only):
        return image
    if in_touch:
        return replace(image, people=() if image.people_stamp_ns is None else None, people_stamp_ns=None)
    owned, nobodys = owners[cameras.index(image.camera)] if owners else {}, "" if own_only else name
    return replace(image, people=tuple(person for k, person in enumerate(image.people) if owned.get(k, nobodys) == name))


def _people_stamp_ns(image_set: ImageSet) -> int | None:
    """Of the image set that late points are of, by its own clock; None where none are late."""
    delays = [image.stamp_ns - image.people_stamp_ns for image in image_set.images if image.people_stamp_ns is not None]
    return image_set.stamp_ns - int(np.median(delays)) if delays else None


def _without(seen: PeopleSeen, owners: Sequence[dict[int, str]], name: str) -> PeopleSeen:
    """The people of all cameras who are nobody else's than a body's."""
    if not owners:
        return seen
    return [
        None if people is None else tuple(person for k, person in enumerate(people) if owned.get(k, name) == name)
        for people, owned in zip(seen, owners, strict=True)
    ]


def _begun(candidates: Mapping[str, Sequence[tuple[State, float]]]) -> dict[str, State | None]:
    """Where each of several bodies begins, such that no two begin in one place and all together suit best."""
    choices = [[*found, (None, _NOWHERE)] for found in candidates.values()]
    apart = [chosen for chosen in product(*choices) if _all_apart([state for state, _ in chosen if state is not None])]
    best = min(apart, key=lambda chosen: sum(cost for _, cost in chosen))
    return {name: state for name, (state, _) in zip(candidates, best, strict=True)}


def _all_apart(states: Sequence[State]) -> bool:
    return all(_are_apart(state, states[:i]) for i, state in enumerate(states))


def _are_apart(state: State, others: Sequence[State]) -> bool:
    place = state.T_world_root[:3, 3]
    return all(np.linalg.norm(place - other.T_world_root[:3, 3]) > _APART_M for other in others)
