"""Densities of color per class of parts, from what is learnt and what is stated: all classes of one camera in one call."""

from __future__ import annotations

import numba as nb
import numpy as np

from ..appearance import BINS, spread_counts

N_COLORS = BINS**3
UNIFORM = 1.0 / N_COLORS
_MIX = 0.02  # a little of every color: none is impossible
_LEAST_COUNT = 20  # pixels; fewer are not believed


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mix_counts(shares, counts, rate):
    """Mix new ``counts`` of colors (`N_COLORS`,) into their ``shares``; returns their number, or 0 if they are few.

    Both are float32, as is the ``rate``. Counts are summed as integers: those are summed side by side.
    """
    total = np.int32(0)
    for k in range(np.uint64(counts.size)):
        total += np.int32(counts[k])
    if total < _LEAST_COUNT:
        return 0
    old = np.float32(1.0) - rate if shares.any() else np.float32(0.0)
    new = (np.float32(1.0) - old) / np.float32(total)
    for k in range(np.uint64(shares.size)):
        shares[k] = old * shares[k] + new * counts[k]
    return total


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mix_classes(parts, counts, rate, kinds, support):
    """Mix new ``counts`` of every class into its ``parts`` (n_classes, `N_COLORS`).

    ``support`` (n_classes,) becomes the share of those pixels whose color is of the class's ``kinds`` (n_classes, `N_COLORS`)
    bool, where it has such and there are enough.
    """
    for i in range(len(parts)):
        total = mix_counts(parts[i], counts[i], rate)
        if total == 0 or not kinds[i].any():
            continue
        alike = np.int32(0)
        for k in range(np.uint64(N_COLORS)):
            alike += np.int32(counts[i, k]) * np.int32(kinds[i, k])
        support[i] = np.float32(alike) / np.float32(total)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_classes(parts, shades, stated, trusted, doubted, borne_out, prior_share, body):
    """Fill the densities ``body`` of what is learnt (``parts``), of ``shades``, and of what is ``stated``.

    Tables are (n_classes, `N_COLORS`) float32.
    Masks (n_classes,): shades count where a class is ``trusted`` to have them, and alone where what is learnt of it is
    ``doubted``; what is stated counts for ``prior_share`` where it is ``borne_out``.
    """
    for i in range(len(parts)):
        known, of_shades, of_stated = parts[i].any(), 0.0, 0.0  # shares
        if trusted[i] and shades[i].any():
            of_shades = 0.5 if known and not doubted[i] else 1.0
        if borne_out[i] and stated[i].any():
            of_stated = prior_share if known or of_shades > 0.0 else 1.0
        fill_density(parts[i], shades[i], of_shades, stated[i], of_stated, body[i])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_density(learnt, shades, of_shades, stated, of_stated, density):
    """The ``density`` of what is learnt and of shades, neighbouring colors sharing, of what is stated, and a little of all."""
    if of_shades == 0.0 and of_stated == 0.0 and not learnt.any():
        density[:] = UNIFORM
        return
    density[:] = np.float32(0.0)
    if of_shades < 1.0:
        spread_counts(learnt, density)
    if of_shades > 0.0:
        seen, share, rest = np.zeros_like(density), np.float32(of_shades), np.float32(1.0 - of_shades)
        spread_counts(shades, seen)
        for k in range(np.uint64(density.size)):
            density[k] = share * seen[k] + rest * density[k]
    both, prior = np.float32((1.0 - _MIX) * (1.0 - of_stated)), np.float32((1.0 - _MIX) * of_stated)
    for k in range(np.uint64(density.size)):
        density[k] = both * density[k] + prior * stated[k] + np.float32(_MIX * UNIFORM)
