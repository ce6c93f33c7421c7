"""Fixed things in the scene that hide the body: their depth in each camera, rendered once and read pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

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
    """

    region: Region
    labels: np.ndarray
    occlusion: np.ndarray | None = None


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

    def look(self, index: int, configuration: Configuration, camera: Camera, margin_px: int = 0) -> BodyRegion | None:
        """Where the body is in one camera.

        Parameters
        ----------
        index : of the camera in the rig.
        configuration : the posed body.
        camera : that camera.
        margin_px : how far around the body the region reaches.

        Returns
        -------
        The region, its labels and what is hidden; None when no part of the body is in the image.
        """
        found = render_labels(configuration, camera, margin_px)
        if found is None:
            return None
        (u0, v0, u1, v1), labels = found
        if not self.depths[index].size:
            return BodyRegion(found[0], labels)
        body, cover = render_view(configuration, camera, found[0]).depth, self.depths[index][v0:v1, u0:u1]
        hidden = (labels > 0) & (cover < body - _TOUCH_M)
        if not hidden.any():
            return BodyRegion(found[0], labels)
        labels[hidden] = 0
        # The body is not exactly where it is expected: around what is hidden, whatever stands before it may hide it
        near = _grown(hidden, _AROUND_PX) & (cover < body[hidden].max())
        return BodyRegion(found[0], labels, _grown(near, _RIM_PX))


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
