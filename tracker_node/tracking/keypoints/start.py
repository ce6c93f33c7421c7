"""A first state from the points of one image set: people who meet in space, then a fit to their points."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig, axes_equations
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.keypoints.correspondences import BodyPoints, KeypointCorrespondences
from ...optimize.fitter import Fit
from ..limbs.tree import Limb, limbs_of
from ..modality import PeopleSeen
from .fitting import KeypointFitting
from .people_groups import PersonGroup, grouped

_LEAST_PLACED = 4  # points by which a body is placed
_SUITS = 3.0  # times what the points of the best person cost...
_PERFECT = 0.05  # ...a point, in information units; of less, more says nothing
_MOST_GROUPS = 4  # people who are tried
_LEAST_SEEN = 0.5  # fraction of the cameras of the one whom most see: a passer-by hides the body from some
_LEAST_APART_M = 0.3  # roots of two people
_LEAST_INLIERS = 0.5  # fraction of the points that have to be no outliers
_TURNS = (0.0, np.pi)  # of the body about its vertical axis, tried after placing it


class PointStart:
    """Finds where a body begins.

    Parameters
    ----------
    rig, model : cameras and body.
    fitting : fits the body to the points of its modality.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, fitting: KeypointFitting):
        self._rig, self._model, self._fitting = rig, model, fitting
        self._focus, self._limbs = _focus(rig), limbs_of(model)[1:]
        self._least_mobile = np.argsort(_mobility(model, fitting.modality.offsets.body), kind="stable")

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        """The state of the person nearest to a place, of those whom the body suits.

        Parameters
        ----------
        people : whom a detector has found, by camera.
        near : (3,) meters, world; None: where the cameras look.

        Returns
        -------
        None where nobody is seen by two cameras, or nobody suits the body.
        """
        if sum(bool(persons) for persons in people) < 2:
            return None
        groups = grouped(self._rig, people)[:_MOST_GROUPS]
        tried = [self._either_way(group) for group in groups if group.count >= _LEAST_SEEN * groups[0].count]
        found: list[tuple[State, float]] = []
        for each in tried:  # who is found twice in an image is in two groups: more cameras see the first
            if each is not None and all(_apart_m(each[0], other) > _LEAST_APART_M for other, _ in found):
                found.append(each)
        if not found:
            return None
        least = max(min(cost for _, cost in found), _PERFECT)
        suits, place = [state for state, cost in found if cost <= _SUITS * least], self._focus if near is None else near
        return min(suits, key=lambda state: float(np.linalg.norm(state.T_world_root[:3, 3] - place)))

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
        self._fitting.modality.set_images((), placed, None, group.persons)
        best = min((self._fit(_turned(placed, turn)) for turn in _TURNS), key=_cost)
        for limb in self._limbs:  # one that is bent far is not reached from the neutral pose
            again = self._fit(self._bent(best.state, limb))
            best = min(best, again, key=_cost)
        points = best.correspondences
        assert isinstance(points, KeypointCorrespondences)
        weights = points.at(best.state).weights
        count = max(int((weights >= 0.0).sum()), 1)
        if np.maximum(weights, 0.0).sum() < _LEAST_INLIERS * count:
            return None
        return best.state, best.equations.cost / count

    def _fit(self, start: State) -> Fit:
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


def _cost(fit: Fit) -> float:
    return fit.equations.cost if np.isfinite(fit.equations.cost) else np.inf


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
