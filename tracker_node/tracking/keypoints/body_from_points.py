"""A person's body from a detector's points in a few image sets: lengths, poses and the points' offsets, found together.

A network's hip is not the joint's center, and where it is instead differs from person to person. So every point has an unknown
offset, the same in all image sets, whose average and spread over people are known; so have the lengths of segments. What a few
images of somebody who stands cannot tell is left to what people differ by.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.humans.keypoints import BLAZEPOSE, KeypointTable, LandmarkPoint, expected_offsets
from ...model.shape_parameters import ShapeSpace, expected_lengths
from ...objective.keypoints.kernels import OUTLIER, S_UU, S_UV, S_VV, U, V
from ...objective.shape_jacobian import landmarks_D_shape
from ...optimize.descent import descend
from ...optimize.levenberg_marquardt import clip_to_limits
from ..config import TrackerConfig
from ..constraints import resting
from ..modality import PeopleSeen
from .choice import PersonChoice
from .fitting import KeypointFitting
from .modality import KeypointModality, points_of
from .start import PointStart

_LENGTHS = ("size", "length", "breadth")
_ITERATIONS, _TOLERANCE = 30, 1e-4
_STEP = 1e-3  # of derivatives by differences
NEAR_M = 2.0  # of a place that is asked for, beyond which it is somebody else who is nearest
_NOTHING = 1e-9  # information of what no image tells and nothing expects, so that equations can be solved


@dataclass(frozen=True)
class BodyLength:
    """A shape parameter of the body: its name, logarithm of the factor that it was given, and standard deviation of that."""

    name: str
    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class BodyFromPoints:
    """A body and how it came about.

    Attributes
    ----------
    model : the body.
    states : of the person in the image sets that were used.
    rows : numbers of these image sets, among those given.
    lengths : what was changed of the body given.
    residual_px : median distance of points that are no outliers from where the body has them.
    """

    model: ArticulatedModel
    states: tuple[State, ...]
    rows: tuple[int, ...]
    lengths: tuple[BodyLength, ...]
    residual_px: float


def body_from_points(
    model: ArticulatedModel, rig: CameraRig, people: Sequence[PeopleSeen], table: KeypointTable = BLAZEPOSE,
    config: TrackerConfig | None = None, near: np.ndarray | None = None,
) -> BodyFromPoints:  # fmt: skip
    """The body of the person whom most cameras see, nearest to a place.

    Parameters
    ----------
    model : to start from; lengths are expected as people have them who are like it.
    rig : the cameras.
    people : whom a detector has found, by image set and camera.
    table : what the detector's points are on the body.
    config : parameters of the points.
    near : (3,) meters, world; image sets in which nobody is within 2 m of it have no part. None: where the cameras look.

    Returns
    -------
    The body, with the same sides, and the person's states.

    Raises
    ------
    TrackerError : no image set shows a person in two cameras whom the body suits, or none near the place.
    """
    config = config or TrackerConfig()
    modality = KeypointModality(rig, model, config.keypoints, table)
    start = PointStart(rig, model, KeypointFitting(model, config, modality), 0)  # with a body of other lengths points disagree
    choice = PersonChoice(rig, modality, start)
    rows, states, observed, others = [], [], [], []
    for row, seen in enumerate(people):
        state = choice.find(seen, near) if sum(map(bool, seen)) > 1 else None  # one camera tells no lengths
        if state is not None and near is not None and _away_m(state, near) > NEAR_M:
            others.append(state)
        elif state is not None:
            modality.set_images((), state, None, choice.choose(seen, state))
            rows.append(row)
            states.append(state)
            observed.append(modality.correspond(state, 1.0).observed)
    if not rows and near is not None and others:
        nearest = min(others, key=lambda state: _away_m(state, near))
        told = f"the nearest is at {place_text(nearest.T_world_root[:3, 3])}, {_away_m(nearest, near):.1f} m from it"
        raise TrackerError(f"expected a person within {NEAR_M:g} m of {place_text(near)} (meters, world axes); {told}")
    if not rows:
        raise TrackerError(f"expected one image set with a person in two cameras, got none in {len(people)} image sets")
    problem = _Problem(rig, model, table, config, observed)
    found = problem.fitted(_Unknowns(tuple(states), problem.expected, np.zeros((len(problem.names), 3))))
    sigmas = problem.sigmas(found)
    lengths = tuple(map(BodyLength, problem.space.names, found.s.tolist(), sigmas.tolist()))
    body, residual_px = problem.space.body(found.s), problem.residual_px(found)
    return BodyFromPoints(body, found.states, tuple(rows), lengths, residual_px)


def _away_m(state: State, place: np.ndarray) -> float:
    return float(np.linalg.norm(state.T_world_root[:3, 3] - place))


def place_text(place: np.ndarray) -> str:
    """A place (3,) meters for people."""
    return f"({', '.join(f'{x:.1f}' for x in place)})"


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """A state of each image set; ``s`` (n_shape,) of the body; ``offsets`` (n_points, 3) meters, beside their means."""

    states: tuple[State, ...]
    s: np.ndarray
    offsets: np.ndarray


class _Problem:
    """Points of all image sets, and what is expected of all unknowns."""

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, table: KeypointTable, config: TrackerConfig,
        observed: Sequence[np.ndarray],
    ):  # fmt: skip
        self._rig, self._observed = rig, observed
        self.space = ShapeSpace(model, True, _LENGTHS)
        self.expected, self._information = expected_lengths(self.space)
        self.names, body = points_of(model, table, config.keypoints.offset_scale)
        self._landmarks = [model.landmark_index(table[name].landmark) for name in self.names]
        self._links, self._priors = body.links, body.priors
        self._means, self._means_D_s = self._expected_offsets([table[name] for name in self.names])
        self._rest = resting(model, config.motion)

    def _expected_offsets(self, points: Sequence[LandmarkPoint]) -> tuple[np.ndarray, np.ndarray]:
        """Means (n_points, 3) of the offsets of the body that is expected, meters, and their derivative by the shape."""
        steps = _STEP * np.eye(len(self.space))
        ahead, back = (
            np.array([expected_offsets(self.space.body(self.expected + sign * step), points) for step in steps])
            for sign in (1.0, -1.0)
        )
        means = expected_offsets(self.space.body(self.expected), points)
        return means, np.moveaxis(ahead - back, 0, 2) / (2.0 * _STEP)

    def fitted(self, start: _Unknowns) -> _Unknowns:
        """Downhill from ``start``."""
        return descend(start, self.cost, self._stepping, _ITERATIONS, _TOLERANCE).found

    def sigmas(self, found: _Unknowns) -> np.ndarray:
        """(n_shape,) standard deviations of the shape, whatever the offsets and states are."""
        H, _ = self.equations(found)
        return np.sqrt(np.diag(np.linalg.inv(H + _NOTHING * np.eye(len(H))))[: len(self.space)])

    def residual_px(self, found: _Unknowns) -> float:
        """See `BodyFromPoints`."""
        model, distances = self.space.body(found.s), []
        for state, observed in zip(found.states, self._observed, strict=True):
            places = self._places(Configuration(model, state), found)
            for camera, seen in zip(self._rig, observed.swapaxes(0, 1), strict=True):
                errors, inlier = _compared(seen, camera.project(places))[:2]
                distances += np.linalg.norm(errors[inlier > 0.5], axis=1).tolist()
        return float(np.median(distances)) if distances else float("nan")

    def _places(self, configuration: Configuration, found: _Unknowns) -> np.ndarray:
        """(n_points, 3) meters, world."""
        R = configuration.Ts_world_link[self._links, :3, :3]
        offsets = self._means + self._means_D_s @ (found.s - self.expected) + found.offsets
        return configuration.landmarks_world[self._landmarks] + np.einsum("nij,nj->ni", R, offsets)

    def cost(self, found: _Unknowns) -> float:
        """Minus twice the logarithm of how likely the points and these unknowns are."""
        model, off = self.space.body(found.s), found.s - self.expected
        total = float(off @ self._information @ off + np.einsum("ni,nij,nj->", found.offsets, self._priors, found.offsets))
        n = model.n_dof
        for state, observed in zip(found.states, self._observed, strict=True):
            places = self._places(Configuration(model, state), found)
            for camera, seen in zip(self._rig, observed.swapaxes(0, 1), strict=True):
                total += _compared(seen, camera.project(places))[2]
            total += self._rest.add_to(np.zeros((n, n)), np.zeros(n), state)
        return total

    def equations(self, found: _Unknowns) -> tuple[np.ndarray, np.ndarray]:
        """H (n, n) and half the gradient g (n,) of the cost by shape, offsets and states, in this order."""
        model = self.space.body(found.s)
        n_shared, n_dof = len(found.s) + found.offsets.size, model.n_dof
        n = n_shared + n_dof * len(found.states)
        H, g = np.zeros((n, n)), np.zeros(n)
        of_shape = slice(len(found.s))
        H[of_shape, of_shape], g[of_shape] = self._information, self._information @ (found.s - self.expected)
        for k, (prior, offset) in enumerate(zip(self._priors, found.offsets, strict=True)):
            own = slice(len(found.s) + 3 * k, len(found.s) + 3 * k + 3)
            H[own, own], g[own] = prior, prior @ offset
        for t, (state, observed) in enumerate(zip(found.states, self._observed, strict=True)):
            columns = np.r_[:n_shared, n_shared + n_dof * t : n_shared + n_dof * (t + 1)]
            own_H, own_g = self._of_set(Configuration(model, state), found, observed)
            self._rest.add_to(own_H[n_shared:, n_shared:], own_g[n_shared:], state)
            H[np.ix_(columns, columns)] += own_H
            g[columns] += own_g
        return H, g

    def _of_set(self, configuration: Configuration, found: _Unknowns, observed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of one image set, of shape, offsets and its state."""
        places, R = self._places(configuration, found), configuration.Ts_world_link[self._links, :3, :3]
        by_offset = np.zeros((len(places), 3, found.offsets.size))
        for k in range(len(places)):
            by_offset[k, :, 3 * k : 3 * k + 3] = R[k]
        by_shape = landmarks_D_shape(self.space, configuration)[self._landmarks] + R @ self._means_D_s
        J = np.concatenate([by_shape, by_offset, configuration.point_jacobian(places, self._links)], axis=2)
        n = J.shape[2]
        H, g = np.zeros((n, n)), np.zeros(n)
        for camera, seen in zip(self._rig, observed.swapaxes(0, 1), strict=True):
            pixels, derivatives, valid = camera.model.project_with_jacobian(se3.apply(camera.T_cam_world, places))
            errors, weights, _ = _compared(seen, (pixels, valid))
            A = np.where(valid[:, None, None], derivatives, 0.0) @ camera.T_cam_world[:3, :3]
            W = weights[:, None, None] * _information(seen)
            to_world = A.swapaxes(1, 2) @ W
            H += np.einsum("nia,nij,njb->ab", J, to_world @ A, J, optimize=True)
            g += np.einsum("nia,nij,nj->a", J, to_world, errors, optimize=True)
        return H, g

    def _stepping(self, found: _Unknowns) -> Callable[[float], _Unknowns]:
        """From a damping to the unknowns after that step; joints stay within their limits."""
        H, g = self.equations(found)
        chain, n_shape = self.space.model.chain, len(found.s)
        n_shared = n_shape + found.offsets.size

        def step(damping: float) -> _Unknowns:
            moved = np.linalg.solve(H + np.diag(damping * np.diag(H) + _NOTHING), -g)
            tangents = moved[n_shared:].reshape(-1, chain.n_dof)
            states = [clip_to_limits(s.retract(tangent), chain) for s, tangent in zip(found.states, tangents, strict=True)]
            offsets = found.offsets + moved[n_shape:n_shared].reshape(-1, 3)
            return _Unknowns(tuple(states), found.s + moved[:n_shape], offsets)

        return step


def _information(seen: np.ndarray) -> np.ndarray:
    """(n, 2, 2) of detections in pixels."""
    return seen[:, [S_UU, S_UV, S_UV, S_VV]].reshape(-1, 2, 2)


def _compared(seen: np.ndarray, projected: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray, float]:
    """Errors (n, 2) in pixels, probabilities (n,) that they are of inliers, and minus twice the logarithm of the mixture."""
    pixels, valid = projected
    has = valid & (seen[:, S_UU] > 0.0)
    errors = np.where(has[:, None], pixels - seen[:, [U, V]], 0.0)
    squares = np.einsum("ni,nij,nj->n", errors, _information(seen), errors)
    outlier = np.maximum(seen[:, OUTLIER], 1e-12)
    density = np.exp(-0.5 * squares)
    weights = np.where(has, density / (density + outlier), 0.0)
    cost = np.where(has, -2.0 * np.log((density + outlier) / (1.0 + outlier)), 0.0)
    return errors, weights, float(cost.sum())
