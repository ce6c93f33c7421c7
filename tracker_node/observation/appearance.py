"""What body and surroundings look like in one camera, and which pixels belong to the body.

Two sources are combined in one log-odds per pixel, log p(color | body) - log p(color | surroundings):

* the *scene*: mean and variance of the empty scene per pixel, from a plate or learnt where the body is not, with tolerance
  for shadows (a pixel that is a darker copy of its mean still is scene);
* *colors*: histograms of body and surroundings, learnt inside and around the fitted body. They decide alone where the scene
  behind the body has never been seen.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

BINS = 16  # per channel
_SHIFT = 4  # a bin is 16 grey levels wide
_BIN_VOLUME = float(1 << _SHIFT) ** 3
_LOG_UNIFORM = -3.0 * math.log(256.0)  # density of a color about which nothing is known
_LOG_GAUSS = -1.5 * math.log(2.0 * math.pi)
# One pixel in five in shadow, of a brightness anywhere in some 75 grey levels, and a Gaussian across
_LOG_SHADOW = math.log(0.2 / 75.0) - math.log(2.0 * math.pi)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _bin(b, g, r):
    return (np.int64(b >> _SHIFT) * BINS + np.int64(g >> _SHIFT)) * BINS + np.int64(r >> _SHIFT)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _log_odds(bgr, mean, variance, known, log_body, log_scene, options, out):
    """Log-odds of body against scene. ``options``: (darkest shadow, outlier log weight, reach, log density of shadows)."""
    darkest, log_outlier, reach, log_shadow = options[0], options[1], options[2], options[3]
    for i in range(bgr.shape[0]):
        for j in range(bgr.shape[1]):
            b, g, r = bgr[i, j, 0], bgr[i, j, 1], bgr[i, j, 2]
            index = _bin(b, g, r)
            if known[i, j]:
                x, y, z = np.float32(b), np.float32(g), np.float32(r)
                mx, my, mz = mean[i, j, 0], mean[i, j, 1], mean[i, j, 2]
                gain = (x * mx + y * my + z * mz) / (mx * mx + my * my + mz * mz + np.float32(1.0))
                dx, dy, dz = x - mx, y - my, z - mz
                distance = (dx * dx + dy * dy + dz * dz) / variance[i, j]
                log_variance = math.log(variance[i, j])
                log_background = np.float32(_LOG_GAUSS) - np.float32(1.5) * log_variance - np.float32(0.5) * distance
                if darkest < gain < np.float32(1.0):
                    # A shadow: free to be anywhere along the line to black, so its density is that of the two axes across it
                    dx, dy, dz = x - gain * mx, y - gain * my, z - gain * mz
                    distance = (dx * dx + dy * dy + dz * dz) / variance[i, j]
                    log_shaded = log_shadow - log_variance - np.float32(0.5) * distance
                    log_background = max(log_background, log_shaded)
                log_background = max(log_background, log_outlier + log_scene[index])
            else:
                log_background = log_scene[index]
            value = log_body[index] - log_background
            out[i, j] = min(max(value, -reach), reach)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _update_scene(bgr, body, mean, variance, known, rate, floor):
    """Running mean and variance of pixels that the (dilated) body mask leaves free; unseen pixels start from this image."""
    for i in range(bgr.shape[0]):
        for j in range(bgr.shape[1]):
            if body[i, j]:
                continue
            if not known[i, j]:
                known[i, j] = 1
                for c in range(3):
                    mean[i, j, c] = bgr[i, j, c]
                variance[i, j] = np.float32(4.0) * floor
                continue
            total = np.float32(0.0)
            for c in range(3):
                d = np.float32(bgr[i, j, c]) - mean[i, j, c]
                total += d * d
            if total > np.float32(12.0) * variance[i, j] * np.float32(3.0):
                continue  # something passes by: not the scene
            for c in range(3):
                mean[i, j, c] += rate * (np.float32(bgr[i, j, c]) - mean[i, j, c])
            variance[i, j] = max(floor, variance[i, j] + rate * (total / np.float32(3.0) - variance[i, j]))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _count_colors(bgr, labels, around, body_counts, scene_counts):
    for i in range(bgr.shape[0]):
        for j in range(bgr.shape[1]):
            index = _bin(bgr[i, j, 0], bgr[i, j, 1], bgr[i, j, 2])
            if labels[i, j]:
                body_counts[labels[i, j] - 1, index] += np.float32(1.0)
            elif around[i, j]:
                scene_counts[index] += np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _spread(density, out):
    """Add a histogram to ``out``, shared with neighbouring bins: colors drift with light, and counts are sparse."""
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
    """Color histograms of every body part and of the surroundings, as log densities per grey level cubed.

    The density of the body is the largest of its parts': a small part in a color of its own counts as much as the trunk.
    """

    def __init__(self):
        self._parts = np.zeros((0, BINS**3), dtype=np.float32)
        self._scene = np.zeros(BINS**3, dtype=np.float32)
        self.log_body = np.full(BINS**3, _LOG_UNIFORM, dtype=np.float32)
        self.log_scene = np.full(BINS**3, _LOG_UNIFORM, dtype=np.float32)

    def learn(self, bgr: np.ndarray, labels: np.ndarray, around: np.ndarray, rate: float) -> None:
        """Mix in the colors of one crop: part i where ``labels`` is i + 1 (uint8), surroundings where ``around`` (bool)."""
        n_parts = max(int(labels.max(initial=0)), len(self._parts))
        if n_parts > len(self._parts):
            self._parts = np.concatenate([self._parts, np.zeros((n_parts - len(self._parts), BINS**3), dtype=np.float32)])
        parts, scene = np.zeros_like(self._parts), np.zeros_like(self._scene)
        _count_colors(bgr, labels, around, parts, scene)
        for part in range(n_parts):
            self._parts[part] = _mixed(self._parts[part], parts[part], rate)
        self._scene = _mixed(self._scene, scene, rate)
        densest, spread = np.zeros(BINS**3, dtype=np.float32), np.empty(BINS**3, dtype=np.float32)
        for part in range(n_parts):
            spread[:] = 0.0
            _spread(self._parts[part], spread)
            np.maximum(densest, spread, out=densest)
        self.log_body = _log_density(densest)
        spread[:] = 0.0
        _spread(self._scene, spread)
        self.log_scene = _log_density(spread)


def _log_density(density: np.ndarray) -> np.ndarray:
    mix = 0.02  # a little of every color: no color is impossible
    return np.log((1.0 - mix) * density / _BIN_VOLUME + mix * math.exp(_LOG_UNIFORM)).astype(np.float32)


def _mixed(old: np.ndarray, new: np.ndarray, rate: float) -> np.ndarray:
    """Normalized histogram after mixing in the counts ``new``; few counts are not believed."""
    total = float(new.sum())
    if total < 20.0:
        return old
    new = new / np.float32(total)
    if not old.any():
        return new
    return ((1.0 - rate) * old + rate * new).astype(np.float32)


class SceneModel:
    """Mean and variance of the empty scene, per pixel, with a mask of the pixels where they are known."""

    def __init__(self, height: int, width: int, sigma: float = 8.0):
        self.mean = np.zeros((height, width, 3), dtype=np.float32)
        self.variance = np.full((height, width), sigma**2, dtype=np.float32)
        self.known = np.zeros((height, width), dtype=np.uint8)
        self.floor = np.float32(sigma**2)

    @classmethod
    def from_images(cls, images: list[np.ndarray], sigma: float = 8.0) -> SceneModel:
        """Learn from one or several (height, width, 3) BGR images of the empty scene; ``sigma`` is the least deviation."""
        stack = np.stack(images).astype(np.float32)
        model = cls(stack.shape[1], stack.shape[2], sigma)
        model.mean[:] = stack.mean(axis=0)
        if len(images) > 1:
            model.variance[:] = np.maximum(stack.var(axis=0, ddof=1).mean(axis=2), model.floor)
        model.known[:] = 1
        return model

    def learn_first(self, bgr: np.ndarray, body: np.ndarray) -> None:
        """Take in the first image (as large as the model) wherever ``body`` (uint8) is zero.

        It fills pixels that no plate knows, and replaces a plate where that is plainly something else: a still of the scene may
        show people or things that are gone since.
        """
        difference = np.abs(bgr.astype(np.float32) - self.mean).max(axis=2)
        other = (self.known == 0) | (difference > 6.0 * np.sqrt(self.variance))
        free = (body == 0) & other
        self.mean[free] = bgr[free]
        self.variance[free] = self.floor
        self.known[free] = 1

    def update(self, bgr: np.ndarray, body: np.ndarray, rate: float, region: tuple[int, int, int, int]) -> None:
        """Learn from the crop ``region`` (u0, v0, u1, v1) of an image where ``body`` (uint8, on the crop) is zero."""
        u0, v0, u1, v1 = region
        part = slice(v0, v1), slice(u0, u1)
        _update_scene(bgr[part], body, self.mean[part], self.variance[part], self.known[part], np.float32(rate), self.floor)


def body_log_odds(
    bgr: np.ndarray,
    region: tuple[int, int, int, int],
    scene: SceneModel | None,
    colors: ColorModel,
    shadow: float = 0.75,
    reach: float = 10.0,
) -> np.ndarray:  # fmt: skip
    """Log-odds (float32) that pixels of ``region`` (u0, v0, u1, v1) show the body, clipped to +-``reach``.

    ``shadow`` is how dark a shadow may be, as a fraction of the scene's brightness.
    """
    u0, v0, u1, v1 = region
    crop = bgr[v0:v1, u0:u1]
    out = np.empty(crop.shape[:2], dtype=np.float32)
    if scene is None:
        mean, variance, known = _NOTHING
        mean = np.broadcast_to(mean, crop.shape)
        variance, known = np.broadcast_to(variance, out.shape), np.broadcast_to(known, out.shape)
    else:
        mean, variance, known = scene.mean[v0:v1, u0:u1], scene.variance[v0:v1, u0:u1], scene.known[v0:v1, u0:u1]
    options = np.array([shadow, math.log(0.02), reach, _LOG_SHADOW], dtype=np.float32)
    _log_odds(crop, mean, variance, known, colors.log_body, colors.log_scene, options, out)
    return out


_NOTHING = (np.zeros((1, 1, 3), np.float32), np.ones((1, 1), np.float32), np.zeros((1, 1), np.uint8))
