"""How far the surfaces of two bodies with the same segments lie from each other, segment by segment, in the neutral pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...render.opengl.tessellation import tessellate

_N_CANDIDATES = 8  # faces with the nearest centers, among which the nearest face is searched


@dataclass(frozen=True)
class SurfaceDistance:
    """Millimeters from the surface of ``segment`` of one body to that of the other, and back."""

    segment: str
    mean_mm: float
    max_mm: float
    back_mean_mm: float
    back_max_mm: float


def segment_distances(one: ArticulatedModel, other: ArticulatedModel) -> tuple[SurfaceDistance, ...]:
    """Whole surfaces of shapes of one name, the parts within neighbors included; in the order of ``one``.

    Means are weighted by area.

    Parameters
    ----------
    one, other : bodies with shapes of the same names.

    Returns
    -------
    One a segment.

    Raises
    ------
    ValueError : bodies whose shapes have different names.
    """
    here, there = _surfaces(one), _surfaces(other)
    if set(here) != set(there):
        raise ValueError(f"expected shapes of the same names, got {sorted(set(here) ^ set(there))} in one body only")
    rows = []
    for name, surface in here.items():
        forth = _mean_and_max(surface, there[name])
        back = _mean_and_max(there[name], surface)
        rows.append(SurfaceDistance(name, *forth, *back))
    return tuple(rows)


def distance_table(one: ArticulatedModel, other: ArticulatedModel) -> str:
    """Table of `segment_distances`, with means over all segments and the largest distances.

    Parameters
    ----------
    one, other : bodies with shapes of the same names.

    Returns
    -------
    Lines of text.
    """
    rows = segment_distances(one, other)
    lines = [f"{'surface distance, mm':22s}{one.name + ' -> ' + other.name:>36s}{'and back':>18s}"]
    lines.append(f"{'segment':22s}{'mean':>27s}{'max':>9s}{'mean':>9s}{'max':>9s}")
    mean = SurfaceDistance(
        "all", float(np.mean([r.mean_mm for r in rows])), max(r.max_mm for r in rows),
        float(np.mean([r.back_mean_mm for r in rows])), max(r.back_max_mm for r in rows),
    )  # fmt: skip
    for r in (*rows, mean):
        lines.append(f"{r.segment:22s}{r.mean_mm:27.1f}{r.max_mm:9.1f}{r.back_mean_mm:9.1f}{r.back_max_mm:9.1f}")
    return "\n".join(lines)


def point_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distances of points to the nearest of some triangles.

    Exact unless the nearest triangle's center is not among the nearest few: triangles should be small against their distances or
    of one size.

    Parameters
    ----------
    points : (n, 3).
    corners : (m, 3, 3) of the triangles.

    Returns
    -------
    (n,) in the unit of the points.
    """
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(_N_CANDIDATES, len(corners)))
    near = near.reshape(len(points), -1)
    repeated = np.repeat(points, near.shape[1], axis=0)
    off = trimesh.triangles.closest_point(corners[near.ravel()], repeated) - repeated
    return np.linalg.norm(off, axis=1).reshape(near.shape).min(axis=1)


def _mean_and_max(surface: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    areas = 0.5 * np.linalg.norm(np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0]), axis=1)
    distances = 1000.0 * point_distances(surface.mean(axis=1), other)
    return float(areas @ distances / areas.sum()), float(distances.max())


def _surfaces(model: ArticulatedModel) -> dict[str, np.ndarray]:
    """Name of a shape -> its triangles (m, 3, 3) in the root's frame."""
    found = {}
    for shape, T in zip(model.shapes, Configuration(model, State.neutral(model)).Ts_world_shape, strict=True):
        patches = tessellate(shape.primitive, shape.color_rgb)
        found[shape.name] = np.concatenate([se3.apply(T, patch.vertices)[patch.faces] for patch in patches])
    return found
