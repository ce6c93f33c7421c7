"""Points of a body that have been detected in the images of one set, as a value: `Correspondences` in information units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ..contour_residual import assemble
from ..normal_equations import CameraEquations, NormalEquations
from ..per_camera import camera_constants
from .kernels import N_COLUMNS, OUTLIER, S_UU, S_UV, S_VV, SCORE, U, V, sum_points

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
        T = Configuration(self.model, state).Ts_world_link[self.links]
        return np.einsum("nij,nj->ni", T[:, :3, :3], self.positions + self.means) + T[:, :3, 3]

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
class PointsAt:
    """Points compared with one state.

    Attributes
    ----------
    state, equations : the state, and the normal equations there.
    cameras : what each camera says of it.
    offsets : (n_points, 3) meters, best offset of each point in its link.
    information : (n_points, 3, 3) of the images about the place of each point, in the axes of its link.
    weights : (n_points, n_cameras) probability that a detection is no outlier; -1 where there is none.
    squares : (n_points, n_cameras) squared residual over its variance.
    """

    state: State
    equations: NormalEquations
    cameras: tuple[CameraEquations | None, ...]
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
    """

    def __init__(self, body: BodyPoints, cameras: PackedCameras, observed: np.ndarray, sharpness: float = 1.0):
        self.body, self.observed, self._cameras, self._sharpness = body, observed, cameras, sharpness
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
        return self.at(state).cameras

    def squares_px(self, state: State) -> np.ndarray:
        """(n_points, n_cameras) squared distances in pixels at the best offsets; 0 where there is no point."""
        found = self.at(state)
        W = self.observed[:, :, [S_UU, S_VV]].mean(axis=2) * self._sharpness
        return np.where(found.weights >= 0.0, found.squares / np.maximum(W, 1e-12), 0.0)

    def _compared(self, state: State) -> PointsAt:
        body, chain = self.body, self.body.model.chain
        n_points, n_cameras = self.observed.shape[:2]
        n_links, n_dof = len(chain.links), chain.n_dof
        normal, gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
        of_cameras = np.zeros((n_cameras, n_links, 6, 6)), np.zeros((n_cameras, n_links, 6))
        weights, squares = np.empty((n_points, n_cameras)), np.empty((n_points, n_cameras))
        offsets, information = np.empty((n_points, 3)), np.empty((n_points, 3, 3))
        configuration = Configuration(body.model, state)
        cost, count = sum_points(
            self.observed, self._cameras, configuration.Ts_world_link, body.links, body.positions, body.means, body.priors,
            self._sharpness, (normal, gradient, *of_cameras), (offsets, information, weights, squares),
        )  # fmt: skip
        H, g = np.empty((n_dof, n_dof)), np.empty(n_dof)
        assemble(normal, gradient, chain.link_moved_by, configuration.twists, H, g)
        cameras = tuple(
            CameraEquations(of_cameras[0][i], of_cameras[1][i]) if (weights[:, i] >= 0.0).any() else None
            for i in range(n_cameras)
        )
        return PointsAt(state, NormalEquations(H, g, cost, count), cameras, offsets, information, weights, squares)
