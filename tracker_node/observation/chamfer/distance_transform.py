"""Exact Euclidean distances to a mask, truncated, in pixels.

First along the columns (run lengths), then along the rows: D^2(u) = min over i of g^2(u + i) + i^2, g the distance within the
column (Saito & Toriwaki 1994). Truncation bounds i and lets squared distances fit into 16 bits, so that one vector instruction
serves many pixels; a stretch of pixels is done when no farther column can lower any of them.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from ...compiled.kernels import compiled

LARGEST_LIMIT = 181  # twice its square still fits into 16 bits
_STRETCH = 64  # pixels of a row that are worked on together
_STEPS = 4  # columns to either side that one pass over a stretch looks at
_u16 = np.uint16
_HALF = np.float32(0.5)


@compiled
def _first_down(above, here, features, cap):
    for u in range(here.size):
        run = _u16(above[u] + _u16(1))
        run = run if run < cap else cap
        here[u] = _u16(0) if features[u] else run


@compiled
def _then_up(below, here):
    for u in range(here.size):
        run = _u16(below[u] + _u16(1))
        here[u] = run if run < here[u] else here[u]


@compiled
def _square(row):
    for u in range(row.size):
        row[u] = _u16(row[u] * row[u])


@compiled
def _columns(features, limit, squares):
    """Squared distances within the columns, with margins of ``limit + _STEPS`` at which nothing is near."""
    height, width = features.shape
    cap, first = _u16(limit), limit + _STEPS
    last = first + width
    squares[:, :first] = _u16(limit * limit)
    squares[:, last:] = _u16(limit * limit)
    _first_down(np.full(width, cap, _u16), squares[0, first:last], features[0], cap)
    for v in range(1, height):
        _first_down(squares[v - 1, first:last], squares[v, first:last], features[v], cap)
    for v in range(height - 2, -1, -1):
        _then_up(squares[v + 1, first:last], squares[v, first:last])
        _square(squares[v + 1, first:last])
    _square(squares[0, first:last])


@compiled
def _look_aside(window, i, best):
    """Lower ``best`` by what lies i .. i + 3 columns to either side; ``window`` reaches equally far beyond it on both sides.

    Indices are unsigned: a signed index could be negative, and checking for that keeps the loop from being vectorized.
    """
    center = np.uint64((window.size - best.size) // 2)
    left1, right1 = center - np.uint64(i), center + np.uint64(i)
    left2, left3, left4 = left1 - np.uint64(1), left1 - np.uint64(2), left1 - np.uint64(3)
    right2, right3, right4 = right1 + np.uint64(1), right1 + np.uint64(2), right1 + np.uint64(3)
    far1, far2, far3, far4 = _u16(i * i), _u16((i + 1) ** 2), _u16((i + 2) ** 2), _u16((i + 3) ** 2)
    for k in range(np.uint64(best.size)):
        p, q = window[left1 + k], window[right1 + k]
        a = _u16((p if p < q else q) + far1)
        p, q = window[left2 + k], window[right2 + k]
        b = _u16((p if p < q else q) + far2)
        p, q = window[left3 + k], window[right3 + k]
        c = _u16((p if p < q else q) + far3)
        p, q = window[left4 + k], window[right4 + k]
        d = _u16((p if p < q else q) + far4)
        a = a if a < b else b
        c = c if c < d else d
        x = best[k]
        x = a if a < x else x
        best[k] = c if c < x else x


@compiled
def _largest(values):
    result = _u16(0)
    for k in range(values.size):
        result = values[k] if values[k] > result else result
    return result


@compiled
def _smallest(values):
    result = _u16(65535)
    for k in range(values.size):
        result = values[k] if values[k] < result else result
    return result


@compiled
def _stretch(squares, start, limit, best):
    """Squared distances of the stretch of a row that starts at pixel ``start``."""
    reach = limit + _STEPS
    window = squares[start : start + best.size + 2 * reach]
    for k in range(best.size):
        best[k] = window[reach + k]
    lowest = int(_smallest(window))
    for i in range(1, limit, _STEPS):
        if i * i + lowest >= _largest(best):
            return
        _look_aside(window, i, best)


@compiled
def _rows(squares, limit, truncation, out):
    best = np.empty(_STRETCH, _u16)
    for v in range(out.shape[0]):
        for start in range(0, out.shape[1], _STRETCH):
            _stretch(squares[v], start, limit, best)
            part = out[v, start : start + _STRETCH]
            for k in range(part.size):
                distance = np.sqrt(np.float32(best[k]))
                part[k] = distance if distance < truncation else truncation


@compiled
def _rows_signed(outside, inside, limit, truncation, out):
    best_outside, best_inside = np.empty(_STRETCH, _u16), np.empty(_STRETCH, _u16)
    for v in range(out.shape[0]):
        for start in range(0, out.shape[1], _STRETCH):
            _stretch(outside[v], start, limit, best_outside)
            _stretch(inside[v], start, limit, best_inside)
            part = out[v, start : start + _STRETCH]
            for k in range(part.size):
                away, deep = np.sqrt(np.float32(best_outside[k])), np.sqrt(np.float32(best_inside[k]))
                value = away - _HALF if away > np.float32(0.0) else _HALF - deep
                value = value if value < truncation else truncation
                part[k] = value if value > -truncation else -truncation


def distance_to(mask: np.ndarray, truncation_px: float) -> np.ndarray:
    """Distance from every pixel's center to the nearest nonzero pixel's center.

    Parameters
    ----------
    mask : (h, w) uint8 or bool; beyond its border nothing is near.
    truncation_px : largest distance.

    Returns
    -------
    (h, w) float32, pixels; 0 on the mask.
    """
    mask = _checked(mask)
    limit = math.ceil(truncation_px)
    if limit > LARGEST_LIMIT:
        distance = cv2.distanceTransform((mask == 0).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        return np.minimum(distance, np.float32(truncation_px))
    out = np.empty(mask.shape, dtype=np.float32)
    _rows(_column_squares(mask, limit), limit, np.float32(truncation_px), out)
    return out


def signed_distance(mask: np.ndarray, truncation_px: float) -> np.ndarray:
    """Distance to the boundary of a mask, positive outside, negative inside.

    The boundary runs midway between a pixel of the mask and its neighbor outside. An empty or full mask has none: the whole map
    is truncated.

    Parameters
    ----------
    mask : (h, w) uint8 or bool.
    truncation_px : largest distance to either side.

    Returns
    -------
    (h, w) float32, pixels.
    """
    mask = _checked(mask)
    truncation, limit = np.float32(truncation_px), math.ceil(truncation_px + 0.5)
    rest = (mask == 0).view(np.uint8)
    if limit > LARGEST_LIMIT:
        away = distance_to(mask, 2.0 * truncation_px) - _HALF
        return np.clip(np.where(mask, _HALF - distance_to(rest, 2.0 * truncation_px), away), -truncation, truncation)
    out = np.empty(mask.shape, dtype=np.float32)
    _rows_signed(_column_squares(mask, limit), _column_squares(rest, limit), limit, truncation, out)
    return out


def _column_squares(mask: np.ndarray, limit: int) -> np.ndarray:
    padded = -(-mask.shape[1] // _STRETCH) * _STRETCH
    squares = np.empty((mask.shape[0], padded + 2 * (limit + _STEPS)), dtype=np.uint16)
    _columns(mask, limit, squares)
    return squares


def _checked(mask: np.ndarray) -> np.ndarray:
    if mask.ndim != 2 or mask.dtype not in (np.uint8, np.bool_) or 0 in mask.shape:
        raise ValueError(f"expected a mask (h, w) of uint8 or bool, got {mask.dtype} {mask.shape}")
    return np.ascontiguousarray(mask).view(np.uint8)
