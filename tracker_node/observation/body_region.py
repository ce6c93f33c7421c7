"""The part of an image that is looked at, and masks grown or shrunk from a body mask."""

from __future__ import annotations

import cv2
import numpy as np

Region = tuple[int, int, int, int]  # u0, v0, u1, v1; the last two exclusive


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
