"""The V-algorithm (Trewartha, Yeadon & Knight): where two straight flanks of a score meet.

Around its minimum the score of a colored body falls and rises about linearly, so the minimum lies where the line through two
points on the falling side meets the line through two on the rising side; that puts an estimate between the steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

PAIRS = ("last", "sided")


def intersection(x: Sequence[float], f: Sequence[float]) -> tuple[float, float] | None:
    """Where the line through the first two of four points meets the line through the last two.

    Parameters
    ----------
    x, f : (4,) places in the order of the walk (rising or falling alike), and their scores.

    Returns
    -------
    The place and its height; None unless the first pair falls, the second rises, and they meet between the outer points.
    """
    if not (math.isfinite(f[0]) and math.isfinite(f[3]) and f[1] < f[0] and f[3] > f[2]):
        return None
    falling, rising = (f[1] - f[0]) / (x[1] - x[0]), (f[3] - f[2]) / (x[3] - x[2])
    place = (f[2] - f[1] + falling * x[1] - rising * x[2]) / (falling - rising)
    return (place, f[1] + falling * (place - x[1])) if min(x[0], x[3]) < place < max(x[0], x[3]) else None


def vertex(x: Sequence[float], f: Sequence[float], pairs: str = "last") -> float | None:
    """The refined minimum of a walk; None where the points around the lowest do not make a V.

    Parameters
    ----------
    x, f : (n,) places in the order of the walk, and their scores.
    pairs : ``last``, as published: the lowest point and the one before it, and the two after it, which are the last two pairs of
        a walk that ends with two increases. Exact where the vertex lies behind the lowest point; else it gives that point again.
        ``sided``: also with the lowest point as the first of the rising pair, whichever meets lower; exact either way.
    """
    k = min(range(len(f)), key=f.__getitem__)
    found = []
    for first in (k - 1,) if pairs == "last" else (k - 1, k - 2):
        if 0 <= first <= len(f) - 4:
            found.append(intersection(x[first : first + 4], f[first : first + 4]))
    meetings = [meeting for meeting in found if meeting is not None]
    return min(meetings, key=lambda meeting: meeting[1])[0] if meetings else None
