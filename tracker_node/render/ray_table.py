"""The ray of every pixel of a lens, computed once per lens."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

import numpy as np

from ..camera.camera_model import CameraModel

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
    """Undistorted normalised coordinates of every pixel.

    Attributes
    ----------
    xs, ys : (height, width rounded up to sixteen) float32; not a number where the lens has no ray.
    limits : (4,) x0, y0, x1, y1 that enclose them.
    """

    xs: np.ndarray
    ys: np.ndarray
    limits: np.ndarray


def _make_ray_table(model: CameraModel) -> RayTable:
    padded = -(-model.width // PADDING) * PADDING
    pixels = np.stack(np.meshgrid(np.arange(model.width), np.arange(model.height)), axis=-1)
    rays, valid = model.rays(pixels)
    tables = np.full((2, model.height, padded), np.nan, dtype=np.float32)
    for axis in range(2):
        tables[axis, :, : model.width] = np.where(valid, rays[..., axis] / rays[..., 2], np.nan)
    limits = np.concatenate([np.nanmin(tables, axis=(1, 2)), np.nanmax(tables, axis=(1, 2))]).astype(np.float64)
    return RayTable(tables[0], tables[1], limits)


ray_table: Callable[[CameraModel], RayTable] = MadeOnce(_make_ray_table)
