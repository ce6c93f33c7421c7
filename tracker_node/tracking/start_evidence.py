"""What speaks for a body in the first images: differences from the empty scene, and colors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..camera.camera_rig import Camera
from ..observation.appearance import ColorModel, SceneModel, body_log_odds

_SIGMA = 6.0  # grey levels that a pixel of the small empty scene varies by
_SHADOW = 0.4
_REACH = 3.0  # log-odds are not believed beyond


class StartEvidence:
    """Maps of log-odds, one a camera.

    Parameters
    ----------
    cameras : the small cameras. plates : camera name -> small images of the empty scene.
    """

    def __init__(self, cameras: Sequence[Camera], plates: Mapping[str, list[np.ndarray]]):
        self._cameras = tuple(cameras)
        self._scenes = [SceneModel.from_images(plates[c.name], _SIGMA) if c.name in plates else None for c in cameras]
        self.reset()

    def reset(self) -> None:
        """Forget all images."""
        self._images: list[np.ndarray | None] = [None] * len(self._cameras)
        self._colors = [ColorModel() for _ in self._cameras]

    def watch(self, images: Sequence[np.ndarray | None]) -> None:
        """Take in the small images of a set."""
        self._images = list(images)

    def maps(self) -> list[np.ndarray | None]:
        """Log-odds (h, w) float32 of the latest images."""
        result: list[np.ndarray | None] = []
        for image, scene, colors in zip(self._images, self._scenes, self._colors, strict=True):
            if image is None:
                result.append(None)
            else:
                whole = (0, 0, image.shape[1], image.shape[0])
                result.append(body_log_odds(image, whole, scene, colors, _SHADOW, _REACH))
        return result
