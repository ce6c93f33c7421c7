"""The minimum of a convex quadratic in a box, exactly: the step of an optimizer whose variables have limits.

Block principal pivoting: guess which variables are at which limit, solve for the others, and correct the guess where the
solution passes a limit or a multiplier pulls back inside, all at once. This takes two or three solutions where limits matter
and one where they do not; in the rare case that it goes round in circles, the corrections are made one at a time, which ends
always for a positive definite matrix (Judice & Pires 1994, A block principal pivoting algorithm for large-scale strictly
monotone linear complementarity problems, Computers & Operations Research 21, 587-596).
"""

from __future__ import annotations

import numba as nb
import numpy as np

_FREE, _LOWER, _UPPER = 0, 1, 2


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _solve_free(H, g, sides, lower, upper, x, factor):
    """Fill ``x`` with the minimum over the free variables, the others at their limits. Cholesky on the free block, in place of
    ``factor``. False where the block is not positive definite."""
    n = g.size
    free = np.empty(n, dtype=np.int64)
    count = 0
    for i in range(n):
        if sides[i] == _FREE:
            free[count] = i
            count += 1
        else:
            x[i] = lower[i] if sides[i] == _LOWER else upper[i]
    for a in range(count):
        i = free[a]
        value = -g[i]
        for j in range(n):
            if sides[j] != _FREE:
                value -= H[i, j] * x[j]
        x[i] = value
        for b in range(a + 1):
            total = H[i, free[b]]
            for c in range(b):
                total -= factor[a, c] * factor[b, c]
            if a == b:
                if not total > 0.0:
                    return False
                factor[a, a] = np.sqrt(total)
            else:
                factor[a, b] = total / factor[b, b]
    for a in range(count):
        value = x[free[a]]
        for c in range(a):
            value -= factor[a, c] * x[free[c]]
        x[free[a]] = value / factor[a, a]
    for a in range(count - 1, -1, -1):
        value = x[free[a]]
        for c in range(a + 1, count):
            value -= factor[c, a] * x[free[c]]
        x[free[a]] = value / factor[a, a]
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _wanted_side(i, H, g, sides, lower, upper, x, slack):
    """Where variable ``i`` belongs after a solution: beyond a limit it goes there, at one whose multiplier pulls inside it is
    set free."""
    if sides[i] == _FREE:
        if x[i] < lower[i] - slack * max(1.0, abs(lower[i])):
            return _LOWER
        if x[i] > upper[i] + slack * max(1.0, abs(upper[i])):
            return _UPPER
        return _FREE
    pull, scale = g[i], abs(g[i])
    for j in range(g.size):
        pull += H[i, j] * x[j]
        scale += abs(H[i, j] * x[j])
    if sides[i] == _LOWER and pull < -slack * scale:
        return _FREE
    if sides[i] == _UPPER and pull > slack * scale:
        return _FREE
    return sides[i]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def minimize_quadratic(H, g, lower, upper, x, patience=10):
    """Minimum of 2 g.x + x.H x over lower <= x <= upper.

    Parameters
    ----------
    H, g : (n, n) symmetric, and (n,).
    lower, upper : (n,); infinite where there is no limit.
    x : (n,), overwritten with the minimum.
    patience : rounds without fewer corrections before they are made singly.

    Returns
    -------
    How many linear systems were solved; -1 where ``H`` is not positive definite.
    """
    n = g.size
    sides, factor = np.zeros(n, dtype=np.int64), np.empty((n, n))
    wanted = np.empty(n, dtype=np.int64)
    fewest, left, solutions = n + 1, patience, 0
    while True:
        if not _solve_free(H, g, sides, lower, upper, x, factor):
            return -1
        solutions += 1
        changes, last = 0, -1
        for i in range(n):
            wanted[i] = _wanted_side(i, H, g, sides, lower, upper, x, 1e-12)
            if wanted[i] != sides[i]:
                changes, last = changes + 1, i
        if changes == 0 or solutions > 50 * n:
            break
        if changes < fewest:
            fewest, left = changes, patience
        else:
            left -= 1
        if left > 0:
            sides[:] = wanted
        else:
            sides[last] = wanted[last]
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    return solutions
