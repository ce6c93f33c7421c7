"""Lines across inner edges: where, between two faces of one part, the brightness changes.

Both faces have the part's color, so no color distribution separates them; but light falls on them differently. A line
across their edge is explained by two mean colors with a step between them: the squared error of that, for every place of the
step, over the variance of what is left is the log-likelihood of the place.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

LEAST_PIXELS = 3  # on either side of a step
_LEAST_VARIANCE = 9.0  # gray levels squared, per channel
_LEAST_GAIN = 10.0  # log-likelihood by which a step must beat none
_MIXED = 0.25  # variance, in places: the pixel that shows both sides may count for either
_NEGLIGIBLE = -20.0  # log-likelihood
ERROR = 4  # column of the squared error of a step there, behind the running sums of three colors and of their squares
N_SUM_COLUMNS = 5


@nb.njit(cache=True, nogil=True, error_model="numpy")
def step_distribution(bgr, u, v, nu, nv, scale, inside, outside, sums):
    """Offset of a step in brightness along a line.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    u, v, nu, nv : pixel and direction of the line.
    scale : pixels from one place of the line to the next.
    inside, outside : places before (u, v), and beyond it; the step leaves `LEAST_PIXELS` on either side.
    sums : (>= inside + outside + 1, `N_SUM_COLUMNS`), overwritten.

    Returns
    -------
    Mean and precision, in places, and log-ratio; a precision of zero: no step.
    """
    height, width, n = bgr.shape[0], bgr.shape[1], inside + outside
    low, high = LEAST_PIXELS - inside, outside - LEAST_PIXELS
    if high - low < 2 or low > 0 or high < 0:  # a face so narrow that the step would be searched beside it
        return 0.0, 0.0, 0.0
    for c in range(ERROR):
        sums[0, c] = 0.0
    for k in range(n):
        t = (k + 0.5 - inside) * scale
        i, j = int(math.floor(v + t * nv + 0.5)), int(math.floor(u + t * nu + 0.5))  # noqa: RUF046
        if not (0 <= i < height and 0 <= j < width):
            return 0.0, 0.0, 0.0
        b, g, r = np.float64(bgr[i, j, 0]), np.float64(bgr[i, j, 1]), np.float64(bgr[i, j, 2])
        sums[k + 1, 0], sums[k + 1, 1], sums[k + 1, 2] = sums[k, 0] + b, sums[k, 1] + g, sums[k, 2] + r
        sums[k + 1, 3] = sums[k, 3] + b * b + g * g + r * r
    b, g, r = sums[n, 0], sums[n, 1], sums[n, 2]
    best, of_one = 1e30, sums[n, 3] - (b * b + g * g + r * r) / n
    for place in range(inside + low, inside + high + 1):
        before_b, before_g, before_r = sums[place, 0], sums[place, 1], sums[place, 2]
        b, g, r = sums[n, 0] - before_b, sums[n, 1] - before_g, sums[n, 2] - before_r
        error = sums[n, 3] - (before_b * before_b + before_g * before_g + before_r * before_r) / place
        error -= (b * b + g * g + r * r) / (n - place)  # of two mean colors
        sums[place, ERROR] = error
        best = min(best, error)
    variance = max(_LEAST_VARIANCE, best / (3.0 * n - 6.0))
    gain = 0.5 * (of_one - best) / variance
    if gain < _LEAST_GAIN:
        return 0.0, 0.0, 0.0
    mass, first, second = 0.0, 0.0, 0.0
    for d in range(low, high + 1):
        exponent = 0.5 * (best - sums[inside + d, ERROR]) / variance
        if exponent < _NEGLIGIBLE:
            continue
        p = math.exp(exponent)
        mass += p
        first += p * d
        second += p * d * d
    mean, middle = first / mass, 0.5 * (low + high)
    spread, uniform = max(second / mass - mean * mean, 0.0) + _MIXED, ((high - low + 1.0) ** 2) / 12.0
    precision = 1.0 / spread - 1.0 / uniform  # that the line ends somewhere is no evidence
    if precision <= 0.02 / uniform:
        return 0.0, 0.0, 0.0
    mean = (mean / spread - middle / uniform) / precision
    return min(max(mean, float(low)), float(high)), precision, gain
