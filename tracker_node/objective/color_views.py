"""Images and rays of all cameras, flat and planar, as the color kernels read them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..camera.camera_rig import Camera, CameraRig
from ..render.ray_table import ray_table
from . import color_kernels as kernel


def is_pinhole(camera: Camera) -> bool:
    """Whether rays are linear in the pixel's column and row alone."""
    return camera.model.K[0, 1] == 0.0 and not np.any(camera.model.distortion)


class ColorViews:
    """Where the pixels and rays of every camera lie, and the pixels of one image set.

    Parameters
    ----------
    column_step : keep every n-th column.

    Attributes
    ----------
    views : (n_cameras, `kernel.N_VIEW`) int64.
    rays : (.,) float32; an undistorted camera has one row of x, and one y a row of pixels (sixteen times); others have a table.
    planes : (.,) uint8; red, green and blue of each camera.
    params, limits : (n_cameras, .), of the lenses and their rays.
    """

    def __init__(self, rig: CameraRig, column_step: int = 1):
        self.column_step = column_step
        self.views = np.zeros((len(rig), kernel.N_VIEW), dtype=np.int64)
        rays: list[np.ndarray] = []
        n_rays = n_pixels = 0
        for view, camera in zip(self.views, rig, strict=True):
            xs, ys = _rays(camera, column_step)
            height, width = camera.model.height, -(-camera.model.width // column_step)
            view[kernel.PLANES], view[kernel.XS], view[kernel.YS] = n_pixels, n_rays, n_rays + xs.size
            view[kernel.WIDTH], view[kernel.HEIGHT] = width, height
            view[kernel.STEP], view[kernel.DISTORTED] = column_step, not is_pinhole(camera)
            rays += [xs.ravel(), ys.ravel()]
            n_rays += xs.size + ys.size
            n_pixels += 3 * width * height
        self.rays = np.concatenate(rays)
        self.planes = np.zeros(n_pixels + kernel.LANES, dtype=np.uint8)  # lanes reach beyond the last pixel
        self.params = np.stack([camera.model.params for camera in rig])
        self.limits = np.stack([ray_table(camera.model).limits for camera in rig])

    def fill(self, images: Sequence[np.ndarray | None]) -> None:
        """Take in BGR images (h, w, 3) uint8, or None for a camera without one, whose pixels then are never asked for."""
        for view, image in zip(self.views, images, strict=True):
            if image is not None:
                if self.column_step > 1:
                    image = np.ascontiguousarray(image[:, :: self.column_step])
                for channel in range(3):
                    cv2.extractChannel(image, 2 - channel, self.plane(view, channel))

    def plane(self, view: np.ndarray, channel: int) -> np.ndarray:
        """(h, w) of one channel (0 is red) of the camera with this row of ``views``."""
        width, height = int(view[kernel.WIDTH]), int(view[kernel.HEIGHT])
        start = int(view[kernel.PLANES]) + channel * width * height
        return self.planes[start : start + width * height].reshape(height, width)


def _rays(camera: Camera, column_step: int) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the rays, as `ColorViews` lays them out; not a number to the right of the image."""
    model = camera.model
    width = -(-model.width // column_step)
    if is_pinhole(camera):
        xs = np.full(width + kernel.LANES, np.nan, dtype=np.float32)
        xs[:width] = (np.arange(0, model.width, column_step) - model.K[0, 2]) / model.K[0, 0]
        ys = np.repeat((np.arange(model.height) - model.K[1, 2]) / model.K[1, 1], kernel.LANES).astype(np.float32)
        return xs, ys
    table = ray_table(model)
    padded = np.full((2, model.height, width + kernel.LANES), np.nan, dtype=np.float32)
    padded[0, :, :width], padded[1, :, :width] = (t[:, : model.width : column_step] for t in (table.xs, table.ys))
    return padded[0], padded[1]
