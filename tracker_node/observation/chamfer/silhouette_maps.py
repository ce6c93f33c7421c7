"""From log-odds and grey values to the two distance maps that the contour residuals read."""

from __future__ import annotations

import cv2
import numpy as np

from .distance_transform import distance_to


def edge_distance(
    gray: np.ndarray, mask: np.ndarray, low: float, high: float, truncation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (float32) to the nearest Canny edge inside the silhouette, truncated; and the edges (uint8)."""
    edges = cv2.Canny(gray, low, high)
    edges[cv2.dilate(mask, _CROSS) == 0] = 0
    return distance_to(edges, truncation), edges


_SHORTEST = 20  # pixels: shorter boundaries are specks
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


def boundary_points(mask: np.ndarray, distance: np.ndarray, trusted: np.ndarray, step: int) -> np.ndarray:
    """Points of the boundary of ``mask`` with their outward normals: (n, 4) float32 (u, v, nu, nv), one in ``step`` pixels.

    ``distance`` is the mask's signed distance; points where ``trusted`` (uint8) is zero, or at the border of the crop, are left
    out.
    """
    contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    kept = [contour[::step, 0, :] for contour in contours if len(contour) >= _SHORTEST]
    if not kept:
        return np.zeros((0, 4), dtype=np.float32)
    points = np.concatenate(kept)
    u, v = points[:, 0], points[:, 1]
    height, width = mask.shape
    inside = (u > 2) & (v > 2) & (u < width - 3) & (v < height - 3)
    u, v = u[inside], v[inside]
    usable = trusted[v, u] != 0
    u, v = u[usable], v[usable]
    # Slope over two pixels to each side: a mask's staircase has no better normal
    nu, nv = distance[v, u + 2] - distance[v, u - 2], distance[v + 2, u] - distance[v - 2, u]
    norm = np.hypot(nu, nv)
    good = norm > 1.0
    u, v, nu, nv, norm = u[good], v[good], nu[good], nv[good], norm[good]
    nu, nv = nu / norm, nv / norm
    # The boundary runs half a pixel outside the last body pixel
    return np.column_stack([u + 0.5 * nu, v + 0.5 * nv, nu, nv]).astype(np.float32)
