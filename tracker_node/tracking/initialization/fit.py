"""Silhouettes on small images, and hypotheses drawn to them by Levenberg-Marquardt."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.chamfer.correspondences import ContourBody, ContourCorrespondences, ContourOptions, EvidenceMaps
from ...objective.constraints.prior import Prior
from ...observation.chamfer.boundary import boundary_points
from ...observation.chamfer.distance_transform import signed_distance
from ...optimize.fitter import Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions

_SAMPLES = 8  # along a contour line: images are small
_REACH_PX = 20.0
_COARSE = ContourOptions(
    robust_scale_px=6.0, samples_per_line=_SAMPLES, inner_weight=0.0, alignment=0.3, outward_px=1.5, boundary_weight=1.0,
    boundary_scale_px=12.0, reach_px=_REACH_PX,
)  # fmt: skip
_FREE_RAD, _STIFF_RAD = 1.5, 0.4  # how far joint angles are expected from neutral
_ROUNDS = 3  # in which it is decided anew what is seen
_PRIOR = 4.0  # squared pixels that one such angle costs


class SilhouetteFit:
    """Fits states to the silhouettes of maps of evidence.

    Parameters
    ----------
    cameras, maps : small cameras, and log-odds (h, w) of each; None for a camera without.
    """

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], maps: Sequence[np.ndarray | None]):
        self._model, self._fitter, self._body = model, Fitter(model), ContourBody.of(model, cameras)
        self._maps = [None if odds is None else _evidence(odds) for odds in maps]
        stiffness = np.array([axis.stiffness for axis in model.chain.axes])
        weights = np.zeros(model.n_dof)
        weights[N_ROOT_DOF:] = _PRIOR / np.where(stiffness > 1.0, _STIFF_RAD, _FREE_RAD) ** 2
        self._weights = weights

    def correspond(self, state: State, detail: ContourOptions) -> ContourCorrespondences:
        """Distances to the silhouettes of the outline that is seen in a state.

        Parameters
        ----------
        state, detail : of the body, and how finely.

        Returns
        -------
        The samples with the silhouettes of each camera.
        """
        return ContourCorrespondences(self._body, self._maps, detail, state)

    def fit(self, state: State, iterations: int = 12) -> State:
        """The state that the outline leads to.

        Parameters
        ----------
        state : to begin at.
        iterations : in all.

        Returns
        -------
        Near a minimum.
        """
        prior = Prior(State.neutral(self._model, state.T_world_root), self._weights)
        stage = Stage(_COARSE, LevenbergMarquardtOptions(max_iterations=max(iterations // _ROUNDS, 1), tolerance=1e-2))
        return self._fitter.fit(state, self, [stage] * _ROUNDS, [prior]).state


def _evidence(odds: np.ndarray) -> EvidenceMaps | None:
    """None where nothing at all speaks for the body."""
    mask = (cv2.GaussianBlur(odds, (3, 3), 0.8) > 0.0).astype(np.uint8)
    if not mask.any():
        return None
    distance = np.asarray(cv2.blur(signed_distance(mask, _REACH_PX), (3, 3)), dtype=np.float32)
    boundary = boundary_points(mask, distance, np.ones_like(mask), 2)
    return EvidenceMaps((0, 0), distance, np.full(mask.shape, _REACH_PX, dtype=np.float32), boundary)
