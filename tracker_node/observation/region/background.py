"""The background behind a body, as correspondence lines read it: four bytes per pixel, in one place of memory.

A pixel is its mean color and one byte for its variance: 0 where the background has not been seen, else 1 + the steps of three
per cent by which the variance is above the least.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...compiled.kernels import compiled
from ..appearance import AT_ONCE, SEEN, Region, SceneModel, bin_of, cells_near
from ..appearance_kernels import log_positive

LOG_STEP = math.log(1.03)  # of the variance, from one value of its byte to the next
WAY_PX = 24.0  # that the body goes until a pixel that has stayed as it was is proven to be background
_EARLY_PX, _LATER_PX = 2.0 * WAY_PX, 100.0  # after so long a way the whole image is looked at less often: after so much more
_LINES = 480.0  # of an image, to which these ways to the next look belong
_STEP_PX = 2.0  # less is noise of the fit, which does not add up to a way
_MOVES, _STANDS = 0.8, 0.9  # fractions of the surroundings that stay, below and above which they move with the body, or do not
_MEMORY, _AT_FIRST = 0.8, 500.0  # weight of what was counted before; pixels that are taken to stay before any is counted

_SEEN, _PROVEN, _GIVEN = np.uint8(SEEN), np.uint8(1), np.uint8(2)
_HALF, _ONE, _ONE_AND_HALF, _LAST = np.float32(0.5), np.float32(1.0), np.float32(1.5), np.float32(255.0)
_FAR, _SAME = np.float32(36.0), np.float32(9.0)  # squared sigmas beyond which a pixel shows something else, or has not stayed
_FIRST, _THIRD, _WAY = np.float32(4.0), np.float32(1.0 / 3.0), np.float32(WAY_PX)  # ``_FIRST``: of the least variance
_8, _16, _24, _UNKNOWN = np.uint32(8), np.uint32(16), np.uint32(24), np.uint32(0)
_1, _2, _3, _NOTHING = np.uint64(1), np.uint64(2), np.uint64(3), np.float32(0.0)

PackedRoom = tuple[np.ndarray, float]  # pixels (h, w) uint32 (blue lowest, the variance's byte highest), and the least variance
NO_COLORS = np.zeros(0, dtype=np.bool_)
NO_ROOM: PackedRoom = np.zeros((0, 0), np.uint32), 1.0


class RegionBackground:
    """Background of one camera that stands still: from its images, or learned while the body moves.

    What goes with the body (a table on which it is carried, a shadow) looks like background as long as the body rests. So a pixel
    is proven to be background by staying as it was while the body goes `WAY_PX`. Of the surroundings that stand still most
    pixels do, and all that have been seen count; where many do not, those count that are proven, until they change. Pixels of
    images of the empty scene always count. A part that may be anywhere is not learned: pixels that have its colors are left out.

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
        self._means = scene.mean.reshape(len(scene.mean), -1)  # rows of interleaved colors
        self._kept, self._kept_at_px = np.zeros(self._means.shape, np.uint8), np.zeros(scene.known.shape, np.float32)
        return scene

    def learn(
        self, bgr: np.ndarray, region: Region, labels: np.ndarray, places: np.ndarray, every: int = 1,
        doubted: np.ndarray = NO_COLORS,
    ) -> None:  # fmt: skip
        """Take in the region of an image; all of it at first, and whenever the body has gone far. Of a large one rows take turns.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1).
        labels : (h, w) uint8 on the region, 0 beside the body.
        places : (n, 2) pixels of points of the body, the same in every image; those that are not finite do not count.
        every : so many pixels a side have one label.
        doubted : (`N_COLORS`,) bool, colors of parts that may be anywhere: pixels of them are not taken in; empty: none.
        """
        first = self._scene is None
        scene = self._scene or self._begin(SceneModel(bgr.shape[0], bgr.shape[1], self._sigma))
        (near, cell), way_px, around = cells_near(labels, self._margin_px, every), self._way.to(places), region
        everywhere = way_px >= self._look_at_px
        if everywhere:
            region, zoom = self._all, max(1.0, len(bgr) / _LINES)
            self._look_at_px = way_px + zoom * (WAY_PX if way_px < zoom * _EARLY_PX else _LATER_PX)
        turns = 1 if first else -(-(region[2] - region[0]) * (region[3] - region[1]) // AT_ONCE)  # of rows
        self._turn += 1
        rows, rate = (self._turn % turns, turns), np.float32(1.0 - (1.0 - self._rate) ** turns if turns > 1 else self._rate)
        stayed, changed = _learn(
            np.ascontiguousarray(bgr).reshape(len(bgr), -1), region, rows, around, near, cell,
            self._means, scene.variance, scene.known, self._proofs, self._kept, self._kept_at_px,
            np.float32(way_px), rate, scene.floor, self._moves, not everywhere or self._moves, doubted,
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
        _pack(self._means, scene.variance, trusted, region, rows, np.float32(1.0 / scene.floor), self.packed[0])


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
def _learn(
    bgr, region, rows, around, near, cell, mean, variance, known, proofs, kept, kept_at, way, rate, floor, moves, follow, doubted
):  # fmt: skip
    """Take in the pixels of a region that are not near the body; how many ``around`` it have stayed, and how many have not.

    ``rows``: the first one, and how far to the next. ``near``: on ``around``, one value for ``cell`` pixels a side. Pixels of
    ``doubted`` colors are left as they are. Images have rows of interleaved colors.
    """
    u0, v0, u1, v1 = region
    n = u1 - u0
    free, special, off, stays = np.zeros(n, np.uint8), np.zeros(n, np.uint8), np.empty(n, np.float32), np.zeros(n, np.bool_)
    share, colors = rate if follow else _NOTHING, slice(3 * u0, 3 * u1)
    n_stayed, n_changed = 0, 0
    for v in range(v0 + rows[0], v1, rows[1]):
        free[:] = 1
        if around[1] <= v < around[3]:
            _block_row(near[(v - around[1]) // cell], cell, around[0] - u0, around[2] - u0, free)
        for k in range(n if doubted.size else 0):
            b = 3 * (u0 + k)
            if doubted[bin_of(bgr[v, b], bgr[v, b + 1], bgr[v, b + 2])]:
                free[k] = 0
        n_special = _follow_row(
            bgr[v, colors], free, known[v, u0:u1], proofs[v, u0:u1], kept_at[v, u0:u1], way, share, floor,
            mean[v, colors], variance[v, u0:u1], off, stays, special,
        )  # fmt: skip
        if n_special == 0:
            continue
        for k in range(n):
            if special[k] == 0:
                continue
            u = u0 + k
            is_near = around[0] <= u < around[2] and around[1] <= v < around[3]
            given, first = proofs[v, u] == _GIVEN, known[v, u] != _SEEN
            if not (given or first or stays[k]):
                proofs[v, u] = 0
                n_changed += moves and is_near  # else it may be an arm that is elsewhere: it is asked once the body has gone
            if first or (moves and not given and not stays[k]):
                for c in range(3):
                    kept[v, 3 * u + c], mean[v, 3 * u + c] = bgr[v, 3 * u + c], np.float32(bgr[v, 3 * u + c])
                variance[v, u], known[v, u], kept_at[v, u] = _FIRST * floor if follow else floor, _SEEN, way
            elif not given and way - kept_at[v, u] >= _WAY:
                square = _NOTHING
                for c in range(3):
                    change = np.float32(bgr[v, 3 * u + c]) - np.float32(kept[v, 3 * u + c])
                    square += change * change
                    kept[v, 3 * u + c] = bgr[v, 3 * u + c]
                same = square <= _SAME * max(variance[v, u], _FIRST * floor)
                proofs[v, u], kept_at[v, u] = _PROVEN if same else 0, way
                n_stayed += same and is_near
                n_changed += is_near and not same
    return n_stayed, n_changed


@compiled
def _block_row(near, cell, first, end, free):
    """Take out of a row what is near the body, in the columns from ``first`` on, before ``end``."""
    for i in range(near.size):
        if near[i] != 0:
            for k in range(max(first + i * cell, 0), min(first + (i + 1) * cell, end, free.size)):
                free[k] = 0


@compiled
def _follow_row(bgr, free, known, proofs, kept_at, way, share, floor, mean, variance, off, stays, special):
    """Follow what ``stays`` as it was; how many pixels need more than that, the ``special`` ones. By itself, for vectors' sake.

    ``off``: squared distance to the mean before.
    """
    n_special = 0
    for k in range(np.uint64(off.size)):
        b = _3 * k
        db, dg, dr = np.float32(bgr[b]) - mean[b], np.float32(bgr[b + _1]) - mean[b + _1], np.float32(bgr[b + _2]) - mean[b + _2]
        off[k] = db * db + dg * dg + dr * dr
        as_before, seen = off[k] <= _FAR * variance[k], known[k] == _SEEN
        more = (free[k] != 0) & (~seen | ((proofs[k] != _GIVEN) & (~as_before | (way - kept_at[k] >= _WAY))))
        stays[k], special[k] = as_before, more
        n_special += more
        rate = share if (free[k] != 0) & seen & as_before else _NOTHING
        mean[b] += rate * db
        mean[b + _1] += rate * dg
        mean[b + _2] += rate * dr
        variance[k] = max(variance[k] + rate * (off[k] * _THIRD - variance[k]), floor)
    return n_special


@compiled
def _pack(mean, variance, trusted, region, rows, per_least, pixels):
    u0, v0, u1, v1 = region
    codes, per_step = np.zeros(u1 - u0, dtype=np.uint32), np.float32(1.0 / LOG_STEP)
    for i in range(v0 + rows[0], v1, rows[1]):
        for k in range(np.uint64(codes.size)):  # by itself, for the sake of vectors
            steps = log_positive(max(variance[i, np.uint64(u0) + k] * per_least, _ONE)) * per_step
            codes[k] = np.uint32(min(steps + _ONE_AND_HALF, _LAST))
        _pack_row(mean[i, 3 * u0 : 3 * u1], codes, trusted[i, u0:u1], pixels[i, u0:u1])


@compiled
def _pack_row(mean, codes, trusted, pixels):
    for k in range(np.uint64(codes.size)):
        b = _3 * k
        blue, green, red = np.uint32(mean[b] + _HALF), np.uint32(mean[b + _1] + _HALF), np.uint32(mean[b + _2] + _HALF)
        packed = blue | (green << _8) | (red << _16) | (codes[k] << _24)
        pixels[k] = packed if trusted[k] != 0 else _UNKNOWN
