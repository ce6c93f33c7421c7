"""Points that a detector has found, as a modality beside contours, or alone.

Offsets of a detector's points from the body's landmarks, estimated while tracking.

Each offset has a Gaussian belief in the axes of its link. What the points of one set say of it counts as one part in
``correlation_sets``: what a network gets wrong in an image it gets wrong in the next ones, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.humans.keypoints import (
    GUESSED_BONES,
    GUESSED_SIZE,
    GUESSED_SIZE_SIGMA,
    KeypointTable,
    expected_offsets,
    relative_size,
)
from ...model.humans.measures import mirrored_rows
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.keypoints.correspondences import (
    BodyPoints,
    GuessedDepths,
    KeypointCorrespondences,
    ObservedPoints,
    PointsAt,
    packed_cameras,
)
from ...objective.keypoints.kernels import N_COLUMNS, S_UU, U, V
from ...observation.keypoints.people import Person
from ..config import KeypointConfig
from ..limbs.tree import length_scale
from ..modality import Images, Modality, Persons
from ..motion.model import ExposureDelays

_BEGINS_M = 0.05  # from a point to the joint of the limb that begins there, at most
_STAYS = 1.0  # times the distance from its twin, that a point of the trunk moves beside that at most: with a shoulder girdle
# How far a pair of points is apart in an image: at most, as a share of its length, where one may be taken for the other, and at
# least, in standard deviations, where that matters
_END_ON, _APART = 0.6, 1.5
_OUTLIERS_UNSURE = 0.4  # fraction of outliers among points whose score is nothing; measured on the clips of the offsets


@lru_cache(maxsize=64)
def rows_of(names: tuple[str, ...], wanted: tuple[str, ...]) -> np.ndarray:
    """Where the points of a body are among those of a person.

    Parameters
    ----------
    names, wanted : of the person's points, and of the body's, all of which are among them.

    Returns
    -------
    (n,) indices, not to be written into.
    """
    return np.array([names.index(name) for name in wanted])


def points_of(model: ArticulatedModel, table: KeypointTable, offset_scale: float = 1.0) -> tuple[tuple[str, ...], BodyPoints]:
    """The points of a table that a body has.

    Parameters
    ----------
    model, table : body, and the detector's points.
    offset_scale : factor of the spread of their offsets.

    Returns
    -------
    Names of the points, and the points with their offsets before anything has been seen.
    """
    names = tuple(name for name, point in table.items() if point.landmark in model.landmark_names)
    rows = [model.landmark_index(table[name].landmark) for name in names]
    size = relative_size(model)
    means = expected_offsets(model, [table[name] for name in names])
    sigmas = size * offset_scale * np.array([table[name].sigma for name in names], dtype=np.float64).reshape(-1, 3)
    covariances = sigmas[:, :, None] ** 2 * np.eye(3)
    return names, BodyPoints(model, model.landmark_links[rows], model.landmark_positions[rows], means, covariances)


class KeypointModality(Modality):
    """The `Modality` of detected points.

    Parameters
    ----------
    rig, model, config : cameras, body, parameters.
    table : what the detector's points are on the body.

    Attributes
    ----------
    names : of the points that the body has.
    mirrored : (n,) row of each point's twin on the other side, or its own.
    offsets : of these points, as they are known now.
    guesses : what detectors guess of a body along the rays.
    size : `length_scale` of the body.
    looked : a detector has looked at the present images.

    Raises
    ------
    ModelError : the body has none of the points.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: KeypointConfig, table: KeypointTable):
        self._rig, self._model, self._config = rig, model, config
        self.names, points = points_of(model, table, config.offset_scale)
        if not self.names:
            some = ", ".join(sorted({point.landmark for point in table.values()})[:5])
            raise ModelError(
                f"'{model.name}' has none of the points that a detector finds: leave keypoints out of modalities, or name its"
                f" landmarks in a keypoints table, or as those of people ({some}, …)"
            )
        self.mirrored = np.array(mirrored_rows(self.names))
        self._pairs = _trunk_pairs(points, self.mirrored)
        self.offsets = PointOffsets(points, config)
        self.size = length_scale(model)
        self._cameras = packed_cameras(rig)
        self._observed: np.ndarray | None = None
        self.looked = False
        self.guesses = DepthGuesses(rig, self.names, points, config)
        self._depths: GuessedDepths | None = None

    def reset(self) -> None:
        """Offsets are as before anything has been seen."""
        self.offsets.reset()
        self._observed = self._depths = None

    def lessons(self, known: bool) -> Sequence[None]:
        """Nothing is learned from a first image set before the body is fitted."""
        return ()

    def learn_first(self, images: Images, state: State, lesson: None) -> None:
        """Nothing is learned from a first image set before the body is fitted."""

    def set_images(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, persons: Persons = ()
    ) -> None:
        """Take the points of the body in each camera."""
        self._observed, self._depths, self.looked = None, None, bool(persons)
        if expected is not None and any(person is not None for person in persons):
            observed = self._of(persons)
            if delays is not None:
                self._brought_together(observed, expected, delays)
            self._observed, self._depths = observed.packed(), self.guesses.of(persons)

    def _of(self, persons: Persons) -> ObservedPoints:
        n, m, config = len(self.names), len(self._rig), self._config
        pixels, covariances = np.zeros((n, m, 2)), np.tile(np.eye(2), (n, m, 1, 1))
        outliers, areas, scores = np.ones((n, m)), np.ones(m), np.zeros((n, m))
        for i, person in enumerate(persons):
            if person is not None:
                rows = rows_of(person.names, self.names)
                size = max(person.box[2] - person.box[0], person.box[3] - person.box[1], 1.0)
                floor = (config.sigma_fraction * size) ** 2
                pixels[:, i] = person.pixels[rows]
                covariances[:, i] = config.covariance_scale * person.covariances[rows] + floor * np.eye(2)
                outliers[:, i] = config.outlier_fraction + _OUTLIERS_UNSURE * (1.0 - person.scores[rows])
                outliers[person.scores[rows] <= 0.0, i] = 1.0
                scores[:, i] = person.scores[rows]
                areas[i] = size * size
        outliers[~np.isfinite(pixels).all(axis=2)] = 1.0
        return ObservedPoints(np.nan_to_num(pixels), covariances, np.clip(outliers, 1e-4, 1.0), areas, scores)

    def _brought_together(self, observed: ObservedPoints, expected: State, delays: ExposureDelays) -> None:
        """Move the points of cameras that expose late to where they would have been at the stamp of the set."""
        landmarks = self.places(expected)
        for i, (camera, offset) in enumerate(zip(self._rig, delays.offsets(expected), strict=True)):
            if offset is not None:
                late, seen = camera.project(self.places(expected.retract(offset)))
                there, also = camera.project(landmarks)
                observed.pixels[:, i] -= np.where((seen & also)[:, None], late - there, 0.0)

    def places(self, state: State) -> np.ndarray:
        """(n_points, 3) meters, world: where the points of a body in ``state`` are expected."""
        return self.offsets.body.places(state)

    def end_on(self, state: State) -> list[tuple[tuple[int, int], list[int]]]:
        """Where a detector may have taken left for right on the trunk: cameras that see one side nearly behind the other.

        Parameters
        ----------
        state : of the body, about.

        Returns
        -------
        Rows of both points, and indices of the cameras; the one that sees them nearest to each other first.
        """
        found, observed, places = [], self._observed, self.places(state)
        if observed is None:
            return []
        for pair in self._pairs:
            length_m, middle = float(np.linalg.norm(places[pair[0]] - places[pair[1]])), places[list(pair)].mean(axis=0)
            apart = {}
            for i, camera in enumerate(self._rig):
                one, other = observed[pair[0], i], observed[pair[1], i]
                depth = float((middle - camera.center) @ camera.T_world_cam[:3, 2])
                px = float(np.hypot(one[U] - other[U], one[V] - other[V]))
                if px * np.sqrt(min(one[S_UU], other[S_UU])) > _APART and depth > 0.0:  # else not found, or alike either way
                    apart[i] = px * depth / (float(camera.model.K[0, 0]) * length_m)
            cameras = sorted((i for i, share in apart.items() if share < _END_ON), key=apart.__getitem__)
            if cameras:
                found.append((pair, cameras))
        return found

    def exchange(self, pair: tuple[int, int], cameras: Sequence[int]) -> None:
        """Take the points of both sides of the trunk for each other; what is guessed of their depths is nothing, then.

        Parameters
        ----------
        pair, cameras : of `end_on`.
        """
        observed = self._observed
        if observed is not None and cameras:
            self._observed = observed = observed.copy()
            rows, columns = list(pair), list(cameras)
            observed[np.ix_(rows, columns)] = observed[np.ix_(rows[::-1], columns)]
            if self._depths is not None:
                depths = self._depths.depths.copy()
                depths[np.ix_(columns, (self._depths.bones[:, rows] != 0.0).any(axis=1))] = np.nan
                self._depths = replace(self._depths, depths=depths)

    @contextmanager
    def exchanged(self, pair: tuple[int, int], cameras: Sequence[int]) -> Iterator[None]:
        """`exchange`, until the context ends.

        Parameters
        ----------
        pair, cameras : of `end_on`.
        """
        before = self._observed, self._depths
        self.exchange(pair, cameras)
        try:
            yield
        finally:
            self._observed, self._depths = before

    @property
    def has_points(self) -> bool:
        """Whether the present set has any."""
        return self._observed is not None

    def correspond(self, state: State, sharpness: float) -> KeypointCorrespondences:
        """The points of the present set, whatever the state; ``sharpness`` is a factor of what they say."""
        observed = self._observed
        if observed is None:
            observed = np.zeros((len(self.names), len(self._rig), N_COLUMNS))
        return KeypointCorrespondences(self.offsets.body, self._cameras, observed, sharpness, self._depths)

    def learn(self, images: Images, state: State, weights: np.ndarray | None) -> None:
        """Follow the offsets of the points on parts that are where the state says."""
        if self._observed is not None:
            trusted = np.ones(len(self.names), dtype=np.bool_)
            if weights is not None:
                doubtful = self._model.shape_links[np.asarray(weights) <= 0.5]
                trusted = ~np.isin(self.offsets.body.links, doubtful)
            self.offsets.update(self.correspond(state, 1.0).at(state), trusted)


