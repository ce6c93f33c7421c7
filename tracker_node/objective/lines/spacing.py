"""How close to each other correspondence lines stand: neighbors see the same pixels, and share their errors."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from ...render.contour.samples import LINK, SHAPE
from .correspondence import LINE_U, LINE_V, PRECISION

_FARTHEST_PX = 25.0  # between neighbors on one contour
_MOST = 20.0
_OWN = 0.25  # share of a line's own variance that does not average out


@nb.njit(cache=True, nogil=True, error_model="numpy")
def add_crowding(lines, info, n, taken, found, length_px, sums):
    """Add one camera's lines to ``sums`` (n_links, 2): what they add to the scatter of a fit, and to its information.

    A line's weight goes by the variance ``taken`` (px^2) beside its own. What adds up in a fit is ``found`` (px^2), the variance
    of lines beyond their own, which averages out but for a quarter. To the scatter a line adds its weight squared times that,
    times how many lines share one error.

    The errors of lines that are s pixels apart on one contour are taken to have the correlation r = exp(-s / ``length_px``), for
    which (1 + r) / (1 - r) lines in a row weigh as much as a single one that is far from all others.
    """
    gaps = np.full(n + 1, -1.0)  # to the line before; negative: none
    last = -1
    for j in range(n):
        if lines[j, PRECISION] <= 0.0:
            continue
        if last >= 0 and info[j, SHAPE] == info[last, SHAPE]:
            gap = math.hypot(lines[j, LINE_U] - lines[last, LINE_U], lines[j, LINE_V] - lines[last, LINE_V])
            if gap < _FARTHEST_PX:
                gaps[j] = gap
        last = j
    after = -1.0
    for j in range(n - 1, -1, -1):
        if lines[j, PRECISION] <= 0.0:
            continue
        before = gaps[j]
        share = 1.0
        if before >= 0.0 or after >= 0.0:
            gap = 0.5 * (before + after) if before >= 0.0 and after >= 0.0 else max(before, after)
            r = math.exp(-gap / length_px)
            share = min((1.0 + r) / max(1.0 - r, 1e-9), _MOST)
        after = before
        weight = 1.0 / (1.0 / lines[j, PRECISION] + taken)
        sums[info[j, LINK], 0] += weight * weight * (found + _OWN / lines[j, PRECISION]) * share
        sums[info[j, LINK], 1] += weight
