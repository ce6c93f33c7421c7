"""The target seen through the mask: what an image has where the drawn body lies, black elsewhere (Trewartha et al., Fig. 10).

A body that is where it should be shows itself and nothing of its surroundings.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...camera.rig import Camera
from ...model.configuration import Configuration
from ..raycast.raycaster import render_mask


def target_through_mask(bgr: np.ndarray, configuration: Configuration, camera: Camera) -> np.ndarray:
    """A copy of an image, black where the body is not.

    Parameters
    ----------
    bgr : (height, width, 3) uint8, as large as the camera's images.

    Raises
    ------
    ValueError : an image that is not as large as the camera's.
    """
    if bgr.shape != (camera.model.height, camera.model.width, 3) or bgr.dtype != np.uint8:
        expected = f"uint8 ({camera.model.height}, {camera.model.width}, 3) for camera '{camera.name}'"
        raise ValueError(f"expected an image of {expected}, got {bgr.dtype} {bgr.shape}")
    seen = np.zeros(bgr.shape, dtype=np.uint8)
    cv2.copyTo(np.ascontiguousarray(bgr), render_mask(configuration, camera), seen)
    return seen
