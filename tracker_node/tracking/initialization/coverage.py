"""What a start leaves unexplained: pixels that are surely of the body, and lie beside it.

The engine asks whether contours are found where a state has them. An arm that lies on the contour of the trunk has some, and the
true arm beside it is asked for by nobody.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...render.raycast.raycaster import render_mask

_EDGE = np.ones((3, 3), np.uint8)  # the model is not the body to the pixel
_NEAR = np.ones((25, 25), np.uint8)  # what is farther from the body, of some eighty pixels, may be another's


class StartCoverage:
    """Compares states with masks (h, w) of what is ``sure``, one a camera of that size; None for a camera that says nothing."""

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], sure: Sequence[np.ndarray | None]):
        self._model, self._cameras, self._sure = model, tuple(cameras), list(sure)

    def uncovered(self, state: State) -> float:
        """What is surely of the body but beside ``state``, as a share of the pixels that this covers in the same images."""
        body, beside, covered = Configuration(self._model, state), 0, 0
        for camera, sure in zip(self._cameras, self._sure, strict=True):
            if sure is None:
                continue
            mask = (render_mask(body, camera) > 0).astype(np.uint8)
            near = (cv2.dilate(mask, _NEAR) > 0) & (cv2.dilate(mask, _EDGE) == 0)
            beside, covered = beside + int((sure & near).sum()), covered + int(mask.sum())
        return beside / max(covered, 1)
