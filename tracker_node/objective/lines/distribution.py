"""Where on a correspondence line the contour is: mean and variance over the places where it may be."""

from __future__ import annotations

import numba as nb
import numpy as np

from .colors import exp_negative
from .table import BEFORE, LOG_RATIO, LONGEST, MEAN, PRECISION

_NEGLIGIBLE = np.float32(20.0)  # a log-likelihood lower by this
_ZERO = np.float32(0.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})
def fit_distributions(odds, plan, n, half, scale, sharpness, lines):
    """Mean and precision of the contour's offset, and the log-ratio, of lines that have colors.

    Parameters
    ----------
    odds : (n, .) the pixels between -half and half; before them, where the part is so narrow that the line reaches across it
        wherever its contour may be, as many as it is wide.
    plan, n : (., `N_PLAN_COLUMNS`), the first ``n`` rows.
    half, scale : offsets are -half ... half places, ``scale`` pixels apart.
    sharpness : factor of the log-likelihoods, for pixels that are not independent.
    lines : (., `N_LINE_COLUMNS`), these three columns written, in pixels.
    """
    values, count = np.empty(LONGEST, dtype=np.float32), np.uint64(2 * half + 1)
    middle, factor = np.float32(half), np.float32(sharpness)
    uniform = half * (half + 1.0) / 3.0 + 1.0 / 12.0
    for j in range(n):
        width = plan[j, BEFORE]
        if width < 0:
            continue
        value = _ZERO
        for k in range(width):
            value += odds[j, k]
        values[0] = best = value
        narrow = width > 0
        for k in range(2 * half):
            value += odds[j, k + width] - odds[j, k] if narrow else odds[j, k]
            values[k + 1] = value
            best = max(best, value)
        mass, first, second = _ZERO, _ZERO, _ZERO
        for k in range(count):
            d = np.float32(np.int32(k)) - middle
            p = exp_negative(min(factor * (best - values[k]), _NEGLIGIBLE))
            mass += p
            first += p * d
            second += p * d * d
        mean = first / mass
        variance = max(second / mass - mean * mean, _ZERO) + 1.0 / 12.0
        # The limits of the line are a prior of their own, whose mean is zero: it is taken out again
        precision = 1.0 / variance - 1.0 / uniform
        if precision <= 0.02 / uniform:
            lines[j, MEAN], lines[j, PRECISION], lines[j, LOG_RATIO] = 0.0, 0.0, 0.0
            continue
        mean = mean / (variance * precision)
        none = _ZERO if narrow else max(values[0], values[2 * half])
        lines[j, MEAN] = scale * min(max(mean, -float(half)), float(half))
        lines[j, PRECISION] = precision / (scale * scale)
        lines[j, LOG_RATIO] = sharpness * (best - none)
