"""Lags between cameras by flashes of light, or a lamp that is switched on and off, or blinks.

A camera knows of a flash only in which image it comes first: half an image period early or late. Many flashes at uneven times
tell the lag far below that: by the lags that none of them excludes, and, of cameras that run alike, by how often a flash comes an
image earlier in one than in the other. A light that blinks is found in the images first; each of its changes, on and off, comes
between two images, of which the later one shows more than half of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import pdtrc

from ...errors import CalibrationError
from .motion import Lag, Pair, check_images, pairs_that_agree

_GRID = (32, 18)  # blocks of an image
_NOISE, _LEAST_LEVELS = 6.0, 4.0  # by how many times its usual change, and gray levels, a flash is brighter than before
_LEAST_SHARE = 0.6  # of the flashes that two cameras have in common
_BY_CHANCE = 0.05  # lags at which so many places of light that changes would meet, were they somebody who moves, at most
_HALF_LIT = 0.06  # of an image period: exposures and codecs show half of a change sooner or later, all of them alike
_NEAR_PERIODS, _LEAST_SIGMA_S = 2.0, 1e-5
_GRID_OF_LAGS, _MISSED = 600, 0.01  # places of the posterior; probability that a flash is not seen, or another one is


@dataclass(frozen=True, eq=False)
class Flashes:
    """Changes of light that a camera has seen.

    Attributes
    ----------
    camera : its name.
    times_s : (n,) stamps of the images in which light came on.
    period_s : of its images.
    stamps_s, levels : (m,) of all images, and how bright they are.
    kinds : (n,) only those of one kind are the same in two cameras; None: all are.
    in_room : whether they have lit most of its images, or nothing but a lamp: a limb that moves lights a few places as well.
    """

    camera: str
    times_s: np.ndarray
    period_s: float
    stamps_s: np.ndarray
    levels: np.ndarray
    kinds: np.ndarray | None = None
    in_room: bool = True


def gray_blocks(
    camera: str, images: Iterable[tuple[int, np.ndarray]], grid: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """The images of a camera in a few blocks.

    Parameters
    ----------
    camera, images : its name; (stamp_ns, (h, w, 3) BGR) in the order of time.
    grid : blocks along the width and the height.

    Returns
    -------
    (n,) seconds; (n, blocks) float32 gray levels.

    Raises
    ------
    CalibrationError : too few images.
    """
    stamps, rows = [], []
    for stamp_ns, bgr in images:
        stamps.append(1e-9 * stamp_ns)
        rows.append(cv2.cvtColor(cv2.resize(bgr, grid, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY).ravel())
    check_images(camera, len(stamps))
    return np.array(stamps), np.array(rows, dtype=np.float32)


def seen_flashes(camera: str, images: Iterable[tuple[int, np.ndarray]]) -> Flashes:
    """Flashes in the images of a camera.

    Parameters
    ----------
    camera, images : its name; (stamp_ns, (h, w, 3) BGR) in the order of time.

    Returns
    -------
    When light came on.

    Raises
    ------
    CalibrationError : too few images, or none that is brighter at once.
    """
    times, blocks = gray_blocks(camera, images, _GRID)
    whole = np.median(blocks, axis=1)
    levels = _level(blocks, whole)
    brighter = _brighter(levels)
    came = set(np.flatnonzero(brighter).tolist())
    first = sorted(k for k in came if k - 1 not in came)
    if not first:
        raise CalibrationError(camera, "no flash is seen in its images: none is brighter than the one before by more than usual")
    in_room = bool(_brighter(whole)[first].all())
    return Flashes(camera, times[first], float(np.median(np.diff(times))), times, levels, in_room=in_room)


def _brighter(levels: np.ndarray) -> np.ndarray:
    """(n,) whether each image is brighter than the one before by more than usual."""
    steps = np.diff(levels, prepend=levels[0])
    usual = 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
    return steps > max(_NOISE * usual, _LEAST_LEVELS)


def _level(blocks: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """How bright each image is: what most of it says, or the few blocks of a lamp that switches, whichever stands out more."""
    jumps = np.abs(np.diff(blocks, axis=0))
    usual = np.median(jumps, axis=0) + 1.0
    outstanding = np.sort(jumps, axis=0)[-4:].mean(axis=0) / usual
    lamp = blocks[:, np.argsort(outstanding)[-3:]].mean(axis=1)

    def contrast(values: np.ndarray) -> float:
        steps = np.abs(np.diff(values))
        return float(np.sort(steps)[-4:].mean() / (np.median(steps) + 1.0))

    return whole if contrast(whole) >= 0.5 * contrast(lamp) else lamp


def flash_lags(seen: Sequence[Flashes], max_offset_s: float) -> tuple[list[Pair], list[float]]:
    """Lags of every pair of cameras.

    Parameters
    ----------
    seen : one a camera.
    max_offset_s : the largest lag that is searched.

    Returns
    -------
    pairs : of those that have flashes in common.
    runners_up : of each camera, how many flashes fit another lag, in shares of those that fit the best.

    Raises
    ------
    CalibrationError : a camera whose flashes may be anything that moves.
    """
    pairs, runners_up = pairs_that_agree(seen, lambda a, b: _lag(a, b, max_offset_s))
    for k, camera in enumerate(seen):
        if not camera.in_room and not any(k in (pair.i, pair.j) for pair in pairs):
            n, expected = len(camera.times_s), "expected flashes that light the room, or a lamp switched on five times or more"
            seen_n = f"{n} change{'s' * (n != 1)} of light in one place of its images"
            raise CalibrationError(camera.camera, f"{seen_n} may be somebody who moves, and fit no other camera's: {expected}")
    return pairs, runners_up


def _lag(a: Flashes, b: Flashes, max_offset_s: float) -> Lag | None:
    """Lag of ``b`` behind ``a``; the correlation is the share of the flashes that allow it."""
    reach = 0.5 * (a.period_s + b.period_s)
    differences = b.times_s[None, :] - a.times_s[:, None]
    if a.kinds is not None and b.kinds is not None:
        differences = np.where(a.kinds[:, None] == b.kinds[None, :], differences, np.inf)
    near = np.sort(differences[np.abs(differences) <= max_offset_s])
    if not len(near):
        return None
    # Each pair of flashes allows an interval of lags: how many do at every place
    step = 0.1 * reach
    places = np.arange(near[0] - reach, near[-1] + reach + step, step)
    counts = np.searchsorted(near, places + reach) - np.searchsorted(near, places - reach)
    most, fewer = int(counts.max()), min(len(a.times_s), len(b.times_s))
    if most < _LEAST_SHARE * fewer or (most == 1 and max(len(a.times_s), len(b.times_s)) > 1):  # any two meet at some lag
        return None
    if not (a.in_room and b.in_room):
        by_chance = differences.size * reach / max_offset_s  # at a lag
        if float(pdtrc(most - 1, by_chance)) * max_offset_s / reach > _BY_CHANCE:
            return None
    best = np.flatnonzero(counts == most)
    runs = np.split(best, np.flatnonzero(np.diff(best) > 1) + 1)  # lags that fit alike, as of a lamp that blinks evenly
    rough = float(min((places[run].mean() for run in runs), key=abs))
    lags = rough + np.linspace(-1.5 * reach, 1.5 * reach, _GRID_OF_LAGS)
    lag_s, sigma_s = _posterior(differences, lags, a.period_s, b.period_s)
    if a.kinds is not None:
        sigma_s = float(np.hypot(sigma_s, _HALF_LIT * reach))
    elsewhere = counts[np.abs(places - lag_s) > _NEAR_PERIODS * reach].max(initial=0)
    return Lag(lag_s, max(sigma_s, _LEAST_SIGMA_S) ** 2, min(most / fewer, 1.0), float(elsewhere / most))


def _posterior(differences: np.ndarray, lags: np.ndarray, period_a: float, period_b: float) -> tuple[float, float]:
    """Mean and standard deviation of the lag, of all ``lags`` as likely before.

    A flash comes at any time within an image period of either camera, so that the difference of their stamps is off by the sum of
    two uniform errors; or the other camera has missed it.
    """
    off = np.abs(differences[None] - lags[:, None, None])
    density = np.clip(0.5 * (period_a + period_b) - off, 0.0, min(period_a, period_b)) / (period_a * period_b)
    each = density.max(axis=2 if differences.shape[0] <= differences.shape[1] else 1)
    log = np.log(each + _MISSED / max(period_a, period_b)).sum(axis=1)
    weights = np.exp(log - log.max())
    weights /= weights.sum()
    mean = float(weights @ lags)
    return mean, float(np.sqrt(weights @ (lags - mean) ** 2))


_FINE_GRID = (64, 36)  # blocks of an image: a small light fills much of one
_LEAST_CONTRAST = 6.0  # gray levels between off and on in its block
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
    times, blocks = gray_blocks(camera, images, _FINE_GRID)
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
    some = np.flatnonzero(contrast >= _LEAST_CONTRAST)
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
