"""The ray of every pixel of a lens, computed once per lens."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

import numba as nb
import numpy as np

from ..camera.distortion import distort, undistort
from ..camera.model import CameraModel

PADDING = 16  # rows of a table are filled up to a multiple of this

Owner = TypeVar("Owner")
Made = TypeVar("Made")


class MadeOnce(Generic[Owner, Made]):
    """What is computed once for an object and dies with it (models and lenses are immutable, but not hashable)."""

    def __init__(self, make: Callable[[Owner], Made]):
        self._make, self._lock = make, Lock()
        self._made: dict[int, Made] = {}

    def __call__(self, owner: Owner) -> Made:
        key = id(owner)
        found = self._made.get(key)
        if found is None:
            made = self._make(owner)
            with self._lock:
                found = self._made.setdefault(key, made)
                weakref.finalize(owner, self._made.pop, key, None)
        return found


@dataclass(frozen=True, eq=False)
class RayTable:
    """Undistorted normalized coordinates of every pixel.

    Attributes
    ----------
    xs, ys : (height, width rounded up to sixteen) float32; not a number where the lens has no ray.
    limits : (4,) x0, y0, x1, y1 that enclose them.
    """

    xs: np.ndarray
    ys: np.ndarray
    limits: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _follow(model_id, k, xd, yd, x, y):
    """Newton inverse of the distortion from a start (x, y) that is close: (x, y, converged to 1e-5 px or so)."""
    for _ in range(4):
        px, py, a, b, c, d = distort(model_id, k, x, y)
        ex, ey, det = px - xd, py - yd, a * d - b * c
        if det <= 0.0:
            return x, y, False
        if ex * ex + ey * ey < 1e-17:
            return x, y, True
        x, y = x - (d * ex - b * ey) / det, y - (a * ey - c * ex) / det
    return x, y, False


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _fill(params, width, xs, ys):
    """Rays of all pixels; each starts from its neighbor's, which is several times faster than starting anew."""
    fx, fy, cx, cy, skew = params[0], params[1], params[2], params[3], params[4]
    model_id, k = int(params[5]), params[8:]
    for v in range(xs.shape[0]):
        x, y, known = 0.0, 0.0, False
        yd = (v - cy) / fy
        for u in range(width):
            xd = (u - cx - skew * yd) / fx
            if known:
                x, y, known = _follow(model_id, k, xd, yd, x + 1.0 / fx, y)
            if not known:
                x, y, known = undistort(model_id, k, xd, yd)
            xs[v, u], ys[v, u] = (x, y) if known else (np.nan, np.nan)
        xs[v, width:] = np.nan
        ys[v, width:] = np.nan


def _make_ray_table(model: CameraModel) -> RayTable:
    padded = -(-model.width // PADDING) * PADDING
    tables = np.empty((2, model.height, padded), dtype=np.float32)
    _fill(model.params, model.width, tables[0], tables[1])
    limits = np.concatenate([np.nanmin(tables, axis=(1, 2)), np.nanmax(tables, axis=(1, 2))]).astype(np.float64)
    return RayTable(tables[0], tables[1], limits)


ray_table: Callable[[CameraModel], RayTable] = MadeOnce(_make_ray_table)
