"""Colors of a body whose place is roughly known, in images of a scene that nobody has seen empty.

First what moves within an upright ellipse is taken for the body, then what has its colors there; and the cameras have to agree: a
pixel that looks at nothing that the others take for the body as well is not believed.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...camera.rig import Camera
from ...model.configuration import Configuration
from ...objective.area.visual_hull import Volume, occupancy, seen_from
from ...render.raycast.raycaster import render_mask
from .evidence import StartEvidence

_SLIM = 0.3  # how wide a standing body is for its height
_RING_PX = 14  # around a body in which the colors of its surroundings are learned
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
_FINE_VOXELS = 20  # along the body, where cameras are to agree
_FIRM, _HALF_SEEN = 6.0, 0.55  # log-odds by how likely a pixel sees a point that all cameras take for the body
_LEAST, _MOST = 2.0, 0.1  # what a pixel can lose and win by that
_REFINEMENTS = 3


class StartSegmentation:
    """Learns the colors of ``evidence`` for a body of ``size_m``."""

    def __init__(self, evidence: StartEvidence, cameras: Sequence[Camera], size_m: float):
        self._evidence, self._cameras, self.size_m = evidence, tuple(cameras), size_m

    def learn_about(self, middle: np.ndarray) -> None:
        """Begin anew, with a body about ``middle`` (3,)."""
        self._evidence.forget_colors()
        self._evidence.learn(*self._likely(middle))
        for _ in range(_REFINEMENTS):
            self._agree(middle)
            self._evidence.learn(*self._segmented(middle))
        self._agree(middle)

    def learn_from(self, body: Configuration, middle: np.ndarray) -> None:
        """Go on with a body that has been found.

        Parameters
        ----------
        body : in its state.
        middle : (3,) of the body, world.
        """
        self._evidence.learn(*self._covered(body))
        self._agree(middle)

    def _likely(self, middle: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Weights (h, w) of each camera's pixels as those of a body about ``middle``, and as what is around it."""
        inside, around = [], []
        for camera, moved in zip(self._cameras, self._evidence.maps(), strict=True):
            along, across = self._ellipse(camera, middle)
            near = along**2 + across**2
            changed = np.ones(near.shape) if moved is None else 0.05 + 0.95 * (moved > 0.0)
            inside.append(np.exp(-0.5 * near / 0.6**2) * changed)
            around.append(((near > 1.5) & (np.abs(along) < 1.6) & (np.abs(across) < 5.0)).astype(np.float64))
        return inside, around

    def _agree(self, middle: np.ndarray) -> None:
        """Let the cameras agree: where what one takes for the body is not confirmed by the others, its log-odds sink."""
        evidence = self._evidence
        evidence.support = [None] * len(self._cameras)
        step = self.size_m / _FINE_VOXELS
        count = round(1.4 * _FINE_VOXELS)
        volume = Volume(middle - 0.5 * step * (count - 1), step, (count, count, count))
        maps = evidence.maps()
        occupied = occupancy(volume, self._cameras, maps, 2)
        evidence.support = [
            None if odds is None else np.clip(_FIRM * (seen_from(camera, volume, occupied) - _HALF_SEEN), -_LEAST, _MOST)
            for camera, odds in zip(self._cameras, maps, strict=True)
        ]

    def _segmented(self, middle: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """The same once there are colors: by what they say, more loosely by the place."""
        inside, around = [], []
        for camera, odds in zip(self._cameras, self._evidence.maps(), strict=True):
            along, across = self._ellipse(camera, middle)
            near = np.exp(-0.5 * (along**2 + (0.5 * across) ** 2) / 0.8**2)
            likely = np.zeros(near.shape) if odds is None else 1.0 / (1.0 + np.exp(-4.0 * (odds - 0.5)))
            inside.append(near * likely)
            around.append((1.0 - near * likely) * ((np.abs(along) < 2.0) & (np.abs(across) < 6.0)))
        return inside, around

    def _ellipse(self, camera: Camera, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (h, w) along and across an upright body about ``middle``: 1 at its ends and sides."""
        ends, _ = camera.project(np.stack([middle, middle + np.array([0.0, 0.0, 0.5 * self.size_m])]))
        axis = ends[1] - ends[0]
        length = max(float(np.linalg.norm(axis)), 2.0)
        axis = axis / length
        u, v = np.meshgrid(np.arange(camera.model.width) - ends[0, 0], np.arange(camera.model.height) - ends[0, 1])
        return (u * axis[0] + v * axis[1]) / length, (v * axis[0] - u * axis[1]) / (_SLIM * length)

    def _covered(self, body: Configuration) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """The same of a posed body."""
        inside, around = [], []
        for camera in self._cameras:
            mask = (render_mask(body, camera) > 0).astype(np.uint8)
            wide = cv2.dilate(mask, np.ones((2 * _RING_PX + 1, 2 * _RING_PX + 1), np.uint8))
            inside.append(cv2.erode(mask, _CROSS).astype(np.float64))
            around.append((wide - cv2.dilate(mask, np.ones((5, 5), np.uint8))).astype(np.float64))
        return inside, around
