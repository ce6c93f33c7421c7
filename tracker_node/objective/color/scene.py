"""Colored parts over the empty scene: the whole image is explained, not only the pixels that the body covers.

The score of the color paper looks at the body's pixels alone. Parts of one color (bare skin) then may lie on each other, and
nothing asks for an image of an arm to be covered by an arm. Here every pixel that the body covers is held against what the camera
shows there when nobody is in the scene: the score is the share of the difference between image and empty scene that the body
leaves unexplained. Differences of color are robust, and taken both in RGB and over intensity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...render.raycast.coefficients import N_COEFFICIENTS
from ...render.raycast.raycaster import render_labels
from ...render.shape_arrays import OTHER, ShapeArrays
from . import drawing as kernel
from . import scene_kernels
from .views import ColorViews, every_nth


@dataclass(frozen=True)
class SceneOptions:
    """How colors are compared.

    Attributes
    ----------
    raw_scale, hue_scale : grey levels a channel at which a difference costs half of the most it can.
    unknown_cost : cost, 0..2, of a pixel of the empty scene in a camera without a plate.
    row_step : score every n-th row of the images only.
    """

    raw_scale: float = 40.0
    hue_scale: float = 20.0
    unknown_cost: float = 0.7
    row_step: int = 1


@dataclass(frozen=True, eq=False)
class SceneScore:
    """``score`` : unexplained share, see `SceneObjective`; ``camera_scores`` of each camera that has an image, nan of others;
    ``camera_pixels`` that the body covers."""

    score: float
    camera_scores: np.ndarray
    camera_pixels: np.ndarray


class SceneObjective:
    """Scores of a body of ellipsoids and cones, one color a part and camera, over the empty scene.

    A score of 0 says that the body explains all there is around the place last given to `look_at`, 1 that it explains no more
    than the empty scene does.

    Parameters
    ----------
    colors_rgb : (n_cameras, n_shapes, 3) in 0..255.
    plates : (h, w, 3) BGR uint8 of the empty scene per camera, None where there is none.
    threads : `scores` shares out its states over so many.

    Raises
    ------
    ModelError : a shape that is neither ellipsoid nor cone.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        colors_rgb: np.ndarray,
        plates: Sequence[np.ndarray | None],
        options: SceneOptions | None = None,
        threads: int = 2,
    ):
        arrays = ShapeArrays.from_model(model)
        if OTHER in arrays.kinds:
            raise ModelError(f"model '{model.name}': only ellipsoids and cones can be scored over the empty scene")
        self.model, self.options, self.threads = model, options or SceneOptions(), threads
        self._whole_rig, self.rig = rig, every_nth(rig, 1, self.options.row_step)
        self._plates, self._colors = list(plates), np.asarray(colors_rgb, dtype=np.float32)
        self._views = ColorViews(self.rig.cameras)
        self._costs = np.zeros(self._views.planes.size // 3 + 1, dtype=np.float32)
        self._caps = 3.0 * np.array([self.options.raw_scale, self.options.hue_scale], dtype=np.float32) ** 2
        self._images: list[np.ndarray | None] = [None] * len(rig)
        self._seen = np.zeros(0, dtype=np.int64)
        self._steps: dict[int, SceneObjective] = {}
        self._regions: list[tuple[int, int, int, int] | None] | None = None
        self._all = np.zeros(len(rig))
        self._stale = True
        chain, n = model.chain, len(model.shapes)
        self._chain = (chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions)
        self._shapes = (
            arrays.kinds, arrays.dims, arrays.links, model.Ts_link_shape, np.ones(n, dtype=np.bool_), np.zeros((n, 3)),
        )  # fmt: skip
        self._cameras = (self._views.params, self._views.limits, np.stack([camera.T_cam_world for camera in self.rig]))
        largest = max((camera.model.width + 2 * kernel.LANES) * camera.model.height for camera in self.rig)
        tallest = max(camera.model.height for camera in self.rig)
        self._work = [
            (
                np.zeros((n, N_COEFFICIENTS), dtype=np.float32), np.zeros((n, kernel.N_SURFACE), dtype=np.float32),
                np.zeros((n, 4), dtype=np.int64), np.zeros((n, tallest, 2), dtype=np.int32),
                np.zeros(largest + kernel.LANES, dtype=np.int32),
            )
            for _ in range(threads)
        ]  # fmt: skip
        self._executor = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def set_colors(self, colors_rgb: np.ndarray) -> None:
        """Other colors, (n_cameras, n_shapes, 3)."""
        self._colors = np.asarray(colors_rgb, dtype=np.float32)
        for objective in self._steps.values():
            objective.set_colors(colors_rgb)

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        self._images = list(images)
        self._seen = np.array([i for i, image in enumerate(images) if image is not None], dtype=np.int64)
        self._stale = True
        for objective in self._steps.values():
            objective.set_images(images)

    def look_at(self, regions: Sequence[tuple[int, int, int, int] | None]) -> None:
        """What there is to explain lies within these (u0, v0, u1, v1) of each camera's images; None: the camera counts for
        nothing. It scales the scores, and does not change their order."""
        step = self.options.row_step
        self._regions = [None if r is None else (r[0], r[1] // step, r[2], -(-r[3] // step)) for r in regions]
        self._stale = True
        for objective in self._steps.values():
            objective.look_at(regions)

    def at_row_step(self, row_step: int) -> SceneObjective:
        """The same, on every n-th row of the images."""
        if row_step == self.options.row_step:
            return self
        if row_step not in self._steps:
            options = replace(self.options, row_step=row_step)
            made = SceneObjective(self.model, self._whole_rig, self._colors, self._plates, options, self.threads)
            if self._regions is not None:
                own = self.options.row_step
                made.look_at([None if r is None else (r[0], r[1] * own, r[2], r[3] * own) for r in self._regions])
            made.set_images(self._images)
            self._steps[row_step] = made
        return self._steps[row_step]

    def evaluate(self, state: State) -> SceneScore:
        """The score of one state, camera by camera."""
        gains, pixels, _ = self._totals([state])[0].T
        shares = np.full(len(self.rig), np.nan)
        known = self._all > 0.0
        shares[known] = 1.0 - gains[known] / self._all[known]
        return SceneScore(float(self._scores(gains[None], pixels[None])[0]), shares, pixels.astype(np.int64))

    def score(self, state: State) -> float:
        """Unexplained share; infinite where no camera sees the body."""
        return float(self.scores([state])[0])

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        totals = self._totals(states)
        return self._scores(totals[:, :, 0], totals[:, :, 1])

    def _scores(self, gains: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        everything = max(float(self._all.sum()), 1e-9)
        return np.where(pixels.sum(axis=1) > 0, 1.0 - gains.sum(axis=1) / everything, math.inf)

    def _totals(self, states: Sequence[State]) -> np.ndarray:
        """Gains, pixels and the kernel's verdict, (n_states, n_cameras, 3)."""
        self._fill()
        totals = np.zeros((len(states), len(self.rig), 3))
        roots = np.array([state.T_world_root for state in states])
        joints = np.array([state.joint_positions for state in states]).reshape(len(states), -1)
        self._share_out(roots, joints, totals)
        for n, i in np.argwhere(totals[:, :, 2] == kernel.NOT_SMOOTH):
            self._cast(states[n], int(i), totals[n, i])
        return totals

    def _share_out(self, roots: np.ndarray, joints: np.ndarray, totals: np.ndarray) -> None:
        """Run the kernel, on several threads where there is enough to do."""
        images = (self._views.views, self._views.rays, self._views.planes, self._costs)

        def run(thread: int, part: slice, seen: np.ndarray) -> None:
            scene_kernels.score_states(
                self._chain, self._shapes, self._cameras, images, self._colors, self._caps,
                roots[part], joints[part], seen, self._work[thread], totals[part],
            )  # fmt: skip

        n = self.threads
        if self._executor is None or len(roots) * len(self._seen) < 2:
            return run(0, slice(None), self._seen)
        if len(roots) >= n:
            parts = [(slice(len(roots) * k // n, len(roots) * (k + 1) // n), self._seen) for k in range(n)]
        else:  # copies: see `ColorObjective._share_out`
            parts = [(slice(None), self._seen[k::n].copy()) for k in range(n)]
        others = [self._executor.submit(run, k, *parts[k]) for k in range(1, n)]
        run(0, *parts[0])
        for other in others:
            other.result()

    def _cast(self, state: State, i: int, total: np.ndarray) -> None:
        """One camera by the ray-caster, which draws what the kernel cannot: shapes that the camera is within reach of."""
        total[:2] = 0.0
        sight = render_labels(Configuration(self.model, state), self.rig.cameras[i])
        if sight is not None:
            (u0, v0, _, _), labels = sight
            view = self._views.views[i]
            costs = self._costs[int(view[kernel.PLANES]) // 3 :]
            scene_kernels.add_labels(labels, u0, v0, view, self._views.planes, costs, self._colors[i], self._caps, total)

    def _fill(self) -> None:
        """Planes and costs of the empty scene are made when they are first asked for."""
        if not self._stale:
            return
        step = self.options.row_step
        thin = [None if image is None else np.ascontiguousarray(image[::step]) for image in self._images]
        self._views.fill(thin)
        self._all[:] = 0.0
        for i in self._seen:
            view = self._views.views[i]
            width, height = int(view[kernel.WIDTH]), int(view[kernel.HEIGHT])
            start = int(view[kernel.PLANES]) // 3
            costs, plate = self._costs[start : start + width * height], self._plates[i]
            if plate is None:
                costs[:] = self.options.unknown_cost
            else:
                rgb = np.ascontiguousarray(plate[::step, :, ::-1])
                scene_kernels.scene_costs(self._views.planes, view, rgb, self._caps, costs)
            u0, v0, u1, v1 = (0, 0, width, height) if self._regions is None else self._regions[i] or (0, 0, 0, 0)
            self._all[i] = float(costs.reshape(height, width)[v0:v1, u0:u1].sum(dtype=np.float64))
        self._stale = False
