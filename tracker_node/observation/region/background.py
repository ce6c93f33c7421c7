"""The background behind a body, as correspondence lines read it: four bytes per pixel, in one place of memory.

A pixel is its mean color and one byte for its variance: 0 where the background has not been seen, else 1 + the steps of three
per cent by which the variance is above the least.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...compiled.kernels import compiled
from ..appearance import AT_ONCE, SEEN, Region, SceneModel, grown
from ..appearance_kernels import log_positive

LOG_STEP = math.log(1.03)  # of the variance, from one value of its byte to the next
WAY_PX = 24.0  # that the body goes until a pixel that has stayed as it was is proven to be background
_EARLY_PX, _LATER_PX = 2.0 * WAY_PX, 100.0  # after so long a way the whole image is looked at less often: after so much more
_STEP_PX = 2.0  # less is noise of the fit, which does not add up to a way
_MOVES, _STANDS = 0.8, 0.9  # fractions of the surroundings that stay, below and above which they move with the body, or do not
_MEMORY, _AT_FIRST = 0.8, 500.0  # weight of what was counted before; pixels that are taken to stay before any is counted

_SEEN, _PROVEN, _GIVEN = np.uint8(SEEN), np.uint8(1), np.uint8(2)
_HALF, _ONE, _ONE_AND_HALF, _LAST = np.float32(0.5), np.float32(1.0), np.float32(1.5), np.float32(255.0)
_FAR, _SAME = np.float32(36.0), np.float32(9.0)  # squared sigmas beyond which a pixel shows something else, or has not stayed
_FIRST, _THIRD, _WAY = np.float32(4.0), np.float32(1.0 / 3.0), np.float32(WAY_PX)  # ``_FIRST``: of the least variance
_8, _16, _24 = np.uint32(8), np.uint32(16), np.uint32(24)

PackedRoom = tuple[np.ndarray, float]  # pixels (h, w) uint32 (blue lowest, the variance's byte highest), and the least variance
NO_ROOM: PackedRoom = np.zeros((0, 0), np.uint32), 1.0


class RegionBackground:
    """Background of one camera that stands still: from its images, or learned while the body moves.

    What goes with the body (a table on which it is carried, a shadow) looks like background as long as the body rests. So a pixel
    is proven to be background by staying as it was while the body goes `WAY_PX`. Of the surroundings that stand still most
    pixels do, and all that have been seen count; where many do not, those count that are proven, until they change. Pixels of
    images of the empty scene always count.

    Parameters
    ----------
    backgrounds : BGR images of the empty scene; there may be none.
    sigma : least standard deviation of a pixel, gray levels.
    rate : weight of the newest image; 0: what is known is not followed.
    margin_px : width around the body that is not learned.

    Attributes
    ----------
    packed : for the kernels.
    """

    def __init__(self, backgrounds: Sequence[np.ndarray], sigma: float, rate: float, margin_px: int):
        self._sigma, self._rate, self._margin_px = sigma, rate, margin_px
        self._way, self._look_at_px = _Way(), 0.0
        self._stayed, self._changed, self._moves = 0.0, 0.0, False
        self._scene: SceneModel | None = None
        self._turn = 0
        self.packed = NO_ROOM
        if backgrounds:
            self._begin(SceneModel.from_images(list(backgrounds), sigma))
            self._pack(self._all)

    def _begin(self, scene: SceneModel) -> SceneModel:
        self._scene, self._all = scene, (0, 0, scene.known.shape[1], scene.known.shape[0])
        self._proofs = np.where(scene.known == SEEN, _GIVEN, 0).astype(np.uint8)
        self._kept, self._kept_at_px = np.zeros(scene.mean.shape, np.uint8), np.zeros(scene.known.shape, np.float32)
        return scene

    def learn(self, bgr: np.ndarray, region: Region, labels: np.ndarray, places: np.ndarray) -> None:
        """Take in the region of an image; all of it at first, and whenever the body has gone far. Of a large one rows take turns.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1).
        labels : (h, w) uint8 on the region, 0 beside the body.
        places : (n, 2) pixels of points of the body, the same in every image; those that are not finite do not count.
        """
        first = self._scene is None
        scene = self._scene or self._begin(SceneModel(bgr.shape[0], bgr.shape[1], self._sigma))
        near, way_px, around = grown(labels, self._margin_px), self._way.to(places), region
        everywhere = way_px >= self._look_at_px
        if everywhere:
            body = np.zeros(bgr.shape[:2], dtype=np.uint8)
            body[region[1] : region[3], region[0] : region[2]] = near
            near, region = body, self._all
            self._look_at_px = way_px + (WAY_PX if way_px < _EARLY_PX else _LATER_PX)
        every = 1 if first else -(-(region[2] - region[0]) * (region[3] - region[1]) // AT_ONCE)  # rows take turns
        self._turn += 1
        rows, rate = (self._turn % every, every), np.float32(1.0 - (1.0 - self._rate) ** every if every > 1 else self._rate)
        stayed, changed = _learn(
            bgr, region, rows, around, near, scene.mean, scene.variance, scene.known, self._proofs, self._kept, self._kept_at_px,
            np.float32(way_px), rate, scene.floor, self._moves, not everywhere or self._moves,
        )  # fmt: skip
        if self._turned(stayed, changed):
            self._pack(self._all)
        else:
            self._pack(region, rows)

    def _turned(self, stayed: int, changed: int) -> bool:
        """Whether the surroundings have turned out to move, or to stand still after all; by counts of pixels near the body."""
        self._stayed, self._changed = _MEMORY * self._stayed + stayed, _MEMORY * self._changed + changed
        share, moved = (self._stayed + _AT_FIRST) / (self._stayed + self._changed + _AT_FIRST), self._moves
        self._moves = share < (_STANDS if moved else _MOVES)
        if self._moves and not moved:
            self._proofs[self._proofs == _PROVEN] = 0
        return self._moves != moved

    def _pack(self, region: Region, rows: tuple[int, int] = (0, 1)) -> None:
        scene = self._scene
        assert scene is not None
        if not self.packed[0].size:
            self.packed = np.zeros(scene.known.shape, dtype=np.uint32), float(scene.floor)
        trusted = self._proofs if self._moves else scene.known
        _pack(scene.mean, scene.variance, trusted, region, rows, np.float32(1.0 / scene.floor), self.packed[0])


class _Way:
    """How far a body has gone in the image, in steps that are no noise."""

    def __init__(self) -> None:
        self._length_px, self._from = 0.0, np.zeros((0, 2))

    def to(self, places: np.ndarray) -> float:
        """Length of the way to where the body is now.

        Parameters
        ----------
        places : (n, 2) pixels, see `RegionBackground.learn`.

        Returns
        -------
        Pixels: the mean of its points, step by step.
        """
        if self._from.shape != places.shape:
            self._from = places
        steps = np.linalg.norm(places - self._from, axis=1)
        steps = steps[np.isfinite(steps)]
        step = float(steps.mean()) if steps.size else 0.0
        if step >= _STEP_PX or not steps.size:
            self._length_px, self._from = self._length_px + step, places
        return self._length_px


@compiled
def _learn(bgr, region, rows, around, near, mean, variance, known, proofs, kept, kept_at, way, rate, floor, moves, follow):
    """Take in the pixels of a region that are not near the body; how many ``around`` it have stayed, and how many have not.

    ``rows``: the first one, and how far to the next.
    """
    u0, v0, u1, v1 = region
    n_stayed, n_changed = 0, 0
    for v in range(v0 + rows[0], v1, rows[1]):
        for u in range(u0, u1):
            if near[v - v0, u - u0] != 0:
                continue
            is_near = around[0] <= u < around[2] and around[1] <= v < around[3]
            b, g, r = np.float32(bgr[v, u, 0]), np.float32(bgr[v, u, 1]), np.float32(bgr[v, u, 2])
            db, dg, dr = b - mean[v, u, 0], g - mean[v, u, 1], r - mean[v, u, 2]
            off, given, first = db * db + dg * dg + dr * dr, proofs[v, u] == _GIVEN, known[v, u] != _SEEN
            as_before = off <= _FAR * variance[v, u]
            if not (given or first or as_before):
                proofs[v, u] = 0
                n_changed += moves and is_near  # else it may be an arm that is elsewhere: it is asked once the body has gone
            if first or (moves and not given and not as_before):
                mean[v, u, 0], mean[v, u, 1], mean[v, u, 2] = b, g, r
                variance[v, u], known[v, u], kept_at[v, u] = _FIRST * floor if follow else floor, _SEEN, way
                kept[v, u, 0], kept[v, u, 1], kept[v, u, 2] = bgr[v, u, 0], bgr[v, u, 1], bgr[v, u, 2]
                continue
            if as_before and follow:  # else something passes by
                mean[v, u, 0] += rate * db
                mean[v, u, 1] += rate * dg
                mean[v, u, 2] += rate * dr
                variance[v, u] = max(variance[v, u] + rate * (off * _THIRD - variance[v, u]), floor)
            if not given and way - kept_at[v, u] >= _WAY:
                db, dg, dr = b - np.float32(kept[v, u, 0]), g - np.float32(kept[v, u, 1]), r - np.float32(kept[v, u, 2])
                same = db * db + dg * dg + dr * dr <= _SAME * max(variance[v, u], _FIRST * floor)
                proofs[v, u], kept_at[v, u] = _PROVEN if same else 0, way
                n_stayed += same and is_near
                n_changed += is_near and not same
                kept[v, u, 0], kept[v, u, 1], kept[v, u, 2] = bgr[v, u, 0], bgr[v, u, 1], bgr[v, u, 2]
    return n_stayed, n_changed


@compiled
def _pack(mean, variance, trusted, region, rows, per_least, pixels):
    u0, v0, u1, v1 = region
    codes, per_step = np.zeros(u1 - u0, dtype=np.uint32), np.float32(1.0 / LOG_STEP)
    for i in range(v0 + rows[0], v1, rows[1]):
        for k in range(np.uint64(codes.size)):  # by itself, for the sake of vectors
            steps = log_positive(max(variance[i, np.uint64(u0) + k] * per_least, _ONE)) * per_step
            codes[k] = np.uint32(min(steps + _ONE_AND_HALF, _LAST))
        for j in range(np.uint64(u0), np.uint64(u1)):
            b, g, r = mean[i, j, 0] + _HALF, mean[i, j, 1] + _HALF, mean[i, j, 2] + _HALF
            color = np.uint32(b) | (np.uint32(g) << _8) | (np.uint32(r) << _16)
            pixels[i, j] = color | (codes[j - np.uint64(u0)] << _24) if trusted[i, j] != 0 else np.uint32(0)
