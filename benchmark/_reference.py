"""One fixed kernel, timed beside every figure in milliseconds: what a figure is worth on another machine is their ratio.

It must never change, or figures of different days can no longer be compared.
"""

from __future__ import annotations

import time

import numba as nb
import numpy as np

ROUNDS = 20


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _reference(image, out):
    """Twenty rounds of a recursion along 640x480 float32 pixels: arithmetic of images, about a millisecond."""
    for v in range(image.shape[0]):
        source, target = image[v], out[v]
        for u in range(source.size):
            x = source[u]
            for _ in range(ROUNDS):
                x = np.sqrt(x * np.float32(0.75) + np.float32(0.5))
            target[u] = x


def reference_ms(repeats: int = 31) -> float:
    """Median time of the fixed kernel on one thread, milliseconds."""
    image = np.linspace(0.0, 4.0, 640 * 480, dtype=np.float32).reshape(480, 640)
    out = np.empty_like(image)
    _reference(image, out)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        _reference(image, out)
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))
