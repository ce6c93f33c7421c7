"""Offsets of a detector's points from the body's landmarks, estimated while tracking.

Each offset has a Gaussian belief in the axes of its link. What the points of one set say of it counts as one part in
``correlation_sets``: what a network gets wrong in an image it gets wrong in the next ones, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...objective.keypoints.correspondences import BodyPoints, PointsAt
from ..config import KeypointConfig


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
