"""Where in an image the body is expected: a rectangle, and masks grown or shrunk from a body mask."""

from __future__ import annotations

import cv2
import numpy as np

Region = tuple[int, int, int, int]  # u0, v0, u1, v1; the last two exclusive


def region_around(pixels: np.ndarray, valid: np.ndarray, margin: int, width: int, height: int) -> Region | None:
    """Rectangle around the valid pixels (n, 2), grown by ``margin`` and clipped to the image; None if next to nothing is left."""
    if not valid.any():
        return None
    low, high = pixels[valid].min(axis=0) - margin, pixels[valid].max(axis=0) + margin
    u0, v0 = max(0, int(np.floor(low[0]))), max(0, int(np.floor(low[1])))
    u1, v1 = min(width, int(np.ceil(high[0])) + 1), min(height, int(np.ceil(high[1])) + 1)
    if u1 - u0 < 8 or v1 - v0 < 8:
        return None
    return u0, v0, u1, v1


def grown(mask: np.ndarray, reach: int) -> np.ndarray:
    """Mask (uint8, 0 or 1) of the pixels within about ``reach`` of ``mask``; computed at a quarter of the size."""
    height, width = mask.shape
    size = max(1, width // 4), max(1, height // 4)
    small = cv2.resize((mask > 0).view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA)
    step = max(1, round(reach / 4))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * step + 1, 2 * step + 1))
    small = cv2.dilate((small > 0).astype(np.uint8), kernel)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_NEAREST)


def shrunk(labels: np.ndarray, depth: int) -> np.ndarray:
    """Part labels (uint8) without the pixels within ``depth`` of the outside of the body."""
    size = 2 * depth + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    inside = cv2.erode((labels > 0).astype(np.uint8), kernel, borderValue=0)
    return labels * inside