def _trunk_pairs(points: BodyPoints, mirrored: np.ndarray) -> list[tuple[int, int]]:
    """Rows of the points left and right on the trunk where limbs begin: hips and shoulders."""
    chain, neutral, pairs = points.model.chain, Configuration(points.model, State.neutral(points.model)), []
    places, moved = points.places(neutral.state), chain.link_moved_by[points.links][:, N_ROOT_DOF:]
    ways = np.linalg.norm(neutral.point_jacobian(places, points.links), axis=1)[:, N_ROOT_DOF:]
    ways *= np.minimum(chain.upper - chain.lower, np.pi)  # meters, along which each joint moves a point
    for k, twin in enumerate(mirrored):
        children = [i for i, parent in enumerate(chain.parents) if parent == points.links[k]]
        begins = any(np.linalg.norm(chain.offsets[i][:3, 3] - points.positions[k]) < _BEGINS_M for i in children)
        way = np.linalg.norm(ways[k, moved[k] & ~moved[twin]])
        if k < twin and begins and way < _STAYS * np.linalg.norm(places[k] - places[twin]):
            pairs.append((k, int(twin)))
    return pairs


class DepthGuesses:
    """Makes `GuessedDepths` of the skeletons that a detector guesses.

    Parameters
    ----------
    rig, names, points, config : cameras, a body's points, and parameters.
    """

    def __init__(self, rig: CameraRig, names: tuple[str, ...], points: BodyPoints, config: KeypointConfig):
        self._rig, self._names, self._weight = rig, names, config.depth_weight
        self._meters = GUESSED_SIZE * relative_size(points.model)
        known = [bone for bone in GUESSED_BONES if {*bone.near, *bone.far} <= set(names)]
        self._bones = np.zeros((len(known), len(names)))
        for row, bone in zip(self._bones, known, strict=True):
            for part, sign in ((bone.far, 1.0), (bone.near, -1.0)):
                row[[names.index(name) for name in part]] = sign / len(part)
        self._lengths = np.linalg.norm(self._bones @ points.places(State.neutral(points.model)), axis=1)
        self._shares, self._sigmas = np.array([bone.share for bone in known]), self._lengths * [bone.sigma for bone in known]

    def of(self, persons: Persons) -> GuessedDepths | None:
        """What the detector guesses of the body in each camera; None without any guess."""
        if not self._weight or not any(person is not None and person.skeleton is not None for person in persons):
            return None
        n = len(self._rig)
        depths, distances, rays = np.full((n, len(self._shares)), np.nan), np.full(n, np.nan), np.zeros((n, 3))
        for i, (camera, person) in enumerate(zip(self._rig, persons, strict=True)):
            if person is None or person.skeleton is None:
                continue
            rows = rows_of(person.names, self._names)
            pixels, skeleton = person.pixels[rows], self._meters * person.skeleton[rows]
            known = np.isfinite(skeleton).all(axis=1)
            if known.any():
                depths[i] = np.where(self._has_ends(known), self._bones @ np.where(known, skeleton[:, 2], 0.0), np.nan)
                distances[i] = _distance(camera, pixels[known], skeleton[known])
                rays[i] = _sight(camera, pixels[known])
        centers = np.array([camera.center for camera in self._rig])
        spreads = GUESSED_SIZE_SIGMA * distances
        return GuessedDepths(self._bones, self._shares, depths, self._sigmas, distances, spreads, centers, rays, self._weight)

    def _has_ends(self, known: np.ndarray) -> np.ndarray:
        """(n_bones,) mask of those all of whose points are known, (n_points,)."""
        return ~((self._bones != 0.0) & ~known).any(axis=1)

    def lifted(self, i: int, person: Person) -> np.ndarray:
        """Where a person's points are in space, by one camera and the size of the body.

        Parameters
        ----------
        i : of the camera.
        person : seen in it. Without a guessed skeleton all points are taken to be equally far away.

        Returns
        -------
        (n, 3) meters, world, in the order of the person's names; nan where nothing is known.
        """
        camera, known = self._rig.cameras[i], np.isfinite(person.pixels).all(axis=1) & (person.scores > 0.0)
        if person.skeleton is None:
            rows = rows_of(person.names, self._names)
            seen = np.where(known[:, None], person.pixels, 0.0)[rows]
            lengths = np.where(self._has_ends(known[rows]), np.linalg.norm(self._bones @ seen, axis=1), 0.0)
            px_per_m = (lengths / self._lengths).max(initial=0.0)  # none looks longer than it is
            known &= px_per_m > 0.0
            skeleton = np.column_stack([person.pixels / max(px_per_m, 1e-9), np.zeros(len(person.pixels))])
        else:
            skeleton = self._meters * person.skeleton
            known &= np.isfinite(skeleton).all(axis=1)
        places = np.full((len(known), 3), np.nan)
        if known.sum() > 1:
            pixels, from_middle = person.pixels[known], skeleton[known] - skeleton[known].mean(axis=0)
            middle = camera.center + _distance(camera, pixels, from_middle) * _sight(camera, pixels)
            places[known] = middle + from_middle @ camera.T_cam_world[:3, :3]
        return places


