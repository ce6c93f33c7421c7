"""Fixed things in the scene that hide the body: their depth in each camera, rendered once and read pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..camera.model import CameraModel
from ..camera.rig import Camera, CameraRig
from ..compiled.kernels import compiled
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from .contour.samples import DEPTH, NU, NV, U, V
from .raycast.raycaster import render_labels, render_view
from .renderer import Region

NOTHING = np.empty((0, 0), dtype=np.float32)
_TOUCH_M = 0.01  # what comes in less than this before the body does not hide it: feet stand on floors, hands lie on tables
_AROUND_PX, _RIM_PX = 15, 3


@dataclass(frozen=True, eq=False)
class BodyRegion:
    """Where a body is in an image.

    Attributes
    ----------
    region : (u0, v0, u1, v1).
    labels : (h, w) uint8 on the region, as of `RenderedView`; 0 also where the body is hidden.
    occlusion : (h, w) bool, mask: pixels of what hides the body, and of its border; None: nothing hides it.
    every : so many pixels a side have one label.
    """

    region: Region
    labels: np.ndarray
    occlusion: np.ndarray | None = None
    every: int = 1


class Occluders:
    """Depth of fixed things in every camera.

    Parameters
    ----------
    scene : their shapes, the root at the world's origin and joints neutral; None: nothing is in the way.
    rig : cameras that do not move.

    Attributes
    ----------
    depths : per camera (h, w) float32 meters along the optical axis, infinite where nothing is; (0, 0) without a scene.
    """

    def __init__(self, scene: ArticulatedModel | None, rig: CameraRig):
        self.depths: list[np.ndarray] = [NOTHING] * len(rig)
        if scene is not None:
            configuration = Configuration(scene, State.neutral(scene))
            self.depths = [render_view(configuration, camera).depth for camera in rig]
        self._small: dict[tuple[int, int], tuple[CameraModel, CameraModel]] = {}

    def look(
        self, index: int, configuration: Configuration, camera: Camera, margin_px: int = 0, every: int = 1
    ) -> BodyRegion | None:
        """Where the body is in one camera.

        Parameters
        ----------
        index : of the camera in the rig.
        configuration : the posed body.
        camera : that camera.
        margin_px : how far around the body the region reaches.
        every : pixels a side that have one label: of a large image it is drawn in a fraction of the time.

        Returns
        -------
        The region, its labels and what is hidden; None when no part of the body is in the image.
        """
        if every > 1:
            camera = replace(camera, model=self._shrunk(index, camera.model, every))
        found = render_labels(configuration, camera, -(-margin_px // every))
        if found is None:
            return None
        (u0, v0, u1, v1), labels = found
        region, depth = (u0 * every, v0 * every, u1 * every, v1 * every), self.depths[index]
        if not depth.size:
            return BodyRegion(region, labels, every=every)
        cover = depth[every // 2 :: every, every // 2 :: every][v0:v1, u0:u1]
        body = render_view(configuration, camera, found[0]).depth
        hidden = (labels > 0) & (cover < body - _TOUCH_M)
        if not hidden.any():
            return BodyRegion(region, labels, every=every)
        labels[hidden] = 0
        # The body is not exactly where it is expected: around what is hidden, whatever stands before it may hide it
        near = _grown(hidden, -(-_AROUND_PX // every)) & (cover < body[hidden].max())
        return BodyRegion(region, labels, _grown(near, -(-_RIM_PX // every)), every)

    def _shrunk(self, index: int, lens: CameraModel, every: int) -> CameraModel:
        """A lens of every ``every``-th pixel of another one, from the middle of the first so many on."""
        known = self._small.get((index, every))
        if known is None or known[0] is not lens:
            shift = -(every // 2) / every
            to_small = np.array([[1.0 / every, 0.0, shift], [0.0, 1.0 / every, shift]])
            known = self._small[index, every] = lens, lens.mapped(to_small, lens.width // every, lens.height // every)
        return known[1]


def _grown(mask: np.ndarray, by_px: int) -> np.ndarray:
    return cv2.dilate(mask.view(np.uint8), np.ones((2 * by_px + 1,) * 2, dtype=np.uint8)) > 0


@compiled
def _is_covered(depth, u, v, nu, nv, body_depth, reach_px):
    """Whether something stands before a contour sample at (u, v), or ``reach_px`` to either side of it along its normal."""
    for side in range(-1, 2):
        column, row = int(np.floor(u + side * reach_px * nu + 0.5)), int(np.floor(v + side * reach_px * nv + 0.5))
        if 0 <= row < depth.shape[0] and 0 <= column < depth.shape[1] and depth[row, column] < body_depth - _TOUCH_M:
            return True
    return False


@compiled
def drop_covered(depth, rows, pixels, info, n, reach_px):
    """Take out the contour samples that something stands before.

    Parameters
    ----------
    depth : (h, w) of `Occluders`, meters.
    rows, pixels, info : of `collect_samples`, changed in place.
    n : how many of them are in use.
    reach_px : how far to both sides of a sample, along its normal, nothing may stand before the body.

    Returns
    -------
    int : how many are left.
    """
    left = 0
    for j in range(n):
        pixel = pixels[j]
        if _is_covered(depth, pixel[U], pixel[V], pixel[NU], pixel[NV], pixel[DEPTH], reach_px):
            continue
        if left < j:
            rows[left] = rows[j]
            pixels[left] = pixels[j]
            info[left] = info[j]
        left += 1
    return left
