"""A light that blinks, as cameras see it: where it is in their images, and when it goes on and off.

Each change comes between two images, of which the later one shows more than half of it: it is known to an image period. Many
changes at uneven times tell the lag between cameras far below that, as flashes do (`flashes`), and of both kinds: on and off.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...errors import CalibrationError
from .flashes import Flashes, gray_blocks

_GRID = (64, 36)  # blocks of an image: a small light fills much of one
_LEAST_LEVELS = 6.0  # gray levels between off and on in its block
_NEAR, _LEAST_NEAR = 0.25, 0.8  # of the contrast, from off or on; fraction of the images there: a light is one or the other
_LEAST_CHANGES = 6
_ALIKE = 0.95  # correlation of blocks that the same light fills


def seen_blinking(camera: str, images: Iterable[tuple[int, np.ndarray]]) -> Flashes:
    """Changes of a blinking light in the images of a camera.

    Parameters
    ----------
    camera, images : its name; (stamp_ns, (h, w, 3) BGR) in the order of time.

    Returns
    -------
    When it went on (kind 1) and off (0), in the middle between two images.

    Raises
    ------
    CalibrationError : too few images, or nothing in them that goes on and off.
    """
    times, blocks = gray_blocks(camera, images, _GRID)
    level = _light(blocks)
    lit = level > 0.5
    changes = np.flatnonzero(lit[1:] != lit[:-1])
    if len(changes) < _LEAST_CHANGES:
        raise CalibrationError(camera, "no light that blinks is seen in its images: nothing goes on and off, time and again")
    middles, period_s = 0.5 * (times[changes] + times[changes + 1]), float(np.median(np.diff(times)))
    return Flashes(camera, middles, period_s, times, level, lit[changes + 1].astype(int))


def _light(blocks: np.ndarray) -> np.ndarray:
    """(n,) 0 where the light is off, 1 where it is on; zeros where there is none.

    Of the blocks that are nearly always one of two levels, it is the one that changes most often, and clearest: somebody who
    walks past changes a block less often.
    """
    low, high = np.percentile(blocks, [5.0, 95.0], axis=0)
    contrast = high - low
    some = np.flatnonzero(contrast >= _LEAST_LEVELS)
    if not len(some):
        return np.zeros(len(blocks))
    level = (blocks[:, some] - low[some]) / contrast[some]
    off = np.minimum(np.abs(level), np.abs(level - 1.0))
    near = np.mean(off < _NEAR, axis=0)
    changes = np.sum((level[1:] > 0.5) != (level[:-1] > 0.5), axis=0)
    clear = contrast[some] / (0.05 + off.mean(axis=0))
    score = np.where((near >= _LEAST_NEAR) & (changes >= _LEAST_CHANGES), changes**2 * clear, 0.0)
    best = int(np.argmax(score))
    if score[best] == 0.0:
        return np.zeros(len(blocks))
    with np.errstate(invalid="ignore"):
        alike = np.corrcoef(level.T)[best] > _ALIKE
    return np.average(level[:, alike], axis=1, weights=contrast[some][alike])
