"""Shadow maps: what each light sees of the people, and how much of a light reaches a point."""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from benchmark.clothed.render._raster import looking_at, nearest, project, view_of

_PIXELS = 768
_CELL = 16
_BIAS_M = 0.025


@dataclass(frozen=True, eq=False)
class ShadowMaps:
    """Of all lights.

    Parameters
    ----------
    views : (l, 3, 4).
    inverse_depths : (l, 768, 768) float32, 0 where there is nobody.
    occupied : (l, 48, 48) bool, cells of 16 pixels with somebody in them or beside them.
    """

    views: np.ndarray
    inverse_depths: np.ndarray
    occupied: np.ndarray


def shadow_maps(lights: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> ShadowMaps:
    """Shadow maps that hold all of a mesh.

    Parameters
    ----------
    lights : (l, 3) places, meters.
    vertices, faces : (n, 3) meters; (m, 3).

    Returns
    -------
    The maps.
    """
    views = np.stack([_view(light, vertices) for light in lights])
    maps = np.zeros((len(lights), _PIXELS, _PIXELS), dtype=np.float32)
    face = np.zeros((_PIXELS, _PIXELS), dtype=np.int32)
    for view, target in zip(views, maps, strict=True):
        nearest(project(view, vertices), faces, False, target, face)
    n = _PIXELS // _CELL
    cells = (maps.reshape(len(maps), n, _CELL, n, _CELL) > 0.0).any(axis=(2, 4))
    wide = cells.copy()
    for axis in (1, 2):
        for shift in (-1, 1):
            wide |= np.roll(wide, shift, axis)
    return ShadowMaps(views, maps, wide)


def _view(light: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    pose = looking_at(light, 0.5 * (low + high))
    seen = project(view_of(np.eye(3), pose), vertices)
    (u0, v0), (u1, v1) = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    focal = (_PIXELS - 64) / max(u1 - u0, v1 - v0)
    middle = 0.5 * (_PIXELS - 1)
    K = np.array([
        [focal, 0.0, middle - focal * 0.5 * (u0 + u1)], [0.0, focal, middle - focal * 0.5 * (v0 + v1)], [0.0, 0.0, 1.0],
    ])  # fmt: skip
    return view_of(K, pose)


@nb.njit(cache=True)
def reaching(view, inverse_depth, occupied, x, y, z, reach, step):
    """Part of a light that reaches a point.

    Parameters
    ----------
    view, inverse_depth, occupied : of the light, see `ShadowMaps`.
    x, y, z : of the point, meters.
    reach, step : samples on either side of the middle, and pixels between them.

    Returns
    -------
    Between 0 and 1.
    """
    w = view[2, 0] * x + view[2, 1] * y + view[2, 2] * z + view[2, 3]
    if w < 0.05:
        return 1.0
    u = (view[0, 0] * x + view[0, 1] * y + view[0, 2] * z + view[0, 3]) / w
    v = (view[1, 0] * x + view[1, 1] * y + view[1, 2] * z + view[1, 3]) / w
    rows, columns = inverse_depth.shape
    if not (16.0 <= u < columns - 16.0 and 16.0 <= v < rows - 16.0):
        return 1.0
    if not occupied[int(v) // _CELL, int(u) // _CELL]:
        return 1.0
    limit = 1.0 / (w - _BIAS_M)
    lit, total = 0, 0
    for dv in range(-reach, reach + 1):
        for du in range(-reach, reach + 1):
            total += 1
            if inverse_depth[int(v + dv * step + 0.5), int(u + du * step + 0.5)] <= limit:
                lit += 1
    return lit / total
