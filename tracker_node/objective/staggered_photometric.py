"""Photometric alignment of cameras that do not expose at one instant; see `staggered_score`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..camera.camera_rig import CameraRig
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from .normal_equations import LeastSquaresObjective, NormalEquations
from .photometric import PhotometricObjective, PhotometricOptions
from .staggered_score import cameras_by_delay


class StaggeredPhotometricObjective:
    """The `PhotometricObjective` of a rig whose cameras are late by ``late_s`` (n_cameras,) seconds after the state.

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
        threads: int = 2,
    ):
        self.velocity: np.ndarray | None = None
        self._parts: list[tuple[float, list[int], PhotometricObjective]] = []
        for late, cameras in cameras_by_delay(rig, late_s).items():
            subset = rig.subset([rig.names[i] for i in cameras])
            colors = None if colors_rgb is None else np.asarray(colors_rgb)[cameras]
            self._parts.append((late, cameras, PhotometricObjective(model, subset, options, colors, threads)))

    @property
    def n_levels(self) -> int:
        return self._parts[0][2].n_levels

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        for _, cameras, objective in self._parts:
            objective.set_images([images[i] for i in cameras])

    def at_level(self, level: int) -> _Level:
        """The least-squares problem on one level; 0 is the finest."""
        return _Level(self.velocity, [(late, objective.at_level(level)) for late, _, objective in self._parts])


@dataclass(frozen=True, eq=False)
class _Level:
    """One level with the velocity of its making."""

    velocity: np.ndarray | None
    parts: list[tuple[float, LeastSquaresObjective]]

    def linearize(self, state: State) -> NormalEquations:
        """Sums over the parts; no mask in any of them costs infinity."""
        seen = [state if self.velocity is None else state.retract(late * self.velocity) for late, _ in self.parts]
        each = [objective.linearize(where) for (_, objective), where in zip(self.parts, seen, strict=True)]
        H, g = np.sum([e.H for e in each], axis=0), np.sum([e.g for e in each], axis=0)
        return NormalEquations(H, g, sum(e.cost for e in each), sum(e.count for e in each))