def _distance(camera: Camera, pixels: np.ndarray, skeleton: np.ndarray) -> float:
    """Meters from a camera to points (n, 2), by how large their skeleton (n, 3), meters in the camera's axes, is in the image."""
    seen, flat = (each - each.mean(axis=0) for each in (pixels, skeleton[:, :2]))
    px_per_m = max(float((seen * flat).sum()), 1e-9) / max(float((flat * flat).sum()), 1e-9)
    return float(camera.model.params[0]) / px_per_m


def _sight(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """(3,) unit vector, world, from a camera to the middle of pixels (n, 2)."""
    ray = camera.model.rays(pixels.mean(axis=0)[None])[0][0]
    return camera.T_world_cam[:3, :3] @ ray / np.linalg.norm(ray)


class PointOffsets:
    """Beliefs of the offsets of one body's points.

    Parameters
    ----------
    points : with the offsets that are expected before anything has been seen.
    config : parameters.

    Attributes
    ----------
    body : the points with the offsets as they are known now.
    """

    def __init__(self, points: BodyPoints, config: KeypointConfig):
        self._first, self._config = points, config
        self.body = points

    def reset(self) -> None:
        """Back to what is expected before anything has been seen."""
        self.body = self._first

    def update(self, points: PointsAt, trusted: np.ndarray) -> None:
        """Take in what the points of one set say.

        Parameters
        ----------
        points : compared with the state that was found.
        trusted : (n,) mask of the points on parts that are where that state says.
        """
        config, body = self._config, self.body
        means, covariances = body.means.copy(), body.covariances.copy()
        told = np.flatnonzero(trusted & (points.weights > 0.5).any(axis=1))
        A, priors, known = points.information[told], body.priors[told], body.means[told, :, None]
        pulled = (A + priors) @ points.offsets[told, :, None] - priors @ known  # A times where the points alone have it
        share = np.linalg.inv(np.eye(3) + config.wobble_m**2 * A) / config.correlation_sets
        covariance = np.linalg.inv(priors + share @ A)
        means[told] = (covariance @ (priors @ known + share @ pulled))[:, :, 0]
        values, axes = np.linalg.eigh(0.5 * (covariance + covariance.swapaxes(1, 2)))
        least = config.least_offset_sigma_m**2
        covariances[told] = (axes * np.maximum(values, least)[:, None]) @ axes.swapaxes(1, 2)
        self.body = replace(body, means=means, covariances=covariances)
