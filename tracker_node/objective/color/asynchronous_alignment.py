"""Photometric alignment of cameras that do not expose at one time; see `asynchronous_score`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...parallel import Workers
from ..normal_equations import LeastSquaresObjective, NormalEquations
from .alignment import PhotometricObjective, PhotometricOptions
from .asynchronous_score import cameras_by_delay


class AsynchronousPhotometricObjective:
    """The `PhotometricObjective` of a rig whose cameras expose ``late_s`` (n_cameras,) seconds after the state.

    ``velocity`` (n_dof,), in the state's tangent per second, may be set at any time; None: the body rests. How the velocity's own
    direction turns with the state is left out of the derivatives: in a few milliseconds that is nothing.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        late_s: Sequence[float],
        options: PhotometricOptions | None = None,
        colors_rgb: np.ndarray | None = None,
        workers: Workers | None = None,
    ):
        self.velocity: np.ndarray | None = None
        options = options or PhotometricOptions()
        self._min_pixels, self._n_dof = options.min_pixels, model.n_dof
        each = replace(options, min_pixels=1)  # how many are too few is a matter of all cameras together
        self._parts: list[tuple[float, list[int], PhotometricObjective]] = []
        for late, cameras in cameras_by_delay(rig, late_s).items():
            subset = rig.subset([rig.names[i] for i in cameras])
            colors = None if colors_rgb is None else np.asarray(colors_rgb)[cameras]
            self._parts.append((late, cameras, PhotometricObjective(model, subset, each, colors, workers)))

    @property
    def n_levels(self) -> int:
        return self._parts[0][2].n_levels

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        for _, cameras, objective in self._parts:
            objective.set_images([images[i] for i in cameras])

    def at_level(self, level: int) -> _Level:
        """The least-squares problem on one level; 0 is the finest."""
        parts = [(late, objective.at_level(level)) for late, _, objective in self._parts]
        return _Level(self._n_dof, self.velocity, parts, max(self._min_pixels / 4.0**level, 1.0))


class _Level:
    """One level with the velocity of its making.

    Each part's cost is its mean times the residuals that it had at first; here it is the mean over all parts times the residuals
    of all, so that a body does not gain by leaving the images of one part.
    """

    def __init__(
        self, n_dof: int, velocity: np.ndarray | None, parts: Sequence[tuple[float, LeastSquaresObjective]], min_pixels: float
    ):
        self._n_dof = n_dof
        self._velocity, self._parts, self._min_pixels = velocity, parts, min_pixels
        self._first = [0] * len(parts)
        self._first_of_all = 0

    def linearize(self, state: State) -> NormalEquations:
        """Sums over the parts that show the body; too little of it in all of them costs infinity."""
        H, g, cost, count = np.zeros((self._n_dof, self._n_dof)), np.zeros(self._n_dof), 0.0, 0
        for i, (late, objective) in enumerate(self._parts):
            part = objective.linearize(state if self._velocity is None else state.retract(late * self._velocity))
            if part.count == 0:
                continue
            self._first[i] = self._first[i] or part.count
            unscaled = part.count / self._first[i]
            H, g, cost, count = H + unscaled * part.H, g + unscaled * part.g, cost + unscaled * part.cost, count + part.count
        if count < 3 * self._min_pixels:
            return NormalEquations(H, g, math.inf, 0)
        self._first_of_all = self._first_of_all or count
        scale = self._first_of_all / count
        return NormalEquations(scale * H, scale * g, scale * cost, count)
