"""How close to each other correspondence lines stand: neighbors see the same pixels, so their errors are correlated."""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import compiled
from ...render.contour.samples import LINK, SHAPE
from .correspondence import LINE_U, LINE_V, PRECISION

_FARTHEST_PX = 25.0  # between neighbors on one contour
_MOST = 20.0
_OWN = 0.25  # fraction of a line's own variance that does not average out


@compiled
def add_correlated(lines, info, n, taken, found, length_px, sums):
    """Add what one camera's lines contribute to the scatter of a fit, and to its information.

    A line's weight goes by its own variance plus ``taken``. What adds up in a fit is ``found`` and a quarter of the line's own.
    To the scatter a line adds its weight squared times that, times how many lines have one error in common.

    The errors of lines that are s pixels apart on one contour are taken to have the correlation r = exp(-s / ``length_px``), for
    which (1 + r) / (1 - r) lines in a row weigh as much as a single one that is far from all others.

    Parameters
    ----------
    lines, info, n : (., `N_LINE_COLUMNS`) and (., `N_INFO_COLUMNS`), the first ``n`` rows.
    taken, found : pixels^2, variance of lines beyond their own: that of the weights, and that which is observed.
    length_px : of the correlation along a contour.
    sums : (n_links, 2), added to.
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
