"""People who come into the images while others are tracked, and leave: each is a body with a name of its own, given once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.humans.keypoints import BLAZEPOSE, KeypointTable
from ...observation.image_set import ImageSet
from ..config import KEYPOINTS, REGION, TrackerConfig
from ..estimate import Status, TrackEstimate, unknown_estimate
from ..keypoints.body_from_points import body_from_points
from ..keypoints.late import LatePoints
from ..keypoints.people_groups import PersonGroup, grouped
from ..modality import PeopleSeen
from ..tracker import Tracker

_APART_M = 0.5  # of the middle of somebody new from those who are tracked: nearer it is one of them, found twice
_STEP_M, _RUN_M_S = 0.5, 5.0  # of one person between two looks, and more by the second...
_LOOKS_NS = (100_000_000, 1_500_000_000)  # ...which lie so far apart: who is seen once may be a picture on a wall
_LEAST_POINTS = 16  # of a person that meet in space
_UNSEEN_NS = 500_000_000  # from one image set to the next, of which no more counts: while a search lasts nobody is looked for
_NO_SEARCH = 10**9  # image sets
USUAL = TrackerConfig(modalities=(REGION, KEYPOINTS))  # parameters of people who join, where none are given
NOBODY_YET = "nobody has come yet"


@dataclass(frozen=True, eq=False)
class JoiningOptions:
    """Who may join, and when somebody has left.

    Parameters
    ----------
    model : whoever comes is like it; the lengths are found from the points.
    config : parameters of their trackers; whoever is LOST is found again by points alone, not by a search of seconds.
    names : of the bodies of all who may join, in the order in which they come.
    gone_s : a body that is LOST for so long has left; who comes later is somebody else.

    Raises
    ------
    TrackerError : points of people are not compared.
    """

    model: ArticulatedModel
    config: TrackerConfig
    names: tuple[str, ...] = ("person_1", "person_2", "person_3", "person_4")
    gone_s: float = 2.0

    def __post_init__(self) -> None:
        if KEYPOINTS not in self.config.modalities:
            names = ", ".join(self.config.modalities)
            raise TrackerError(f"people who join are found by points: expected keypoints among the modalities, got {names}")
        patient = replace(self.config.initialization, after_lost_sets=_NO_SEARCH)
        object.__setattr__(self, "config", replace(self.config, initialization=patient))


class Joining:
    """Finds who is new, and knows who has come and gone.

    Somebody new is seen in two looks by two cameras, apart from all who are tracked. A name is used once.

    Parameters
    ----------
    rig : cameras.
    options : see `JoiningOptions`.
    make : makes the tracker of a body that begins at a state.
    table : what the detector's points are on the body.

    Attributes
    ----------
    rig : the same.
    trackers : of those who are here, by name.
    """

    def __init__(
        self, rig: CameraRig, options: JoiningOptions, make: Callable[[ArticulatedModel, State | None], Tracker],
        table: KeypointTable | None = None,
    ):  # fmt: skip
        self.rig, self._options, self._make, self._table = rig, options, make, table or BLAZEPOSE
        self._points = LatePoints(rig, options.model, self._table)
        self.reset()

    def reset(self) -> None:
        """Nobody has come."""
        self.trackers: dict[str, Tracker] = {}
        self._left: dict[str, tuple[ArticulatedModel, State]] = {}  # by name, and where they were last
        self._lost_ns: dict[str, tuple[int, int]] = {}  # by name, how long somebody has been LOST, until which stamp
        self._looks: list[tuple[int, np.ndarray]] = []  # stamps and places of people who may be new
        self._full = False  # somebody has come for whom no name was left

    def keep(self, other: Joining) -> None:
        """Have those who joined another, with new trackers that know nothing yet."""
        self.trackers = {name: self._make(tracker.model, None) for name, tracker in other.trackers.items()}
        self._left, self._lost_ns, self._looks = other._left, other._lost_ns, other._looks
        self._full = other._full

    @property
    def models(self) -> dict[str, ArticulatedModel]:
        """By the name of the body, of all who may join: those who have come have lengths of their own."""
        known = {name: tracker.model for name, tracker in self.trackers.items()} | {n: m for n, (m, _) in self._left.items()}
        return {name: known.get(name, self._options.model) for name in self._options.names}

    @property
    def _free(self) -> list[str]:
        return [name for name in self._options.names if name not in self.trackers and name not in self._left]

    def found(self, image_set: ImageSet) -> PeopleSeen:
        """Whom a detector has found, by camera."""
        return self._points.found(image_set)

    def admit(self, stamp_ns: int, late_ns: int, people: PeopleSeen, others: Sequence[np.ndarray]) -> bool:
        """Give a body to somebody new.

        Parameters
        ----------
        stamp_ns : of the images that people were found in.
        late_ns : by which the images that the body begins in are later; it goes on as between the looks until then.
        people : who are nobody's body yet, by camera.
        others : (3,) meters, world: where those are who are tracked.

        Returns
        -------
        Whether somebody has joined.
        """
        if self._full or sum(bool(persons) for persons in people) < 2:
            return False
        self._looks = [look for look in self._looks if stamp_ns - look[0] <= _LOOKS_NS[1]]
        places = _places(grouped(self.rig, people), others)
        known = [(place, before) for place in places if (before := self._before(stamp_ns, place)) is not None]
        self._looks += [(stamp_ns, place) for place in places]
        if not known:
            return False
        free = self._free
        if not free:
            self._full = True
            return False
        new, (before_ns, there) = known[0]
        try:
            fit = body_from_points(self._options.model, self.rig, [people], self._table, self._options.config, new)
        except TrackerError:  # no body is like that
            return False
        if _apart(fit.states[0].T_world_root[:3, 3], new) > _APART_M:
            return False
        T = fit.states[0].T_world_root.copy()
        T[:2, 3] += (new - there)[:2] * late_ns / (stamp_ns - before_ns)
        self.trackers[free[0]] = self._make(fit.model, replace(fit.states[0], T_world_root=T))
        self._looks = [look for look in self._looks if np.linalg.norm(look[1] - new) > _STEP_M]
        return True

    def _before(self, stamp_ns: int, place: np.ndarray) -> tuple[int, np.ndarray] | None:
        """The look before, not just now, in which the same person was seen."""
        looks = [(ns, there) for ns, there in self._looks if stamp_ns - ns >= _LOOKS_NS[0]]
        looks = [(ns, there) for ns, there in looks if _apart(place, there) <= _STEP_M + _RUN_M_S * 1e-9 * (stamp_ns - ns)]
        return min(looks, key=lambda look: _apart(place, look[1]), default=None)

    def dismiss(self, estimates: dict[str, TrackEstimate]) -> None:
        """Whoever has been LOST for long has left.

        Parameters
        ----------
        estimates : of an image set, by the name of the body.
        """
        for name, tracker in list(self.trackers.items()):
            estimate = estimates[name]
            if estimate.status is not Status.LOST:
                self._lost_ns.pop(name, None)
                continue
            lost_ns, last_ns = self._lost_ns.get(name, (0, estimate.stamp_ns))
            lost_ns += min(estimate.stamp_ns - last_ns, _UNSEEN_NS)
            self._lost_ns[name] = lost_ns, estimate.stamp_ns
            if lost_ns >= 1e9 * self._options.gone_s:
                del self.trackers[name], self._lost_ns[name]
                self._left[name] = tracker.model, estimate.state

    @property
    def turned_away(self) -> str:
        """What is to be said where somebody has come for whom no name was left; empty where nobody has."""
        names = len(self._options.names)
        return f"somebody has come for whom no name is left: joining.most is {names}" if self._full else ""

    def absent(self, stamp_ns: int) -> dict[str, TrackEstimate]:
        """What is to be said of those who have not come yet (INITIALIZING), and who have left (LOST where they were last).

        Parameters
        ----------
        stamp_ns : of an image set.
        """
        found, neutral = {}, State.neutral(self._options.model)
        for name in self._options.names:
            if name not in self.trackers:
                has_left = name in self._left
                status = Status.LOST if has_left else Status.INITIALIZING
                reason = f"has left: LOST for {self._options.gone_s:g} s" if has_left else NOBODY_YET
                state = self._left[name][1] if has_left else neutral
                found[name] = unknown_estimate(stamp_ns, reason, state, self.rig.names, 0.0, status)
        return found


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm((a - b)[:2]))


def _places(groups: Sequence[PersonGroup], others: Sequence[np.ndarray]) -> list[np.ndarray]:
    """(3,) meters, world: where people are whose points meet, each once, apart from the others; most cameras see the first."""
    found: list[np.ndarray] = []
    for group in groups:
        known = np.isfinite(group.points).all(axis=1)
        if known.sum() >= _LEAST_POINTS:
            place = np.median(group.points[known], axis=0)
            if all(_apart(place, other) > _APART_M for other in (*others, *found)):
                found.append(place)
    return found
