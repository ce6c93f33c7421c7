"""Whether a body has the size of the person who is tracked with it: distances between points that no joint changes.

Where a body is far too small or too large its limbs slip along those of the person, and what is said of them does not tell why.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ...camera.rig import CameraRig
from ...model.configuration import State
from ...objective.keypoints.correspondences import BodyPoints
from ..modality import Persons
from .modality import rows_of
from .people_groups import PersonGroup, met

_POSES, _RIGID = 24, 0.04  # that are tried; standard deviation of a distance, of its mean, that no joint changes
_SHORTEST = 0.08  # of the body's extent, of a distance that is compared
_EVERY, _LATER = 6, 30  # image sets from look to look, at first and after that
_KEPT, _LEAST = 20, 5  # looks that are kept; from which on something is said
_LEAST_PAIRS = 4  # of a look
_TOLERANCE = np.log(1.1)  # of true bodies of six clips the ratio is .965 to 1.026, of those scaled by .9 and 1.15 1.132 and .893
_OUT = np.log(1.25)  # ...and from which on it is not: ends of limbs are a decimeter off


class Proportions:
    """Compares distances between points of a person with those on the body, look by look.

    Parameters
    ----------
    rig : cameras.
    names, body : points on the body.

    Attributes
    ----------
    ratio : size of the person by that of the body; nan while too little was seen.
    """

    def __init__(self, rig: CameraRig, names: Sequence[str], body: BodyPoints):
        self._rig, self._names, self._body = rig, tuple(names), body
        self.reset()

    def reset(self) -> None:
        """Nobody has been seen."""
        self._calls, self._ratios = 0, deque[float](maxlen=_KEPT)
        self.ratio = np.nan

    def look(self, persons: Persons) -> None:
        """Take in who is the body in each camera; now and then."""
        if sum(person is not None for person in persons) > 1 and self._is_due():
            group = met(self._rig, persons)
            if group is not None:
                self._add(group)

    def take(self, group: PersonGroup) -> None:
        """Take in who may be the body; now and then."""
        if self._is_due():
            self._add(group)

    def _is_due(self) -> bool:
        self._calls += 1
        return self._calls % (_EVERY if len(self._ratios) < _LEAST else _LATER) == 1

    def _add(self, group: PersonGroup) -> None:
        pairs, distances_m = self._rigid_pairs
        if not len(pairs):
            return
        first = next(person for person in group.persons if person is not None)
        points = group.points[rows_of(first.names, self._names)]
        found_m = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
        known = np.isfinite(found_m)
        if known.sum() >= _LEAST_PAIRS:
            self._ratios.append(float(np.median(found_m[known] / distances_m[known])))
        if len(self._ratios) >= _LEAST:
            self.ratio = float(np.median(self._ratios))

    @cached_property
    def _rigid_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        return _rigid_pairs(self._body)

    @property
    def is_out(self) -> bool:
        """Whether the body cannot be the person's."""
        return bool(abs(np.log(self.ratio)) > _OUT)

    @property
    def doubt(self) -> str:
        """Why the body may not be the person's; empty where it may."""
        ratio = self.ratio
        if not abs(np.log(ratio)) > _TOLERANCE:  # nor of nan
            return ""
        apart = f"{100.0 * abs(ratio - 1.0):.0f} % {'farther from' if ratio > 1.0 else 'nearer to'} each other than the body's"
        return f"the person's points are {apart}: is it the person's body?"


def _rigid_pairs(body: BodyPoints) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2) rows of points whose distances no joint changes much, and (k,) meters these."""
    chain, rng = body.model.chain, np.random.default_rng(0)
    neutral = State.neutral(body.model)
    low, high = np.maximum(chain.lower, -2.0), np.minimum(chain.upper, 2.0)
    posed = (State(neutral.T_world_root, low + rng.random(chain.n_axes) * (high - low)) for _ in range(_POSES))
    places = np.array([body.places(state) for state in (neutral, *posed)])
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    mean, far = apart.mean(axis=0), apart.std(axis=0)
    extent = float(np.ptp(places[0], axis=0).max(initial=0.0))
    rows = np.argwhere(np.triu((far < _RIGID * mean) & (mean > _SHORTEST * extent), 1))
    return rows, mean[rows[:, 0], rows[:, 1]]
