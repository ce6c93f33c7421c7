"""Cameras and their images made small and straight, for looking at all of an image in little time."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..camera.model import CameraModel
from ..camera.rig import Camera

_STRAIGHT = ("none", "plumb_bob", "rational_polynomial")  # a fisheye's image does not fit on a plane


class SmallView:
    """A camera on ``scale`` times the pixels, without distortion where that is possible.

    Attributes
    ----------
    camera : the small camera.
    """

    def __init__(self, camera: Camera, scale: float):
        lens = camera.model
        size = max(8, round(lens.width * scale)), max(8, round(lens.height * scale))
        small = lens.resized(*size)
        self._size, self._map = size, None
        if lens.distortion_model in _STRAIGHT:
            straight = CameraModel(*size, small.K)
            if lens.distortion_model != "none":
                self._map = _pull_through(straight, small)
            small = straight
        self.camera = replace(camera, model=small)

    def shrink(self, image: np.ndarray) -> np.ndarray:
        """The small view of an image (h, w, 3) uint8 of the camera."""
        small = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)
        if self._map is not None:
            small = cv2.remap(small, self._map[0], self._map[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(small)


def _pull_through(straight: CameraModel, bent: CameraModel) -> tuple[np.ndarray, np.ndarray]:
    """Where in ``bent`` each pixel of ``straight`` is, (h, w) float32 each."""
    u, v = np.meshgrid(np.arange(straight.width, dtype=np.float64), np.arange(straight.height, dtype=np.float64))
    rays, _ = straight.rays(np.stack([u, v], axis=-1))
    pixels, valid = bent.project(rays)
    pixels[~valid] = -1.0
    return pixels[..., 0].astype(np.float32), pixels[..., 1].astype(np.float32)
