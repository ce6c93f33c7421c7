"""Numbers for JSON, which knows none that are not finite."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def finite(value: float) -> float | None:
    """A number; None for one that is not finite."""
    return float(value) if math.isfinite(value) else None


def finite_list(values: np.ndarray, digits: int) -> list[Any]:
    """Nested lists of an array's numbers, rounded to so many digits after the point; None for those that are not finite."""
    rounded = np.round(values, digits).astype(object)
    rounded[~np.isfinite(values)] = None
    listed: list[Any] = rounded.tolist()
    return listed
