"""Poses scored by the colors that they cover, in the images of a `RegionModality`.

What correspondence lines cannot tell from afar, the area of a limb does: whether the pixels that it would cover are of its colors
rather than the background's, and not better explained by another part of the body that it would hide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.area.maps import fill_log_ratios
from ...objective.area.score import AreaScore
from ...objective.lines.correspondences import View
from ...parallel import Workers
from ...render.shape_arrays import ShapeArrays
from ..config import TrackerConfig
from ..poses import Poses
from .modality import RegionModality

_BODY_CELLS = 90.0  # across the body, in the small images in which limbs are searched
_CELLS = 2  # across, of the pixels of a cell that are read


class RegionArea:
    """Scores poses in the present images; these are shrunk when they are first asked for.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    region : has the images and the colors.
    workers : threads that share poses or cameras.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, region: RegionModality, workers: Workers):
        self._rig, self._model, self._region, self._workers = rig, model, region, workers
        self._shadow, self._max_log_ratio = config.background.shadow, np.float32(config.region.max_log_ratio)
        self._reach_m = longest_reach(model)
        self._cell_px = 0
        self._score: AreaScore | None = None
        self._views: Sequence[View | None] | None = None

    def gains(self, poses: Poses, shapes: np.ndarray) -> np.ndarray:
        """Log-likelihood that the colors of all cameras gain by some parts, and the cells in which they show.

        Parameters
        ----------
        poses : n poses.
        shapes : (n_shapes,) mask of the parts; the rest of the body is where the first pose has it.

        Returns
        -------
        (n, 2)
        """
        if self._views is not self._region.views:
            self._views, state = self._region.views, poses.state(0)
            self.set_views(self._views, state, max(1, round(self._region.size_px(state) / _BODY_CELLS)))
        assert self._score is not None
        return self._score.totals(poses.roots, poses.joints, shapes).sum(axis=1)

    def set_views(self, views: Sequence[View | None], state: State, cell_px: int) -> None:
        """Take what the cameras show around a body.

        Parameters
        ----------
        views : by camera.
        state : where the body is, or nearly.
        cell_px : so many pixels, across and down, become one.
        """
        if cell_px != self._cell_px or self._score is None:
            self._cell_px = cell_px
            lenses = [c.model.resized(max(c.model.width // cell_px, 1), max(c.model.height // cell_px, 1)) for c in self._rig]
            cameras = [replace(camera, model=lens) for camera, lens in zip(self._rig, lenses, strict=True)]
            self._score = AreaScore(self._model, cameras, self._workers)
        small, root = self._score.cameras, state.T_world_root[:3, 3]
        maps: list[np.ndarray | None] = [None] * len(views)

        def run(i: int) -> None:
            view, lens = views[i], small[i].model
            assert view is not None
            body, scene = view.densities
            own = np.zeros((len(body), lens.height, lens.width), dtype=np.float32)
            log_body = np.ascontiguousarray(np.log(body.T))
            step, box = max(1, cell_px // _CELLS), pixels_around(root, self._reach_m, small[i])
            fill_log_ratios(
                view.bgr, log_body, scene, view.room, view.silhouette, view.neighbors, self._shadow, step, self._max_log_ratio,
                box, own,
            )  # fmt: skip
            maps[i] = own

        self._workers.map(run, [i for i, view in enumerate(views) if view is not None])
        self._score.set_maps(maps, self._region.appearance.classes)


def longest_reach(model: ArticulatedModel) -> float:
    """How far (m) from its root a body could reach if all of its joints could be stretched."""
    chain, bounds = model.chain, ShapeArrays.from_model(model).bounds
    reach = np.linalg.norm(chain.offsets[:, :3, 3], axis=1)
    for link, parent in enumerate(chain.parents):
        reach[link] += reach[parent] if parent >= 0 else 0.0
    shapes = np.linalg.norm(model.Ts_link_shape[:, :3, 3], axis=1) + np.linalg.norm(bounds[:, :3], axis=1) + bounds[:, 3]
    return float((reach[model.shape_links] + shapes).max())


def pixels_around(middle: np.ndarray, reach_m: float, camera: Camera) -> np.ndarray:
    """What part of an image shows the surroundings of a point, or nearly; all where the point is at the camera.

    Parameters
    ----------
    middle : (3,) meters, world.
    reach_m : meters around it.
    camera : of the image.

    Returns
    -------
    (u0, v0, u1, v1) pixels.
    """
    lens, whole = camera.model, np.array([0, 0, camera.model.width, camera.model.height])
    pixels, valid = camera.project(middle[None])
    depth = float((camera.T_cam_world @ np.append(middle, 1.0))[2])
    if not valid[0] or depth <= reach_m:
        return whole
    radius = lens.params[:2].max() * reach_m / np.sqrt(depth**2 - reach_m**2)
    corners = np.concatenate([np.floor(pixels[0] - radius), np.ceil(pixels[0] + radius) + 1.0]).astype(np.int64)
    return np.clip(corners, 0, np.tile(whole[2:], 2))
