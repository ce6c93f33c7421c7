"""The V-algorithm (Trewartha, Yeadon & Knight): where two straight flanks of a score meet.

Around its minimum the score of a colored body falls and rises about linearly, so the minimum lies where the line through two
points on the falling side meets the line through two on the rising side; that puts an estimate between the steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence


def intersection(x: Sequence[float], f: Sequence[float]) -> float | None:
    """Where the line through the first two of four points meets the line through the last two.

    Parameters
    ----------
    x, f : (4,) places in the order of the walk (rising or falling alike), and their scores.

    Returns
    -------
    The place; None unless the first pair falls, the second rises, and they meet between the outer points.
    """
    if not (math.isfinite(f[0]) and math.isfinite(f[3]) and f[1] < f[0] and f[3] > f[2]):
        return None
    falling, rising = (f[1] - f[0]) / (x[1] - x[0]), (f[3] - f[2]) / (x[3] - x[2])
    place = (f[2] - f[1] + falling * x[1] - rising * x[2]) / (falling - rising)
    return place if min(x[0], x[3]) < place < max(x[0], x[3]) else None


def vertex(x: Sequence[float], f: Sequence[float]) -> float | None:
    """The refined minimum of a walk; None where the points around the lowest do not make a V.

    The lowest point and the one before it are the falling pair, the two after it the rising one: the last two pairs of a walk
    that two increases have ended. Exact where the vertex lies behind the lowest point; else they meet in that point itself.

    Parameters
    ----------
    x, f : (n,) places in the order of the walk, and their scores.
    """
    k = min(range(len(f)), key=f.__getitem__)
    return intersection(x[k - 1 : k + 3], f[k - 1 : k + 3]) if 1 <= k <= len(f) - 3 else None
