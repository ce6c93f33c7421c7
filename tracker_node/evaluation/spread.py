"""What a series of errors comes to: mean, rms, 95th percentile and maximum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPREAD_TITLES = ("mean", "rms", "p95", "max")


@dataclass(frozen=True)
class Spread:
    """Of the sizes of ``n`` errors, in their own unit; NaN where ``n`` is 0."""

    mean: float
    rms: float
    p95: float
    max: float
    n: int

    @property
    def row(self) -> tuple[float, float, float, float]:
        """In the order of `SPREAD_TITLES`."""
        return self.mean, self.rms, self.p95, self.max


def spread_of(errors: np.ndarray, valid: np.ndarray | None = None) -> Spread:
    """Of errors, with or without sign; those that are not ``valid`` or not finite do not count."""
    sizes = np.abs(np.asarray(errors, dtype=np.float64))
    sizes = sizes[np.isfinite(sizes) if valid is None else valid & np.isfinite(sizes)]
    if not len(sizes):
        return Spread(*4 * (float("nan"),), 0)
    p95, top = np.percentile(sizes, [95, 100])
    return Spread(float(sizes.mean()), float(np.sqrt(np.mean(sizes**2))), float(p95), float(top), len(sizes))
