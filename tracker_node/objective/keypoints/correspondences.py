"""Points of a body that have been detected in the images of one set, as a value: `Correspondences` in information units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State, configured
from ..contour_residual import assemble
from ..normal_equations import CameraEquations, NormalEquations
from ..per_camera import camera_constants
from .kernels import N_COLUMNS, OUTLIER, S_UU, S_UV, S_VV, SCORE, U, V, add_depths, places_of, sum_points

PackedCameras = tuple[np.ndarray, np.ndarray, np.ndarray]


def packed_cameras(rig: CameraRig) -> PackedCameras:
    """(params (n_cameras, n), R (n_cameras, 3, 3), t (n_cameras, 3)) of a rig, as the kernels take them."""
    params, R, t, _ = zip(*(camera_constants(camera) for camera in rig), strict=True)
    return np.array(params), np.array(R), np.array(t)


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Points of a body that a detector finds, each with a constant offset that is not known exactly.

    Attributes
    ----------
    model : the body.
    links : (n,) index of the link that carries the point.
    positions : (n, 3) meters in that link.
    means, covariances : (n, 3) meters and (n, 3, 3) meters^2, of the offset in the axes of that link.
    """

    model: ArticulatedModel
    links: np.ndarray
    positions: np.ndarray
    means: np.ndarray
    covariances: np.ndarray

    @cached_property
    def priors(self) -> np.ndarray:
        """(n, 3, 3) inverse of ``covariances``."""
        return np.linalg.inv(self.covariances)

    def places(self, state: State) -> np.ndarray:
        """(n, 3) meters, world: where the points of a body in ``state`` are expected."""
        return places_of(configured(self.model, state).Ts_world_link, self.links, self._expected)

    @cached_property
    def _expected(self) -> np.ndarray:
        return self.positions + self.means

    def __len__(self) -> int:
        return len(self.links)


@dataclass(frozen=True, eq=False)
class ObservedPoints:
    """What the detector has found of a body's points in all cameras.

    Attributes
    ----------
    pixels : (n_points, n_cameras, 2).
    covariances : (n_points, n_cameras, 2, 2) of their errors, pixels^2.
    outliers : (n_points, n_cameras) probability that such a point is anywhere in the image; 1: it was not found.
    areas : (n_cameras,) pixels^2 in which an outlier may be.
    scores : (n_points, n_cameras) the detector's, by which a limb is judged, not fitted; None: 1 of every point that was found.
    """

    pixels: np.ndarray
    covariances: np.ndarray
    outliers: np.ndarray
    areas: np.ndarray
    scores: np.ndarray | None = None

    def packed(self) -> np.ndarray:
        """(n_points, n_cameras, `kernels.N_COLUMNS`)."""
        result = np.zeros((*self.outliers.shape, N_COLUMNS))
        found = self.outliers < 1.0
        S, q = self.covariances[found], self.outliers[found]
        W = np.linalg.inv(S)
        peak = 2.0 * np.pi * np.sqrt(np.linalg.det(S))
        result[found, U], result[found, V] = self.pixels[found].T
        result[found, S_UU], result[found, S_UV], result[found, S_VV] = W[:, 0, 0], W[:, 0, 1], W[:, 1, 1]
        result[found, OUTLIER] = q / (1.0 - q) * peak / np.broadcast_to(self.areas, found.shape)[found]
        result[found, SCORE] = 1.0 if self.scores is None else self.scores[found]
        return result


@dataclass(frozen=True, eq=False)
class GuessedDepths:
    """What a detector guesses of a body along the rays of cameras: how far it is, and which end of each bone is behind the other.

    Attributes
    ----------
    bones : (n_bones, n_points) sums of a body's points that lead from one end of a bone to the other.
    shares : (n_bones,) of a bone's depth, what is guessed of it on average.
    depths, sigmas : (n_cameras, n_bones) and (n_bones,) meters that the far end is behind the near one; nan without a guess.
    distances, distance_sigmas : (n_cameras,) meters from the camera to the middle of the points.
    centers, rays : (n_cameras, 3) meters, world: of the cameras, and unit vectors to where they see the body.
    weight : factor of what all this says.
    """

    bones: np.ndarray
    shares: np.ndarray
    depths: np.ndarray
    sigmas: np.ndarray
    distances: np.ndarray
    distance_sigmas: np.ndarray
    centers: np.ndarray
    rays: np.ndarray
    weight: float

    def add_to(
        self, H: np.ndarray, g: np.ndarray, body: BodyPoints, configuration: Configuration, sharpness: float
    ) -> float:  # fmt: skip
        """Add least squares with a mixture for guesses that are wrong altogether.

        Parameters
        ----------
        H, g : (n_dof, n_dof) and (n_dof,), added to.
        body, configuration : points of a body, in a state.
        sharpness : factor of the squares.

        Returns
        -------
        Their cost.
        """
        guesses = self.bones, self.shares, self.depths, self.sigmas, self.distances, self.distance_sigmas
        places, moved_by = body.places(configuration.state), body.model.chain.link_moved_by
        return add_depths(
            *guesses, self.centers, self.rays, self.weight, sharpness, places, body.links, moved_by, configuration.twists, H, g
        )


