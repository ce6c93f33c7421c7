"""How much better the colors of all images are explained with a limb in other poses: many poses at a time, on small images.

What correspondence lines cannot tell from afar, the area of a limb does: whether the pixels that it would cover are of its colors
rather than the scene's, and not better explained by another part of the body that it would hide. Meshes count as their
bounding boxes; cameras as exposing together; what stands before the body as not there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...render.ray_table import ray_table
from ...render.shape_arrays import ShapeArrays
from ..lines.correspondences import View
from ..per_camera import serial
from .evidence_kernels import place_shapes
from .evidence_score import packed_shapes
from .limb_score_kernels import draw_rest, fill_maps, score_limb

_CELLS = 2  # across, of the pixels of a cell that are looked at


class LimbScore:
    """Of the limbs of one body in one image set.

    Parameters
    ----------
    classes : (n_shapes,) color class of every shape.
    shadow, clamp : as in `RegionOptions`.
    """

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, classes: np.ndarray, shadow: float, clamp: float,
        parallel: Callable[[Callable, list], list] = serial,
    ):  # fmt: skip
        self._rig, self._model, self._classes, self._parallel = rig, model, classes, parallel
        self._shadow, self._clamp = shadow, np.float32(clamp)
        chain = model.chain
        self._chain = (chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions)
        self._shapes = packed_shapes(model)
        self._reach_m = _longest_reach(model)
        self._cell = 0
        self._maps: list[np.ndarray | None] = [None] * len(rig)

    def look(self, views: Sequence[View | None], state: State, cell_px: int) -> None:
        """Take in what the cameras show around a body in ``state``, ``cell_px`` pixels wide and high at a time."""
        if cell_px != self._cell:
            self._cell = cell_px
            lenses = [c.model.resized(max(c.model.width // cell_px, 1), max(c.model.height // cell_px, 1)) for c in self._rig]
            self._cameras = [replace(camera, model=lens) for camera, lens in zip(self._rig, lenses, strict=True)]
        self._maps = [None] * len(views)
        root = state.T_world_root[:3, 3]

        def run(i: int) -> None:
            view, lens = views[i], self._cameras[i].model
            assert view is not None
            body, scene = view.densities
            maps = np.zeros((lens.height, lens.width, len(body)), dtype=np.float32)
            log_body = np.ascontiguousarray(np.log(body.T))
            step, region = max(1, cell_px // _CELLS), _around(root, self._reach_m, self._cameras[i])
            fill_maps(view.bgr, log_body, scene, view.room, self._shadow, step, self._clamp, region, maps)
            self._maps[i] = maps

        self._parallel(run, [i for i, view in enumerate(views) if view is not None])

    def totals(self, shapes: np.ndarray, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """(n, n_cameras, 2): what a limb gains against not being there, and the cells in which it shows.

        ``shapes`` (n_shapes,): mask of the limb's, or of all; ``roots`` (n, 4, 4) and ``joints`` (n, n_axes), n > 0, of the
        states. What is not the limb is taken to be where the first of them has it.
        """
        kinds, dims, links, places = self._shapes
        placed = np.empty((len(joints), len(kinds), 4, 4))
        place_shapes(self._chain, links, places, np.ascontiguousarray(roots), np.ascontiguousarray(joints), placed)
        rest, own = ~shapes, np.ascontiguousarray(placed[:, shapes])
        still = np.ascontiguousarray(placed[0, rest])
        totals = np.zeros((len(self._rig), len(joints), 2))

        def run(i: int) -> None:
            camera, maps = self._cameras[i], self._maps[i]
            assert maps is not None
            table, lens = ray_table(camera.model), camera.model
            view = (lens.params, table.limits, camera.T_cam_world, (lens.width, lens.height))
            buffer = np.zeros(table.xs.shape, dtype=np.int32)
            gains = np.empty(maps.shape[:2], dtype=np.float32)
            rays = (table.xs, table.ys)
            draw_rest(kinds[rest], dims[rest], still, view, rays, maps, self._classes[rest], buffer, gains)
            score_limb(
                kinds[shapes], dims[shapes], own, view, rays, maps, self._classes[shapes], buffer.copy(), gains, buffer, totals[i]
            )

        self._parallel(run, [i for i, maps in enumerate(self._maps) if maps is not None])
        return np.swapaxes(totals, 0, 1)


def _longest_reach(model: ArticulatedModel) -> float:
    """How far (m) from its root a body could reach if all of its joints could be stretched."""
    chain, bounds = model.chain, ShapeArrays.from_model(model).bounds
    reach = np.linalg.norm(chain.offsets[:, :3, 3], axis=1)
    for link, parent in enumerate(chain.parents):
        reach[link] += reach[parent] if parent >= 0 else 0.0
    shapes = np.linalg.norm(model.Ts_link_shape[:, :3, 3], axis=1) + np.linalg.norm(bounds[:, :3], axis=1) + bounds[:, 3]
    return float((reach[model.shape_links] + shapes).max())


def _around(middle: np.ndarray, reach_m: float, camera: Camera) -> np.ndarray:
    """(u0, v0, u1, v1) pixels that hold what is within ``reach_m`` of a point, or nearly; all where it is at the camera."""
    lens, whole = camera.model, np.array([0, 0, camera.model.width, camera.model.height])
    pixels, valid = camera.project(middle[None])
    depth = float((camera.T_cam_world @ np.append(middle, 1.0))[2])
    if not valid[0] or depth <= reach_m:
        return whole
    radius = lens.params[:2].max() * reach_m / np.sqrt(depth**2 - reach_m**2)
    corners = np.concatenate([np.floor(pixels[0] - radius), np.ceil(pixels[0] + radius) + 1.0]).astype(np.int64)
    return np.clip(corners, 0, np.tile(whole[2:], 2))
