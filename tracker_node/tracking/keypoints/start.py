"""A first state from the points of one image set: people who meet in space, then a fit to their points."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.keypoints.correspondences import BodyPoints, KeypointCorrespondences
from ..modality import PeopleSeen
from .fitting import KeypointFitting
from .people_groups import PersonGroup, grouped

_LEAST_PLACED = 4  # points by which a body is placed
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
        self._steady = np.argsort(_mobility(model, fitting.modality.offsets.body), kind="stable")

    def find(self, people: PeopleSeen) -> State | None:
        """The state of the person who is seen by the most cameras, of several the largest.

        Parameters
        ----------
        people : whom a detector has found, by camera.

        Returns
        -------
        None where nobody is seen by two cameras, or nobody suits the body.
        """
        if sum(bool(persons) for persons in people) < 2:
            return None
        for group in grouped(self._rig, people):
            found = self._fitted(group)
            if found is not None:
                return found
        return None

    def _fitted(self, group: PersonGroup) -> State | None:
        placed = self._placed(group)
        if placed is None:
            return None
        modality = self._fitting.modality
        best: State | None = None
        least = np.inf
        for turn in _TURNS:
            start = _turned(placed, turn)
            modality.set_images((), start, None, group.persons)
            fit = self._fitting.fit(start, True, None)
            points = fit.correspondences
            assert isinstance(points, KeypointCorrespondences)
            weights = points.at(fit.state).weights
            inliers = float(np.maximum(weights, 0.0).sum() / max(int((weights >= 0.0).sum()), 1))
            if inliers >= _LEAST_INLIERS and fit.equations.cost < least:
                best, least = fit.state, fit.equations.cost
        return best

    def _placed(self, group: PersonGroup) -> State | None:
        """The neutral body where its points are best on those of the group (least squares of rotation and translation)."""
        modality, neutral = self._fitting.modality, State.neutral(self._model)
        names = next(person for person in group.persons if person is not None).names
        targets = group.points[[names.index(name) for name in modality.names]]
        body = modality.offsets.body
        known = np.isfinite(targets).all(axis=1)
        use = self._steady[known[self._steady]][:_LEAST_PLACED]
        if len(use) < _LEAST_PLACED:
            return None
        own = _places(body, Configuration(self._model, neutral))[use]
        there = targets[use]
        middle, aim = own.mean(axis=0), there.mean(axis=0)
        U, _, V = np.linalg.svd((there - aim).T @ (own - middle))
        R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ V))]) @ V
        T = se3.from_rotation_translation(R, aim - R @ middle)
        return State(T @ neutral.T_world_root, neutral.joint_positions)


def _mobility(model: ArticulatedModel, body: BodyPoints) -> np.ndarray:
    """(n,) meters: how far each point moves as the joints go through their ranges, on the root."""
    chain, configuration = model.chain, Configuration(model, State.neutral(model))
    places = _places(body, configuration)
    v, w = configuration.twists[:, :3], configuration.twists[:, 3:]
    moved = np.linalg.norm(v[None] + np.cross(w[None], places[:, None]), axis=2) * chain.link_moved_by[body.links]
    ranges = np.minimum(chain.upper - chain.lower, np.pi)
    return np.sqrt(((moved[:, N_ROOT_DOF:] * ranges) ** 2).sum(axis=1))


def _places(body: BodyPoints, configuration: Configuration) -> np.ndarray:
    """(n, 3) meters, world."""
    T = configuration.Ts_world_link[body.links]
    return np.einsum("nij,nj->ni", T[:, :3, :3], body.positions + body.means) + T[:, :3, 3]


def _turned(state: State, angle: float) -> State:
    """About the root's z axis, ``angle`` radians."""
    tangent = np.zeros(N_ROOT_DOF + len(state.joint_positions))
    tangent[3:6] = angle * state.T_world_root[:3, 2]
    return state.retract(tangent)
