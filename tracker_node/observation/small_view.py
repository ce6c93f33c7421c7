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
            if lens.distortion_model != "none":
                self._map = straight_maps(small, small.K)
            small = CameraModel(*size, small.K)
        self.camera = replace(camera, model=small)

    def shrink(self, image: np.ndarray) -> np.ndarray:
        """The small view of an image (h, w, 3) uint8 of the camera."""
        small = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)
        if self._map is not None:
            small = cv2.remap(small, self._map[0], self._map[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(small)


def straight_maps(lens: CameraModel, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Maps for ``cv2.remap`` from an image without distortion to the distorted one.

    Parameters
    ----------
    lens : of the distorted image.
    K : (3, 3) of the pinhole camera without distortion, of the same size.

    Returns
    -------
    (h, w) float32 columns and rows, far outside where the lens sees nothing.
    """
    u, v = np.meshgrid(np.arange(lens.width, dtype=float), np.arange(lens.height, dtype=float))
    pixels, seen = lens.project(np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(K).T)
    pixels[~seen] = -1e4
    return pixels[..., 0].astype(np.float32), pixels[..., 1].astype(np.float32)
