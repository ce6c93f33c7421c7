"""The background behind a body, as correspondence lines read it: four bytes per pixel, in one place of memory.

A pixel is its mean color and one byte for its variance: 0 where the background has not been seen, else 1 + the steps of three
per cent by which the variance is above the least.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba as nb
import numpy as np

from ..appearance import SEEN, Region, SceneModel, grown
from ..appearance_kernels import log_positive

LOG_STEP = math.log(1.03)  # of the variance, from one value of its byte to the next

_SEEN = np.uint8(SEEN)
_HALF, _ONE, _ONE_AND_HALF, _LAST = np.float32(0.5), np.float32(1.0), np.float32(1.5), np.float32(255.0)
_8, _16, _24 = np.uint32(8), np.uint32(16), np.uint32(24)

PackedRoom = tuple[np.ndarray, float]  # pixels (h, w) uint32 (blue lowest, the variance's byte highest), and the least variance
NO_ROOM: PackedRoom = np.zeros((0, 0), np.uint32), 1.0


class RegionBackground:
    """Background of one camera that stands still: from its images, or learned while the body moves.

    Parameters
    ----------
    backgrounds : BGR images of the empty scene; there may be none.
    sigma : least standard deviation of a pixel, gray levels.
    rate : weight of the newest image; 0: once known, the background stays.
    margin_px : width around the body that is not learned.

    Attributes
    ----------
    packed : for the kernels.
    """

    def __init__(self, backgrounds: Sequence[np.ndarray], sigma: float, rate: float, margin_px: int):
        self._sigma, self._rate, self._margin_px = sigma, rate, margin_px
        self._scene = SceneModel.from_images(list(backgrounds), sigma) if backgrounds else None
        self.packed = NO_ROOM
        if self._scene is not None:
            self._pack((0, 0, self._scene.known.shape[1], self._scene.known.shape[0]))

    def learn(self, bgr: np.ndarray, region: Region, labels: np.ndarray) -> None:
        """Take in an image; of the first all of it, of later ones the region.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1).
        labels : (h, w) uint8 on the region, 0 beside the body.
        """
        near = grown(labels, self._margin_px)
        if self._scene is None:
            self._scene = SceneModel(bgr.shape[0], bgr.shape[1], self._sigma)
            body = np.zeros(bgr.shape[:2], dtype=np.uint8)
            body[region[1] : region[3], region[0] : region[2]] = near
            self._scene.learn_first(bgr, body)
            self._pack((0, 0, bgr.shape[1], bgr.shape[0]))
        elif self._rate > 0.0:
            self._scene.update(bgr, near, self._rate, region)
            self._pack(region)

    def _pack(self, region: Region) -> None:
        scene = self._scene
        assert scene is not None
        if not self.packed[0].size:
            self.packed = np.zeros(scene.known.shape, dtype=np.uint32), float(scene.floor)
        _pack(scene.mean, scene.variance, scene.known, region, np.float32(1.0 / scene.floor), self.packed[0])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _pack(mean, variance, known, region, per_least, pixels):
    u0, v0, u1, v1 = region
    codes, per_step = np.zeros(u1 - u0, dtype=np.uint32), np.float32(1.0 / LOG_STEP)
    for i in range(v0, v1):
        for k in range(np.uint64(codes.size)):  # by itself, for the sake of vectors
            steps = log_positive(max(variance[i, np.uint64(u0) + k] * per_least, _ONE)) * per_step
            codes[k] = np.uint32(min(steps + _ONE_AND_HALF, _LAST))
        for j in range(np.uint64(u0), np.uint64(u1)):
            b, g, r = mean[i, j, 0] + _HALF, mean[i, j, 1] + _HALF, mean[i, j, 2] + _HALF
            color = np.uint32(b) | (np.uint32(g) << _8) | (np.uint32(r) << _16)
            pixels[i, j] = color | (codes[j - np.uint64(u0)] << _24) if known[i, j] == _SEEN else np.uint32(0)
