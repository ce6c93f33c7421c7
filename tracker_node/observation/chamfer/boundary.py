"""Boundary of a silhouette: its points with their normals, where it runs to a fraction of a pixel, and the edges within it.

A pixel that body and background share differs from the background, so a silhouette takes it for body although the body covers
only some of it: silhouettes are too large, by more where the contrast is strong. The fraction of a pixel I that the body covers
is alpha = (I - B) (F - B) / |F - B|^2, with the body's color F taken a little inside, and the background's B from its image, as
bright as it is a little outside (shadows). Summed along the normal it says how far off the boundary is.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...compiled.kernels import compiled
from .distance_transform import distance_to

_INSIDE = (2.0, 3.0)  # pixels from the boundary where the body's color is read
_OUTSIDE = (3.0, 4.0)
_REACH = 2  # fractions are summed from so many pixels inside to as many outside
_LEAST_CONTRAST = 25.0  # gray levels (of all channels) between body and background; below, a boundary is left where it is
_BRIGHTNESS = (0.5, 1.15)  # the background beside the body, as a multiple of its image
_LARGEST_SHIFT = 1.5


@compiled
def _read(image, u, v, color):
    """Bilinear sample of (h, w, 3); the caller sees to it that (u, v) is inside."""
    j, i = int(u), int(v)
    a, b = u - j, v - i
    for c in range(3):
        top = (1.0 - a) * image[i, j, c] + a * image[i, j + 1, c]
        bottom = (1.0 - a) * image[i + 1, j, c] + a * image[i + 1, j + 1, c]
        color[c] = (1.0 - b) * top + b * bottom


@compiled
def _shifts(image, scene, known, points, inside, outside, result):
    height, width = image.shape[0], image.shape[1]
    far = outside[1] + 1.0
    body, beside, empty, pixel = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(points.shape[0]):
        u, v, nu, nv = points[k, 0], points[k, 1], points[k, 2], points[k, 3]
        result[k, 0], result[k, 1] = 0.0, 0.0
        if u < far or v < far or u > width - 1 - far or v > height - 1 - far:
            continue
        _read(image, u - inside[0] * nu, v - inside[0] * nv, body)
        _read(image, u - inside[1] * nu, v - inside[1] * nv, pixel)
        body[:] = 0.5 * (body + pixel)
        _read(image, u + outside[0] * nu, v + outside[0] * nv, beside)
        _read(image, u + outside[1] * nu, v + outside[1] * nv, pixel)
        beside[:] = 0.5 * (beside + pixel)
        has_scene = known[int(v), int(u)] != 0
        brightness = 1.0
        if has_scene:
            _read(scene, u + 0.5 * (outside[0] + outside[1]) * nu, v + 0.5 * (outside[0] + outside[1]) * nv, empty)
            brightness = np.dot(beside, empty) / max(np.dot(empty, empty), 1.0)
            brightness = min(max(brightness, _BRIGHTNESS[0]), _BRIGHTNESS[1])
        covered, contrast = 0.0, 0.0
        for step in range(-_REACH, _REACH + 1):
            if has_scene:
                _read(scene, u + step * nu, v + step * nv, empty)
                empty *= brightness
            else:
                empty[:] = beside
            _read(image, u + step * nu, v + step * nv, pixel)
            along, square = 0.0, 0.0
            for c in range(3):
                difference = body[c] - empty[c]
                along += (pixel[c] - empty[c]) * difference
                square += difference * difference
            covered += min(max(along / max(square, 1.0), 0.0), 1.0)
            if step == 0:
                contrast = square
        if contrast >= _LEAST_CONTRAST**2:
            shift = covered - (_REACH + 0.5)
            result[k, 0] = min(max(shift, -_LARGEST_SHIFT), _LARGEST_SHIFT)
            result[k, 1] = 1.0


@compiled
def _scatter(points, shifts, weights, sums, total):
    for k in range(points.shape[0]):
        j = min(max(int(points[k, 0] + 0.5), 0), sums.shape[1] - 1)
        i = min(max(int(points[k, 1] + 0.5), 0), sums.shape[0] - 1)
        sums[i, j] += shifts[k] * weights[k]
        total[i, j] += weights[k]


@compiled
def _divide(sums, total):
    for i in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            sums[i, j] = sums[i, j] / total[i, j] if total[i, j] > 0.5 else np.float32(0.0)


def boundary_shifts(
    bgr: np.ndarray, scene: np.ndarray | None, known: np.ndarray | None, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How far each point of a silhouette's boundary is to be moved along its outward normal, pixels.

    Parameters
    ----------
    bgr : (h, w, 3) uint8 crop of the image.
    scene, known : the background (h, w, 3) float32 on the same crop, and where it is known (h, w) uint8; or None.
    points : (n, 4) float32 u, v and unit outward normal, in pixels of the crop.

    Returns
    -------
    shifts (n,) and weights (n,), float32: 0 where body and background differ too little.
    """
    result = np.empty((len(points), 2), dtype=np.float32)
    if scene is None or known is None:
        scene, known = np.zeros((1, 1, 3), dtype=np.float32), np.zeros(bgr.shape[:2], dtype=np.uint8)
    _shifts(bgr, scene, known, np.ascontiguousarray(points, dtype=np.float32), _INSIDE, _OUTSIDE, result)
    return result[:, 0], result[:, 1]


def shift_map(points: np.ndarray, shifts: np.ndarray, weights: np.ndarray, shape: tuple[int, int], window: int = 9) -> np.ndarray:
    """Shifts spread to the pixels around.

    Subtracted from a signed distance (positive outside) they move the boundary; neighbors share their noise.

    Parameters
    ----------
    points : (n, 4) float32 of `boundary_shifts`.
    shifts, weights : (n,) of `boundary_shifts`.
    shape : (h, w) of the crop.
    window : width of the square over which shifts are averaged, pixels.

    Returns
    -------
    (h, w) float32 pixels, 0 where there is no boundary near.
    """
    sums, total = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
    _scatter(np.ascontiguousarray(points, dtype=np.float32), shifts, weights, sums, total)
    sums = np.asarray(cv2.boxFilter(sums, -1, (window, window), normalize=False), dtype=np.float32)
    total = np.asarray(cv2.boxFilter(total, -1, (window, window), normalize=False), dtype=np.float32)
    _divide(sums, total)
    return sums


def edge_distance(
    gray: np.ndarray, mask: np.ndarray, low: float, high: float, truncation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the nearest Canny edge inside the silhouette.

    Parameters
    ----------
    gray : (h, w) uint8.
    mask : (h, w) uint8 silhouette, 0 or 1.
    low, high : thresholds of Canny's hysteresis.
    truncation : largest distance, pixels.

    Returns
    -------
    distance : (h, w) float32, pixels.
    edges : (h, w) uint8, 255 on an edge.
    """
    edges = cv2.Canny(gray, low, high)
    edges[cv2.dilate(mask, _CROSS) == 0] = 0
    return distance_to(edges, truncation), edges


_SHORTEST = 20  # pixels: shorter boundaries are specks
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


def boundary_points(mask: np.ndarray, distance: np.ndarray, trusted: np.ndarray, step: int) -> np.ndarray:
    """Points of the boundary of a mask with their outward normals.

    Parameters
    ----------
    mask : (h, w) uint8, 0 or 1.
    distance : (h, w) float32, its signed distance, pixels.
    trusted : (h, w) uint8; points where it is zero, or at the border of the crop, are left out.
    step : one point in so many pixels along the boundary.

    Returns
    -------
    (n, 4) float32 (u, v, nu, nv).
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
