"""From log-odds and grey values to the two distance maps that the contour residuals read."""

from __future__ import annotations

import cv2
import numpy as np


def signed_distance(mask: np.ndarray, truncation: float) -> np.ndarray:
    """Distance (float32, pixels) to the boundary of ``mask`` (uint8): positive outside, negative inside, truncated.

    The boundary runs midway between a body pixel and its neighbour outside.
    """
    outside = cv2.distanceTransform((mask == 0).astype(np.uint8), cv2.DIST_L2, 5)
    inside = cv2.distanceTransform((mask != 0).astype(np.uint8), cv2.DIST_L2, 5)
    distance = np.where(mask != 0, np.float32(0.5) - inside, outside - np.float32(0.5))
    return np.clip(distance, -truncation, truncation)


def edge_distance(
    gray: np.ndarray, mask: np.ndarray, low: float, high: float, truncation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (float32) to the nearest Canny edge inside the silhouette, truncated; and the edges (uint8)."""
    edges = cv2.Canny(gray, low, high)
    edges[cv2.dilate(mask, _CROSS) == 0] = 0
    distance = cv2.distanceTransform((edges == 0).astype(np.uint8), cv2.DIST_L2, 5)
    return np.minimum(distance, np.float32(truncation)), edges


_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
