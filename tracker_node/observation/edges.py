"""Image edges inside a silhouette, in a region of the image."""

from __future__ import annotations

import cv2
import numpy as np

Region = tuple[int, int, int, int]  # u0, v0, u1, v1; the last two exclusive

_FRAME = 3  # pixels around the region that the edge detector also looks at, so that the region's border is no border
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


def gray_gradient(bgr: np.ndarray, region: Region) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the gray image along u and v, int16 (h, w) of ``region``, in eight grey levels per pixel (3x3 Sobel)."""
    (x, y), inner = _framed_gradient(bgr, region)
    return x[inner], y[inner]


def find_edges(
    bgr: np.ndarray, region: Region, low: float, high: float, inside: np.ndarray | None = None, grow_px: int = 1
) -> np.ndarray:
    """Canny edges (h, w) uint8, 0 or 255, of ``region``.

    Parameters
    ----------
    bgr : (height, width, 3) uint8, the whole image.
    low, high : hysteresis thresholds on |gradient|_1 of a 3x3 Sobel filter, as cv2.Canny has them.
    inside : (h, w) uint8 on the region, nonzero where edges are wanted; None: everywhere.
    grow_px : by how much ``inside`` is grown (negative: shrunk) first, so that its own outline counts (or does not).

    Raises
    ------
    ValueError : a region beyond the image, or a mask of another size than the region.
    """
    (x, y), inner = _framed_gradient(bgr, region)
    edges = cv2.Canny(x, y, low, high)[inner]
    if inside is None:
        return edges
    if inside.shape != edges.shape:
        raise ValueError(f"expected a mask of the region's shape {edges.shape}, got {inside.shape}")
    if grow_px > 0:
        inside = cv2.dilate(inside, _CROSS, iterations=grow_px)
    elif grow_px < 0:
        inside = cv2.erode(inside, _CROSS, iterations=-grow_px, borderValue=0)
    return cv2.copyTo(edges, inside)


def _framed_gradient(bgr: np.ndarray, region: Region) -> tuple[tuple[np.ndarray, np.ndarray], tuple[slice, slice]]:
    u0, v0, u1, v1 = region
    height, width = bgr.shape[:2]
    if not (0 <= u0 < u1 <= width and 0 <= v0 < v1 <= height):
        raise ValueError(f"expected a region (u0, v0, u1, v1) within {width} x {height}, got {tuple(region)}")
    left, top = max(0, u0 - _FRAME), max(0, v0 - _FRAME)
    framed = bgr[top : min(height, v1 + _FRAME), left : min(width, u1 + _FRAME)]
    gray = cv2.cvtColor(framed, cv2.COLOR_BGR2GRAY)
    x, y = cv2.spatialGradient(gray, ksize=3, borderType=cv2.BORDER_REPLICATE)
    return (x, y), (slice(v0 - top, v1 - top), slice(u0 - left, u1 - left))
