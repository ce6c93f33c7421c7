"""Colored parts over the background: the whole image is explained, not only the pixels that the body covers.

The score of the color paper compares the body's pixels alone. Parts of one color (bare skin) then may lie on each other, and
nothing asks for an image of an arm to be covered by an arm. Here every pixel that the body covers is compared with what the
camera shows there without it: the score is the fraction of the difference between image and background that the body leaves
unexplained. Differences of color are robust, and taken both in RGB and over intensity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...parallel import Workers
from ...render.shape_arrays import OTHER, ShapeArrays
from ..color.views import every_nth
from .maps import background_costs, fill_explained
from .score import AreaScore

_SCALES = 40.0, 20.0  # of raw colors and hues: gray levels a channel at which a difference costs half of the most it can
_CAPS = 3.0 * np.array(_SCALES, dtype=np.float32) ** 2
_UNKNOWN_COST = 0.7  # of 0..2, of a pixel in a camera whose background is not known


@dataclass(frozen=True, eq=False)
class BackgroundScore:
    """Of one state.

    Attributes
    ----------
    score : unexplained fraction, see `BackgroundObjective`.
    camera_scores : that of each camera that has an image, nan of others.
    camera_pixels : that the body covers.
    """

    score: float
    camera_scores: np.ndarray
    camera_pixels: np.ndarray


class BackgroundObjective:
    """Scores of a body of ellipsoids and cones, one color a part and camera, over the background.

    A score of 0 says that the body explains all there is around the place last given to `restrict`, 1 that it explains no more
    than the background does.

    Parameters
    ----------
    model, rig : body and cameras.
    colors_rgb : (n_cameras, n_shapes, 3) in 0..255.
    backgrounds : (h, w, 3) BGR uint8 per camera, None where there is none.
    row_step : score every n-th row of the images only.
    workers : threads that share states or cameras.

    Raises
    ------
    ModelError : a shape that is neither ellipsoid nor cone.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        colors_rgb: np.ndarray,
        backgrounds: Sequence[np.ndarray | None],
        row_step: int = 1,
        workers: Workers | None = None,
    ):
        if OTHER in ShapeArrays.from_model(model).kinds:
            raise ModelError(f"model '{model.name}': only ellipsoids and cones can be scored over the background")
        self.model, self._row_step, self._workers = model, row_step, workers or Workers(1)
        self._backgrounds, self._colors = list(backgrounds), np.asarray(colors_rgb, dtype=np.float32)
        self._whole_rig = rig
        self._area = AreaScore(model, every_nth(rig, 1, row_step).cameras, self._workers)
        self._images: list[np.ndarray | None] = [None] * len(rig)
        self._regions: list[tuple[int, int, int, int] | None] | None = None
        self._all = np.zeros(len(rig))  # cost of the background in each camera
        self._stale = True
        self._steps: dict[int, BackgroundObjective] = {}

    def set_colors(self, colors_rgb: np.ndarray) -> None:
        """Other colors, (n_cameras, n_shapes, 3)."""
        self._colors, self._stale = np.asarray(colors_rgb, dtype=np.float32), True
        for objective in self._steps.values():
            objective.set_colors(colors_rgb)

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        self._images, self._stale = list(images), True
        for objective in self._steps.values():
            objective.set_images(images)

    def restrict(self, regions: Sequence[tuple[int, int, int, int] | None]) -> None:
        """What there is to explain lies within these (u0, v0, u1, v1) of each camera's images; None: the camera counts for
        nothing. It scales the scores, and does not change their order."""
        self._regions, self._stale = list(regions), True
        for objective in self._steps.values():
            objective.restrict(regions)

    def at_row_step(self, row_step: int) -> BackgroundObjective:
        """The same, on every n-th row of the images."""
        if row_step == self._row_step:
            return self
        if row_step not in self._steps:
            made = BackgroundObjective(self.model, self._whole_rig, self._colors, self._backgrounds, row_step, self._workers)
            if self._regions is not None:
                made.restrict(self._regions)
            made.set_images(self._images)
            self._steps[row_step] = made
        return self._steps[row_step]

    def evaluate(self, state: State) -> BackgroundScore:
        """The score of one state, camera by camera."""
        gains, pixels = self._totals([state])[0].T
        shares = np.full(len(self._all), np.nan)
        known = self._all > 0.0
        shares[known] = 1.0 - gains[known] / self._all[known]
        return BackgroundScore(float(self._scores(gains[None], pixels[None])[0]), shares, pixels.astype(np.int64))

    def score(self, state: State) -> float:
        """Unexplained fraction; infinite where no camera sees the body."""
        return float(self.scores([state])[0])

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        totals = self._totals(states)
        return self._scores(totals[:, :, 0], totals[:, :, 1])

    def beside(self, state: State, variables: Sequence[int]) -> BackgroundObjective | _Beside:
        """The same for states that differ in some variables alone: what these do not move is drawn once.

        Parameters
        ----------
        state : the others as they stay.
        variables : indices, as of `model.configuration.to_variables`.

        Returns
        -------
        objective : this one where everything moves.
        """
        moved = np.any(self.model.chain.link_moved_by[self.model.shape_links][:, list(variables)], axis=1)
        return self if moved.all() or not moved.any() else _Beside(self, state, moved)

    def _scores(self, gains: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        everything = max(float(self._all.sum()), 1e-9)
        return np.where(pixels.sum(axis=1) > 0, 1.0 - gains.sum(axis=1) / everything, math.inf)

    def _totals(self, states: Sequence[State]) -> np.ndarray:
        """Gains and pixels, (n_states, n_cameras, 2)."""
        self._fill()
        return self._area.totals(*_poses_of(states))

    def _fill(self) -> None:
        """Maps are made when they are first asked for."""
        if not self._stale:
            return
        step = self._row_step

        def run(i: int) -> np.ndarray:
            image, background = self._images[i], self._backgrounds[i]
            assert image is not None
            bgr = np.ascontiguousarray(image[::step])
            costs = np.full(bgr.shape[:2], _UNKNOWN_COST, dtype=np.float32)
            if background is not None:
                background_costs(bgr, np.ascontiguousarray(background[::step]), _CAPS, costs)
            height, width = bgr.shape[:2]
            u0, v0, u1, v1 = (0, 0, width, height * step) if self._regions is None else self._regions[i] or (0, 0, 0, 0)
            self._all[i] = float(costs[v0 // step : -(-v1 // step), u0:u1].sum(dtype=np.float64))
            maps = np.empty((len(self.model.shapes), height, width), dtype=np.float32)
            fill_explained(bgr, costs, self._colors[i], _CAPS, maps)
            return maps

        seen = [i for i, image in enumerate(self._images) if image is not None]
        maps: list[np.ndarray | None] = [None] * len(self._images)
        self._all[:] = 0.0
        for i, found in zip(seen, self._workers.map(run, seen), strict=True):
            maps[i] = found
        self._area.set_maps(maps, np.arange(len(self.model.shapes)))
        self._stale = False


def _poses_of(states: Sequence[State]) -> tuple[np.ndarray, np.ndarray]:
    """Roots (n, 4, 4) and joint positions (n, n_axes)."""
    joints = np.array([state.joint_positions for state in states]).reshape(len(states), -1)
    return np.array([state.T_world_root for state in states]), joints


class _Beside:
    """A `BackgroundObjective` of parts (n_shapes,) that move, beside the others where a state has them."""

    def __init__(self, whole: BackgroundObjective, state: State, moved: np.ndarray):
        self._whole, self._state, self._moved = whole, state, moved
        whole._fill()
        self._held = whole._area.hold(state.T_world_root, state.joint_positions, moved)

    def score(self, state: State) -> float:
        return float(self.scores([state])[0])

    def scores(self, states: Sequence[State]) -> np.ndarray:
        totals = self._whole._area.totals_beside(self._held, *_poses_of(states)) + self._held.totals
        return self._whole._scores(totals[:, :, 0], totals[:, :, 1])

    def at_row_step(self, row_step: int) -> _Beside:
        return _Beside(self._whole.at_row_step(row_step), self._state, self._moved)
