"""Girths and clothes of a body, followed while tracking: where the surface of each part is beside the model's."""

from __future__ import annotations

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.humans.keypoints import relative_size
from ...model.humans.surfaces import expected_surfaces
from ...objective.lines.surfaces import N_UNKNOWNS, Surfaces, SurfaceSums
from ..config import KeypointConfig


class SurfaceFilter:
    """Beliefs of the surfaces, one a part; needs joints that something else holds in place, such as a detector's points.

    Parameters
    ----------
    model, config : body, parameters.

    Attributes
    ----------
    surfaces : as they are known now.
    """

    def __init__(self, model: ArticulatedModel, config: KeypointConfig):
        size = relative_size(model)
        self._config, self._wobble = config, (size * config.surface_wobble_m) ** 2 * np.eye(N_UNKNOWNS)
        means, sigmas = expected_surfaces(model)
        sigmas = size * config.surface_scale * sigmas
        self._first = Surfaces(size * means, sigmas[:, :, None] ** 2 * np.eye(N_UNKNOWNS))
        self.surfaces = self._first

    def reset(self) -> None:
        """Back to what is expected before anything has been seen."""
        self.surfaces = self._first

    def update(self, sums: SurfaceSums, trusted: np.ndarray) -> None:
        """Take in what the lines of one set say.

        Parameters
        ----------
        sums : of the lines at the state that was found.
        trusted : (n_shapes,) mask of the parts that are where that state says.
        """
        now, config = self.surfaces, self._config
        # What the lines say of a part wobbles from pose to pose, and one error lasts for some sets
        share = np.linalg.inv(np.eye(N_UNKNOWNS) + sums.H @ self._wobble) / config.correlation_sets
        share[~trusted] = 0.0
        covariances = np.linalg.inv(now.priors + share @ sums.H)
        means = now.means - (covariances @ (share @ sums.b[:, :, None]))[:, :, 0]
        least = (0.25 * config.surface_wobble_m) ** 2
        values, axes = np.linalg.eigh(0.5 * (covariances + np.swapaxes(covariances, 1, 2)))
        self.surfaces = Surfaces(means, (axes * np.maximum(values, least)[:, None]) @ np.swapaxes(axes, 1, 2))
