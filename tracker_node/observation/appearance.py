"""Appearance of body and surroundings in one camera, and which pixels belong to the body.

Two sources are combined in one log-odds per pixel, log p(color | body) - log p(color | surroundings):

* the *background*: mean and variance per pixel of the empty scene, from images of it or learned where the body is not, with
  tolerance for shadows (a pixel that is a darker copy of its mean still is background);
* *colors*: histograms of body and surroundings, learned inside and around the fitted body. They decide alone where the scene
  behind the body has never been seen.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from ..compiled.kernels import compiled
from .appearance_kernels import log_odds, update_scene

Region = tuple[int, int, int, int]  # u0, v0, u1, v1; the last two exclusive

BINS = 16  # per channel
AT_ONCE = 260_000  # pixels that are learned from one image at most: of a larger one, fewer, or others with the next
_CELL_PX = 4
_SHIFT = 4  # a bin is 16 gray levels wide
_BIN_VOLUME = float(1 << _SHIFT) ** 3
_LOG_UNIFORM = -3.0 * math.log(256.0)  # density of a color about which nothing is known
# One pixel in five in shadow, of a brightness anywhere in some 75 gray levels, and a Gaussian across
_LOG_SHADOW = math.log(0.2 / 75.0) - math.log(2.0 * math.pi)


@compiled
def bin_of(b, g, r):
    """Which of the colors that are told apart a pixel has.

    Parameters
    ----------
    b, g, r : uint8 channels.

    Returns
    -------
    Its index, below `BINS` cubed.
    """
    return (np.int64(b >> _SHIFT) * BINS + np.int64(g >> _SHIFT)) * BINS + np.int64(r >> _SHIFT)


@compiled
def count_colors(bgr, labels, around, body_counts, scene_counts):
    """Add up the pixels of each color, of the body's parts and of what surrounds it.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    labels : (h, w) uint8, 1 + part, 0 beside the body.
    around : (h, w) bool, surroundings that count.
    body_counts : (n_parts, `BINS`^3) float32, added to.
    scene_counts : (`BINS`^3,) float32, added to.
    """
    for i in range(bgr.shape[0]):
        for j in range(bgr.shape[1]):
            index = bin_of(bgr[i, j, 0], bgr[i, j, 1], bgr[i, j, 2])
            if labels[i, j]:
                body_counts[labels[i, j] - 1, index] += np.float32(1.0)
            elif around[i, j]:
                scene_counts[index] += np.float32(1.0)


@compiled
def spread_counts(density, out):
    """Add a histogram to another, shared with neighboring bins: colors drift with light, and counts are sparse.

    Parameters
    ----------
    density : (`BINS`^3,) float32.
    out : (`BINS`^3,) float32, added to.
    """
    for b in range(BINS):
        for g in range(BINS):
            for r in range(BINS):
                center = density[(b * BINS + g) * BINS + r]
                if center == 0.0:
                    continue
                for db in range(-1, 2):
                    for dg in range(-1, 2):
                        for dr in range(-1, 2):
                            x, y, z = b + db, g + dg, r + dr
                            if 0 <= x < BINS and 0 <= y < BINS and 0 <= z < BINS:
                                share = np.float32(0.125 * 0.5 ** (abs(db) + abs(dg) + abs(dr)))
                                out[(x * BINS + y) * BINS + z] += share * center


class ColorModel:
    """Color histograms of every body part and of the surroundings, as log densities per gray level cubed.

    The density of the body is the largest of its parts': a small part in a color of its own counts as much as the trunk.
    """

    def __init__(self):
        self._parts = np.zeros((0, BINS**3), dtype=np.float32)
        self._scene = np.zeros(BINS**3, dtype=np.float32)
        self.log_body = np.full(BINS**3, _LOG_UNIFORM, dtype=np.float32)
        self.log_scene = np.full(BINS**3, _LOG_UNIFORM, dtype=np.float32)

    def learn(self, bgr: np.ndarray, labels: np.ndarray, around: np.ndarray, rate: float) -> None:
        """Mix in the colors of one crop.

        Parameters
        ----------
        bgr : (h, w, 3) uint8.
        labels : (h, w) uint8, 1 + part, 0 beside the body.
        around : (h, w) bool, surroundings that count.
        rate : weight of this image, 0..1.
        """
        n_parts = max(int(labels.max(initial=0)), len(self._parts))
        if n_parts > len(self._parts):
            self._parts = np.concatenate([self._parts, np.zeros((n_parts - len(self._parts), BINS**3), dtype=np.float32)])
        parts, scene = np.zeros_like(self._parts), np.zeros_like(self._scene)
        count_colors(bgr, labels, around, parts, scene)
        for part in range(n_parts):
            self._parts[part] = _mixed(self._parts[part], parts[part], rate)
        self._scene = _mixed(self._scene, scene, rate)
        densest, spread = np.zeros(BINS**3, dtype=np.float32), np.empty(BINS**3, dtype=np.float32)
        for part in range(n_parts):
            spread[:] = 0.0
            spread_counts(self._parts[part], spread)
            np.maximum(densest, spread, out=densest)
        self.log_body = _log_density(densest)
        spread[:] = 0.0
        spread_counts(self._scene, spread)
        self.log_scene = _log_density(spread)


def _log_density(density: np.ndarray) -> np.ndarray:
    if not density.any():
        return np.full_like(density, _LOG_UNIFORM)
    mix = 0.02  # a little of every color: no color is impossible
    return np.log((1.0 - mix) * density / _BIN_VOLUME + mix * math.exp(_LOG_UNIFORM)).astype(np.float32)


def _mixed(old: np.ndarray, new: np.ndarray, rate: float) -> np.ndarray:
    """Normalized histogram after mixing in the counts ``new``; few counts do not count."""
    total = float(new.sum())
    if total < 20.0:
        return old
    new = new / np.float32(total)
    if not old.any():
        return new
    return ((1.0 - rate) * old + rate * new).astype(np.float32)


SEEN, GUESSED = 1, 2
_GUESS_SIGMA = 15.0  # gray levels


class SceneModel:
    """Mean and variance of the background, per pixel.

    ``known`` is `SEEN` where they were observed, `GUESSED` where they come from the surroundings, 0 where nothing is known.
    """

    def __init__(self, height: int, width: int, sigma: float = 8.0):
        self.mean = np.zeros((height, width, 3), dtype=np.float32)
        self.variance = np.full((height, width), sigma**2, dtype=np.float32)
        self.known = np.zeros((height, width), dtype=np.uint8)
        self.floor = np.float32(sigma**2)

    @classmethod
    def from_images(cls, images: list[np.ndarray], sigma: float = 8.0) -> SceneModel:
        """A model learned from images of the empty scene.

        Parameters
        ----------
        images : one or more, (height, width, 3) BGR.
        sigma : least standard deviation of a pixel, gray levels.

        Returns
        -------
        All pixels are `SEEN`.
        """
        stack = np.stack(images).astype(np.float32)
        model = cls(stack.shape[1], stack.shape[2], sigma)
        model.mean[:] = stack.mean(axis=0)
        if len(images) > 1:
            model.variance[:] = np.maximum(stack.var(axis=0, ddof=1).mean(axis=2), model.floor)
        model.known[:] = SEEN
        return model

    def learn_first(self, bgr: np.ndarray, body: np.ndarray) -> None:
        """Take in the first image where it does not show the body.

        It fills pixels that no background image knows, and replaces a background image where that is plainly something else: it
        may show people or things that are gone since.

        Parameters
        ----------
        bgr : (height, width, 3) uint8, as large as the model.
        body : (height, width) uint8, not zero where the body may be.
        """
        difference = np.abs(bgr.astype(np.float32) - self.mean).max(axis=2)
        other = (self.known == 0) | (difference > 6.0 * np.sqrt(self.variance))
        free = (body == 0) & other
        self.mean[free] = bgr[free]
        self.variance[free] = self.floor
        self.known[free] = SEEN
        self._guess()

    def _guess(self) -> None:
        """Give pixels that were never seen the color of the nearest seen one, with a wide variance."""
        unseen = self.known == 0
        if not unseen.any() or unseen.all():
            return
        _, nearest = cv2.distanceTransformWithLabels(unseen.view(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        colors = np.zeros((int(nearest.max()) + 1, 3), dtype=np.float32)
        colors[nearest[~unseen]] = self.mean[~unseen]
        self.mean[unseen] = colors[nearest[unseen]]
        self.variance[unseen] = _GUESS_SIGMA**2
        self.known[unseen] = GUESSED

    def update(self, bgr: np.ndarray, body: np.ndarray, rate: float, region: tuple[int, int, int, int]) -> None:
        """Learn from a part of an image where it does not show the body.

        Parameters
        ----------
        bgr : (height, width, 3) uint8, the whole image.
        body : (h, w) uint8 on the region, not zero where the body may be.
        rate : weight of this image, 0..1.
        region : (u0, v0, u1, v1).
        """
        pixels, mean = _interleaved(bgr, region), self.mean.reshape(len(bgr), -1)
        body = np.ascontiguousarray(body)
        update_scene(pixels, region[:2], body, mean, self.variance, self.known, np.float32(rate), np.float32(self.floor))


def body_log_odds(
    bgr: np.ndarray,
    region: tuple[int, int, int, int],
    scene: SceneModel | None,
    colors: ColorModel,
    shadow: float = 0.75,
    reach: float = 10.0,
) -> np.ndarray:  # fmt: skip
    """Log-odds that pixels show the body rather than its surroundings.

    Parameters
    ----------
    bgr : (height, width, 3) uint8, the whole image.
    region : (u0, v0, u1, v1) of it.
    scene : the background as far as it is known, or None.
    colors : histograms of body and surroundings.
    shadow : how dark a shadow may be, as a fraction of the background's brightness.
    reach : the result is clipped to +-``reach``.

    Returns
    -------
    (h, w) float32 on the region.
    """
    u0, v0, u1, v1 = region
    height, width = bgr.shape[:2]
    out = np.empty((v1 - v0, u1 - u0), dtype=np.float32)
    if scene is None:
        mean, variance, known = np.zeros((1, 3), np.float32), np.ones((1, 1), np.float32), np.zeros((1, width), np.uint8)
    else:
        mean, variance, known = scene.mean.reshape(height, -1), scene.variance, scene.known
    pixels = _interleaved(bgr, region)
    pairs = np.stack([colors.log_body, colors.log_scene], axis=1).ravel()
    options = np.array([shadow, math.log(0.02), reach, _LOG_SHADOW], dtype=np.float32)
    log_odds(pixels, (u0, v0), mean, variance, known, scene is not None, _SHIFT, pairs, options, out)
    return out


def _interleaved(bgr: np.ndarray, region: tuple[int, int, int, int]) -> np.ndarray:
    """An image as rows of interleaved colors (height, 3 width), once its ``region`` is known to lie within it."""
    height, width = bgr.shape[:2]
    u0, v0, u1, v1 = region
    if not (0 <= u0 < u1 <= width and 0 <= v0 < v1 <= height):
        raise ValueError(f"expected a region (u0, v0, u1, v1) within {width} x {height}, got {tuple(region)}")
    return np.ascontiguousarray(bgr).reshape(height, -1)


def grown(mask: np.ndarray, reach: int) -> np.ndarray:
    """Pixels within about ``reach`` of a mask; computed at a quarter of the size.

    Parameters
    ----------
    mask : (h, w) uint8, not zero inside.
    reach : pixels.

    Returns
    -------
    (h, w) uint8, 0 or 1.
    """
    height, width = mask.shape
    size = max(1, width // 4), max(1, height // 4)
    small = cv2.resize((mask > 0).view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA)
    step = max(1, round(reach / 4))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * step + 1, 2 * step + 1))
    small = cv2.dilate((small > 0).astype(np.uint8), kernel)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_NEAREST)


def cells_near(mask: np.ndarray, reach: int, every: int = 1) -> tuple[np.ndarray, int]:
    """Cells of pixels within about ``reach`` of a mask.

    Parameters
    ----------
    mask : (h, w) uint8, not zero inside.
    reach : pixels.
    every : so many pixels a side have one value in ``mask``.

    Returns
    -------
    near : (h / n, w / n) uint8, 0 or 1, rounded up.
    cell : pixels a side of one of them, n ``every``; four or a little more.
    """
    n = max(1, -(-_CELL_PX // every))
    near = np.zeros((-(-mask.shape[0] // n), -(-mask.shape[1] // n)), dtype=np.uint8)
    _touched(mask, n, near)
    step = max(1, round(reach / (n * every)))
    return cv2.dilate(near, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * step + 1, 2 * step + 1))), n * every


@compiled
def _touched(mask, n, cells):
    """Cells of ``n`` values a side of which one is not zero."""
    for i in range(mask.shape[0]):
        row = cells[i // n]
        for k in range(row.size):
            if row[k] == 0:
                for j in range(k * n, min((k + 1) * n, mask.shape[1])):
                    if mask[i, j] != 0:
                        row[k] = 1
                        break


def shrunk(labels: np.ndarray, depth: int) -> np.ndarray:
    """Part labels without the pixels near the outside of the body.

    Parameters
    ----------
    labels : (h, w) uint8, 0 beside the body.
    depth : how near, pixels.

    Returns
    -------
    (h, w) uint8.
    """
    size = 2 * depth + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    inside = cv2.erode((labels > 0).astype(np.uint8), kernel, borderValue=0)
    return labels * inside
