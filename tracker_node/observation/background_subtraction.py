"""What differs from the empty scene: a statistical background model per pixel, blind to shadows and to changes of light.

A pixel x with mean m and variance s^2 of the empty scene scores |x - a m|^2 / s^2, the squared Mahalanobis distance (three color
channels). The factor a is what brings the mean nearest to the pixel, within [shadow, 1]: a pixel that is a darker copy of its
mean, with the same chromaticity, is the scene in shadow (Horprasert, Harwood & Davis 1999). A global gain of each channel
follows the camera's exposure and white balance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numba as nb
import numpy as np

Region = tuple[int, int, int, int]  # u0, v0, u1, v1; the last two exclusive

_GAIN_PIXELS = 1500  # about as many, on a regular grid, are what the gain is estimated from
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _score_row(bgr, mean_b, mean_g, mean_r, variance, gains, shadow, out):
    """One row; ``bgr`` is interleaved. Unsigned indices and no branches: the compiler makes vector instructions of this."""
    one = np.float32(1.0)
    gain_b, gain_g, gain_r = gains[0], gains[1], gains[2]
    for u in range(np.uint64(out.size)):
        at = np.uint64(3) * u
        x, y, z = np.float32(bgr[at]), np.float32(bgr[at + np.uint64(1)]), np.float32(bgr[at + np.uint64(2)])
        mx, my, mz = gain_b * mean_b[u], gain_g * mean_g[u], gain_r * mean_r[u]
        a = (x * mx + y * my + z * mz) / (mx * mx + my * my + mz * mz + one)
        a = a if a < one else one
        a = a if a > shadow else shadow
        dx, dy, dz = x - a * mx, y - a * my, z - a * mz
        out[u] = (dx * dx + dy * dy + dz * dz) / variance[u]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _score(pixels, corner, mean, variance, u0, v0, gains, shadow, out):
    """``pixels`` are rows of interleaved colors; ``corner`` (u, v) is where in them the region begins."""
    height, width = out.shape
    first, last = 3 * corner[0], 3 * (corner[0] + width)
    for v in range(height):
        at = v + v0
        _score_row(
            pixels[v + corner[1], first:last],
            mean[0, at, u0 : u0 + width], mean[1, at, u0 : u0 + width], mean[2, at, u0 : u0 + width],
            variance[at, u0 : u0 + width], gains, shadow, out[v],
        )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _threshold(score, known, u0, v0, threshold, mask):
    height, width = mask.shape
    for v in range(height):
        score_row, known_row, mask_row = score[v], known[v + v0, u0 : u0 + width], mask[v]
        for u in range(np.uint64(width)):
            mask_row[u] = np.uint8(255) if (score_row[u] > threshold) & (known_row[u] != 0) else np.uint8(0)


@dataclass(frozen=True, eq=False)
class BackgroundModel:
    """Mean and variance of every pixel of the empty scene; never changes once learnt.

    Attributes
    ----------
    mean : (3, height, width) float32, grey levels: blue, green, red planes.
    variance : (height, width) float32, grey levels^2, mean of the channels.
    known : (height, width) uint8, nonzero where the model holds.
    """

    mean: np.ndarray
    variance: np.ndarray
    known: np.ndarray

    @classmethod
    def from_images(
        cls,
        images: Iterable[np.ndarray],
        *,
        noise: float = 6.0,
        jitter_px: float = 0.3,
        known: np.ndarray | None = None,
    ) -> BackgroundModel:
        """Learn from one or more images (height, width, 3), BGR uint8, of the empty scene.

        Parameters
        ----------
        noise : least standard deviation of a pixel, grey levels.
        jitter_px : standard deviation of image motion (vibration, compression), which adds variance along edges.
        known : (height, width), zero where the images do not show the empty scene.

        Raises
        ------
        ValueError : no image, or images or a mask of different sizes.
        """
        total: np.ndarray | None = None
        count, mean = 0, np.zeros(0)
        for image in images:
            if image.ndim != 3 or image.shape[2] != 3 or (total is not None and image.shape != mean.shape):
                expected = "(height, width, 3)" if total is None else str(mean.shape)
                raise ValueError(f"expected images of the empty scene of shape {expected}, got {image.shape}")
            if total is None:
                total, mean = np.zeros(image.shape[:2]), np.zeros(image.shape)
            count += 1
            difference = image - mean
            mean += difference / count  # Welford: one image in memory at a time
            total += (difference * (image - mean)).mean(axis=2)
        if total is None:
            raise ValueError("expected at least one image of the empty scene, got none")
        known = np.ones(total.shape) if known is None else known
        if known.shape != total.shape:
            raise ValueError(f"expected a mask 'known' of shape {total.shape}, got {known.shape}")
        variance = np.maximum(total / max(count - 1, 1), noise**2) + jitter_px**2 * _gradient_squared(mean)
        return cls(
            np.ascontiguousarray(np.moveaxis(mean, 2, 0), dtype=np.float32),
            variance.astype(np.float32),
            np.ascontiguousarray(known != 0).view(np.uint8),
        )

    @property
    def width(self) -> int:
        return self.mean.shape[2]

    @property
    def height(self) -> int:
        return self.mean.shape[1]

    def gains(self, bgr: np.ndarray, body: Region | None = None) -> np.ndarray:
        """(3,) float32: how much brighter than the model each channel of an image is; the median over a coarse grid.

        Pixels of ``body``, clipped ones and very dark ones do not count; with fewer than a hundred others the gain is 1.
        """
        self._check(bgr)
        step = max(1, math.isqrt(self.width * self.height // _GAIN_PIXELS))
        grid = slice(step // 2, None, step), slice(step // 2, None, step)
        live, mean = bgr[grid].astype(np.float32), np.moveaxis(self.mean[:, *grid], 0, 2)
        usable = (self.known[grid] != 0) & (live.max(axis=2) < 250) & (mean.max(axis=2) < 250) & (mean.min(axis=2) > 16)
        if body is not None:
            u0, v0, u1, v1 = (max(0, -(-(x - step // 2) // step)) for x in body)
            usable[v0:v1, u0:u1] = False
        if usable.sum() < 100:
            return np.ones(3, dtype=np.float32)
        return np.median(live[usable] / mean[usable], axis=0).astype(np.float32)

    def score(
        self, bgr: np.ndarray, region: Region, *, shadow: float = 0.6, gains: np.ndarray | None = None
    ) -> np.ndarray:  # fmt: skip
        """Squared Mahalanobis distance (h, w) float32 from the empty scene, of the pixels of ``region``.

        Parameters
        ----------
        bgr : (height, width, 3) uint8, the whole image.
        shadow : darkest shadow as a fraction of the scene's brightness; 1 knows no shadows.
        gains : as from `gains`; ones without it.
        """
        u0, v0, u1, v1 = self._check(bgr, region)
        pixels, corner = bgr, (u0, v0)
        if not bgr.flags.c_contiguous:
            pixels, corner = np.ascontiguousarray(bgr[v0:v1, u0:u1]), (0, 0)
        out = np.empty((v1 - v0, u1 - u0), dtype=np.float32)
        factors = np.ones(3, dtype=np.float32) if gains is None else np.asarray(gains, dtype=np.float32)
        _score(pixels.reshape(len(pixels), -1), corner, self.mean, self.variance, u0, v0, factors, np.float32(shadow), out)
        return out

    def foreground(
        self,
        bgr: np.ndarray,
        region: Region,
        *,
        threshold: float = 16.0,
        shadow: float = 0.6,
        gains: np.ndarray | None = None,
    ) -> np.ndarray:
        """Mask (h, w) uint8 of ``region``: 255 where the `score` exceeds ``threshold``, 0 elsewhere and where not ``known``."""
        score = self.score(bgr, region, shadow=shadow, gains=gains)
        mask = np.empty(score.shape, dtype=np.uint8)
        _threshold(score, self.known, region[0], region[1], np.float32(threshold), mask)
        return mask

    def _check(self, bgr: np.ndarray, region: Region | None = None) -> Region:
        if bgr.shape != (self.height, self.width, 3) or bgr.dtype != np.uint8:
            expected = f"uint8 ({self.height}, {self.width}, 3) as the background has"
            raise ValueError(f"expected an image of {expected}, got {bgr.dtype} {bgr.shape}")
        if region is None:
            return 0, 0, self.width, self.height
        u0, v0, u1, v1 = (int(x) for x in region)
        if not (0 <= u0 < u1 <= self.width and 0 <= v0 < v1 <= self.height):
            raise ValueError(f"expected a region (u0, v0, u1, v1) within {self.width} x {self.height}, got {tuple(region)}")
        return u0, v0, u1, v1


def _gradient_squared(mean: np.ndarray) -> np.ndarray:
    rows = np.gradient(mean, axis=0) if mean.shape[0] > 1 else np.zeros_like(mean)
    columns = np.gradient(mean, axis=1) if mean.shape[1] > 1 else np.zeros_like(mean)
    return (rows**2 + columns**2).mean(axis=2)


def without_specks(mask: np.ndarray, *, smallest_px: int = 0) -> np.ndarray:
    """A mask (h, w) uint8 without single pixels and pinholes, nor parts of fewer than ``smallest_px`` pixels."""
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, _CROSS)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _CROSS)
    if smallest_px > 1:
        _, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        keep = np.where(statistics[:, cv2.CC_STAT_AREA] >= smallest_px, np.uint8(255), np.uint8(0))
        keep[0] = 0
        mask = keep[labels]
    return mask
