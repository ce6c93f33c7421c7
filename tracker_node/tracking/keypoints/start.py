"""A first state from the points of one image set: people who meet in space, then a fit to their points.

One camera alone, or one that alone sees a person, tells the place of a body by its size, and how it is turned by what the
detector guesses: both are known to some five percent.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...camera.rig import CameraRig, axes_equations
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.keypoints.correspondences import BodyPoints, KeypointCorrespondences
from ...observation.keypoints.people import Person
from ...optimize.fitter import Fit
from ..limbs.tree import Limb, limbs_of
from ..modality import PeopleSeen, Persons
from .fitting import KeypointFitting
from .people_groups import PersonGroup, grouped, groups_of_one, mirrored

_LEAST_PLACED = 4  # points by which a body is placed
_SUITS = 4.0  # times what the points of the best person cost...
_PERFECT = 0.05  # ...a point, in information units; of less, more says nothing
_DOUBTFUL = 3.5  # cost of a point, beyond which the next image sets may show the person better...
_PATIENCE_SETS = 5  # ...of so many of them
_SURE_ALONE = 0.9  # score of a person whom no other camera confirms, below which the next image sets may do so
_MOST_GROUPS = 4  # people who are tried
_LEAST_SEEN = 0.5  # fraction of the cameras of the one whom most see: a passer-by hides the body from some
_LEAST_APART_M = 0.3  # roots of two people, or of other bodies by their size
_LEAST_INLIERS = 0.5  # fraction of the points that have to be no outliers
_AGREE = 0.8  # mean probability of a camera's points to be no outliers, below which its left may be its right
_REACHED = 0.99  # the same of a limb's points, from which it is where they are
_TURNS = (0.0, np.pi)  # of the body about its vertical axis, tried after placing it


class PointStart:
    """Finds where a body begins.

    Parameters
    ----------
    rig, model : cameras and body.
    fitting : fits the body to the points of its modality.
    patience_sets : image sets in which points disagree, before a body is placed by them all the same.

    Attributes
    ----------
    group : whom most cameras have seen when several were looked at last, whether the body suits or not; None: nobody.
    """

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, fitting: KeypointFitting, patience_sets: int = _PATIENCE_SETS
    ):  # fmt: skip
        self._rig, self._model, self._fitting, self._patience_sets = rig, model, fitting, patience_sets
        self._focus, self._limbs = _focus(rig), limbs_of(model)[1:]
        moved = model.chain.link_moved_by[fitting.modality.offsets.body.links][:, N_ROOT_DOF:]
        self._points_of_limbs = [(moved & limb.dofs[N_ROOT_DOF:]).any(axis=1) for limb in self._limbs]
        self._least_mobile = np.argsort(_mobility(model, fitting.modality.offsets.body), kind="stable")
        self.reset()

    def reset(self) -> None:
        """Nothing has been looked for."""
        self._waited = 0
        self.group: PersonGroup | None = None

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        """The state of the person nearest to a place, of those whom the body suits.

        Parameters
        ----------
        people : whom a detector has found, by camera.
        near : (3,) meters, world; None: where the cameras look.

        Returns
        -------
        None where nobody is seen, or nobody suits the body; for some image sets where the points of who does disagree,
        or one camera alone sees anybody and is unsure, or one of several.
        """
        self.group, patient = None, self._waited < self._patience_sets
        if sum(map(bool, people)) != 1:
            candidates = self.candidates(people, near)
        else:
            wait = patient and len(people) > 1
            candidates = [] if wait else self._alone(people, near, _SURE_ALONE if patient else 0.0)
            self._waited += patient and not candidates
        if not candidates:
            return None
        state, cost = candidates[0]
        if cost > _DOUBTFUL and patient:
            self._waited += 1
            return None
        self._waited = 0
        return state

    def candidates(self, people: PeopleSeen, near: np.ndarray | None = None) -> list[tuple[State, float]]:
        """States of the people whom the body suits.

        Parameters
        ----------
        people, near : of `find`.

        Returns
        -------
        With what each of their points costs; those nearest to the place first.
        """
        if len(self._rig) == 1:
            return self._alone(people, near, _SURE_ALONE)
        groups = grouped(self._rig, people)[:_MOST_GROUPS]
        self.group = groups[0] if groups else None
        tried = [self._either_way(group) for group in groups if group.count >= _LEAST_SEEN * groups[0].count]
        return self._suitable(tried, near)

    def cost(self, state: State, persons: Persons) -> float:
        """What each point costs at best near a state.

        Parameters
        ----------
        state, persons : where the body may be; who is the body, by camera.

        Returns
        -------
        In information units, as of `candidates`.
        """
        return _cost_of_a_point(self._fit(state, persons))

    def _alone(self, people: PeopleSeen, near: np.ndarray | None, least: float) -> list[tuple[State, float]]:
        """The `candidates` by the only camera that sees anybody, if any does; people with a score of ``least``."""
        i, persons = next(((i, persons) for i, persons in enumerate(people) if persons), (0, ()))
        sure = [person for person in persons if person.score >= least]
        groups = groups_of_one(len(people), i, sure, self._fitting.modality.guesses.lifted)
        return self._suitable([self._fitted(group) for group in groups[:_MOST_GROUPS]], near)

    def _suitable(self, tried: Iterable[tuple[State, float] | None], near: np.ndarray | None) -> list[tuple[State, float]]:
        """Those that the body suits, each once; the nearest first."""
        found: list[tuple[State, float]] = []
        least_m = _LEAST_APART_M * self._fitting.modality.size
        for each in tried:  # who is found twice in an image is in two groups: more cameras see the first
            if each is not None and all(_apart_m(each[0], other) > least_m for other, _ in found):
                found.append(each)
        least = max(min((cost for _, cost in found), default=0.0), _PERFECT)
        suits, place = [each for each in found if each[1] <= _SUITS * least], self._focus if near is None else near
        return sorted(suits, key=lambda each: float(np.linalg.norm(each[0].T_world_root[:3, 3] - place)))

    def _either_way(self, group: PersonGroup) -> tuple[State, float] | None:
        """The better fit: points that meet do not say whether a detector has exchanged left and right in all of these cameras."""
        ways = [group] if 2 * group.n_exchanged < group.count else [group, group.exchanged()]
        found = [each for each in map(self._fitted, ways) if each is not None]
        return min(found, key=lambda each: each[1], default=None)

    def _fitted(self, group: PersonGroup) -> tuple[State, float] | None:
        """The body in the place of a group, and what each of its points costs; lengths that are not the body's cost."""
        placed = self._placed(group)
        if placed is None:
            return None
        best = min((self._fit(_turned(placed, turn), group.persons) for turn in _TURNS), key=_cost)
        for limb, points in zip(self._limbs, self._points_of_limbs, strict=True):
            if _share(_weights(best)[points]) < _REACHED:  # one that is bent far is not reached from the neutral pose
                best = min(best, self._fit(self._bent(best.state, limb), group.persons), key=_cost)
        best = self._with_sides(best, list(group.persons))
        return None if _share(_weights(best)) < _LEAST_INLIERS else (best.state, _cost_of_a_point(best))

    def _with_sides(self, best: Fit, persons: list[Person | None]) -> Fit:
        """The best with left and right exchanged in single cameras, of those that disagree with the others."""
        shares = {i: _share(column) for i, column in enumerate(_weights(best).T)}
        for i in sorted((i for i, share in shares.items() if share < _AGREE), key=shares.__getitem__):
            person = persons[i]
            assert person is not None
            others = [*persons[:i], mirrored(person), *persons[i + 1 :]]
            again = self._fit(best.state, others)
            if _cost(again) < _cost(best):
                best, persons = again, others
        return best

    def _fit(self, start: State, persons: Persons) -> Fit:
        self._fitting.modality.set_images((), start, None, persons)
        return self._fitting.fit(start, True, None)

    def _bent(self, state: State, limb: Limb) -> State:
        """With the joints of a limb in the middle of their ranges."""
        chain, joints = self._model.chain, limb.dofs[N_ROOT_DOF:]
        return State(state.T_world_root, np.where(joints, 0.5 * (chain.lower + chain.upper), state.joint_positions))

    def _placed(self, group: PersonGroup) -> State | None:
        """The neutral body where its points are best on those of the group (least squares of rotation and translation)."""
        modality, neutral = self._fitting.modality, State.neutral(self._model)
        names = next(person for person in group.persons if person is not None).names
        targets = group.points[[names.index(name) for name in modality.names]]
        body = modality.offsets.body
        known = np.isfinite(targets).all(axis=1)
        use = self._least_mobile[known[self._least_mobile]][:_LEAST_PLACED]
        if len(use) < _LEAST_PLACED:
            return None
        T = se3.rigid_fit(body.places(neutral)[use], targets[use])
        return State(T @ neutral.T_world_root, neutral.joint_positions)


