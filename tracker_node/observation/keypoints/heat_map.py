"""Points and their covariances from the heat maps of a network."""

from __future__ import annotations

import numba as nb
import numpy as np

_LEAST = 0.05  # cells^2: a map cannot tell a place more finely
_REACH = 3  # cells around a point that have a say, on either side (as the network's own decoder does)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def read_heat_maps(logits, points, means, covariances, peaks):
    """Mean and second moments of each map around a first guess.

    Parameters
    ----------
    logits : (height, width, n) float32, log odds of a cell to hold the point.
    points : (n, 2) first guess, cells.
    means : (n, 2) cells, overwritten.
    covariances : (n, 2, 2) cells^2 of the map around its mean, overwritten.
    peaks : (n,) largest probability there, overwritten; 0 where the guess is off the map.
    """
    height, width, n = logits.shape
    for k in range(n):
        column, row = int(np.floor(points[k, 0] + 0.5)), int(np.floor(points[k, 1] + 0.5))
        total, x, y, xx, xy, yy, peak = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(max(row - _REACH, 0), min(row + _REACH + 1, height)):
            for j in range(max(column - _REACH, 0), min(column + _REACH + 1, width)):
                p = 1.0 / (1.0 + np.exp(-np.float64(logits[i, j, k])))
                peak = max(peak, p)
                total, x, y = total + p, x + p * j, y + p * i
                xx, xy, yy = xx + p * j * j, xy + p * i * j, yy + p * i * i
        peaks[k] = peak
        means[k, 0], means[k, 1] = points[k, 0], points[k, 1]
        covariances[k] = np.eye(2) * (_REACH * _REACH)
        if total > 0.0:
            x, y = x / total, y / total
            means[k, 0], means[k, 1] = x, y
            covariances[k, 0, 0] = max(xx / total - x * x, 0.0) + _LEAST
            covariances[k, 1, 1] = max(yy / total - y * y, 0.0) + _LEAST
            covariances[k, 0, 1] = xy / total - x * y
            covariances[k, 1, 0] = covariances[k, 0, 1]