@dataclass(frozen=True, eq=False)
class PointsAt:
    """Points compared with one state.

    Attributes
    ----------
    state, equations : the state, and the normal equations there.
    normal, gradient : (n_cameras, n_links, 6, 6), (n_cameras, n_links, 6) of each camera at the best offsets.
    offsets : (n_points, 3) meters, best offset of each point in its link.
    information : (n_points, 3, 3) of the images about the place of each point, in the axes of its link.
    weights : (n_points, n_cameras) probability that a detection is no outlier; -1 where there is none.
    squares : (n_points, n_cameras) squared residual over its variance.
    """

    state: State
    equations: NormalEquations
    normal: np.ndarray
    gradient: np.ndarray
    offsets: np.ndarray
    information: np.ndarray
    weights: np.ndarray
    squares: np.ndarray


class KeypointCorrespondences:
    """Detected points compared with a body's (`Correspondences`).

    Parameters
    ----------
    body : its points.
    cameras : of `packed_cameras`.
    observed : `ObservedPoints.packed`.
    sharpness : factor of what the cameras say; below 1 for a body that is still far off.
    depths : that the detector guesses; None: it guesses none.
    """

    def __init__(
        self, body: BodyPoints, cameras: PackedCameras, observed: np.ndarray, sharpness: float = 1.0,
        depths: GuessedDepths | None = None,
    ):  # fmt: skip
        self.body, self.observed, self._cameras, self._sharpness, self._depths = body, observed, cameras, sharpness, depths
        self._latest: PointsAt | None = None

    def at(self, state: State) -> PointsAt:
        """The points compared with a state; the latest comparison is kept."""
        if self._latest is None or self._latest.state is not state:
            self._latest = self._compared(state)
        return self._latest

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; not to be written into."""
        return self.at(state).equations

    def camera_equations(self, state: State) -> Sequence[CameraEquations | None]:
        """What each camera says of ``state`` at the best offsets; None for one without points."""
        there = self.at(state)
        found = zip(there.normal, there.gradient, there.weights.max(axis=0).tolist(), strict=True)
        return [CameraEquations(normal, gradient) if most >= 0.0 else None for normal, gradient, most in found]

    def squares_px(self, state: State) -> np.ndarray:
        """(n_points, n_cameras) squared distances in pixels at the best offsets; 0 where there is no point."""
        found = self.at(state)
        W = self.observed[:, :, [S_UU, S_VV]].mean(axis=2) * self._sharpness
        return np.where(found.weights >= 0.0, found.squares / np.maximum(W, 1e-12), 0.0)

    def _compared(self, state: State) -> PointsAt:
        body, chain = self.body, self.body.model.chain
        n_points, n_cameras = self.observed.shape[:2]
        n_links = len(chain.links)
        normal, gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
        of_cameras = np.zeros((n_cameras, n_links, 6, 6)), np.zeros((n_cameras, n_links, 6))
        weights, squares = np.empty((n_points, n_cameras)), np.empty((n_points, n_cameras))
        offsets, information = np.empty((n_points, 3)), np.empty((n_points, 3, 3))
        configuration = configured(body.model, state)
        cost, count = sum_points(
            self.observed, self._cameras, configuration.Ts_world_link, body.links, body.positions, body.means, body.priors,
            self._sharpness, (normal, gradient, *of_cameras), (offsets, information, weights, squares),
        )  # fmt: skip
        H, g = np.zeros((chain.n_dof, chain.n_dof)), np.zeros(chain.n_dof)
        assemble(normal, gradient, chain.link_moved_by, configuration.twists, H, g)
        if self._depths is not None:
            cost += self._depths.add_to(H, g, body, configuration, self._sharpness)
        return PointsAt(state, NormalEquations(H, g, cost, count), *of_cameras, offsets, information, weights, squares)