def _weights(fit: Fit) -> np.ndarray:
    """(n_points, n_cameras) probability that a point is no outlier, -1 where there is none."""
    points = fit.correspondences
    assert isinstance(points, KeypointCorrespondences)
    return points.at(fit.state).weights


def _share(weights: np.ndarray) -> float:
    """Mean of those that there are; 1 without any."""
    known = weights[weights >= 0.0]
    return float(known.mean()) if len(known) else 1.0


def _cost(fit: Fit) -> float:
    return fit.equations.cost if np.isfinite(fit.equations.cost) else np.inf


def _cost_of_a_point(fit: Fit) -> float:
    return _cost(fit) / max(int((_weights(fit) >= 0.0).sum()), 1)


def _apart_m(one: State, other: State) -> float:
    return float(np.linalg.norm(one.T_world_root[:3, 3] - other.T_world_root[:3, 3]))


def _focus(rig: CameraRig) -> np.ndarray:
    """(3,) meters, world: the point nearest to all optical axes, where a rig is set up to look."""
    return np.linalg.lstsq(*axes_equations(rig), rcond=None)[0]


def _mobility(model: ArticulatedModel, body: BodyPoints) -> np.ndarray:
    """(n,) meters: how far each point moves as the joints go through their ranges, on the root."""
    chain, neutral = model.chain, State.neutral(model)
    moved = np.linalg.norm(Configuration(model, neutral).point_jacobian(body.places(neutral), body.links), axis=1)
    ranges = np.minimum(chain.upper - chain.lower, np.pi)
    return np.sqrt(((moved[:, N_ROOT_DOF:] * ranges) ** 2).sum(axis=1))


def _turned(state: State, angle: float) -> State:
    """About the root's z axis, ``angle`` radians."""
    tangent = np.zeros(N_ROOT_DOF + len(state.joint_positions))
    tangent[3:6] = angle * state.T_world_root[:3, 2]
    return state.retract(tangent)
