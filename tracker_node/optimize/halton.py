"""Points spread evenly in the unit cube.

As ``scipy.stats.qmc.Halton`` gives them, to the last bit, without the third of a second that `scipy.stats` takes to be imported.
"""

from __future__ import annotations

import numpy as np

_BITS = 54  # digits beyond these change no double


def scrambled_halton(n: int, n_dims: int, seed: int) -> np.ndarray:
    """The first ``n`` points (n, n_dims) of a Halton sequence whose digits are permuted at random (Owen, arXiv:1706.02808)."""
    rng = np.random.default_rng(seed)
    return np.stack([_radical_inverses(n, base, _permutations(base, rng)) for base in _primes(n_dims)], axis=1)


def _primes(count: int) -> list[int]:
    primes: list[int] = []
    candidate = 2
    while len(primes) < count:
        if all(candidate % prime for prime in primes):
            primes.append(candidate)
        candidate += 1
    return primes


def _permutations(base: int, rng: np.random.Generator) -> np.ndarray:
    """(n_digits, base), of the values of each digit."""
    rows = np.tile(np.arange(base), (int(np.ceil(_BITS / np.log2(base))) - 1, 1))
    for row in rows:
        rng.shuffle(row)
    return rows


def _radical_inverses(n: int, base: int, permutations: np.ndarray) -> np.ndarray:
    """(n,) of 0, 1, 2 ...: their digits behind the point, in opposite order and permuted."""
    left, weight, inverses = np.arange(n), 1.0 / base, np.zeros(n)
    for permutation in permutations:
        inverses += permutation[left % base] * weight
        weight /= base
        left //= base
    return inverses
