"""How far the surfaces of two bodies with the same segments lie from each other, segment by segment, in the neutral pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...geometry import se3
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State
from ...model.shapes.primitives import Ellipsoid, Mesh

_N_AROUND, _N_ALONG = 64, 48  # facets of an ellipsoid
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

    Means are weighted by area. Shapes are ellipsoids and meshes.

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
    triangles = corners[near.reshape(len(points), -1)]  # (n, k, 3, 3)
    return np.sqrt(_squared_distances(points[:, None], triangles).min(axis=1))


def _mean_and_max(surface: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    areas = 0.5 * np.linalg.norm(np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0]), axis=1)
    distances = 1000.0 * point_distances(surface.mean(axis=1), other)
    return float(areas @ distances / areas.sum()), float(distances.max())


def _squared_distances(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n, k) squared distances of points (n, 1, 3) to triangles (n, k, 3, 3): to the plane or, beside a triangle, its edges."""
    a, b, c = triangles[..., 0, :], triangles[..., 1, :], triangles[..., 2, :]
    normal = np.cross(b - a, c - a)
    area2 = np.maximum(np.sum(normal**2, axis=-1), 1e-30)
    best = np.full(triangles.shape[:2], np.inf)
    inside = np.ones(triangles.shape[:2], dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, offset = end - start, points - start
        along = np.sum(edge * offset, axis=-1) / np.maximum(np.sum(edge**2, axis=-1), 1e-30)
        foot = start + np.clip(along, 0.0, 1.0)[..., None] * edge
        best = np.minimum(best, np.sum((points - foot) ** 2, axis=-1))
        inside &= np.sum(np.cross(edge, offset) * normal, axis=-1) >= 0.0
    height = np.sum((points - a) * normal, axis=-1) ** 2 / area2
    return np.where(inside, height, best)


def _surfaces(model: ArticulatedModel) -> dict[str, np.ndarray]:
    """Name of a shape -> its triangles (m, 3, 3) in the root's frame."""
    Ts = Configuration(model, State.neutral(model)).Ts_world_shape
    return {
        shape.name: se3.apply(T, _triangles(shape).reshape(-1, 3)).reshape(-1, 3, 3)
        for shape, T in zip(model.shapes, Ts, strict=True)
    }


def _triangles(shape: Shape) -> np.ndarray:
    if isinstance(shape.primitive, Mesh):
        return shape.primitive.vertices[shape.primitive.faces]
    if isinstance(shape.primitive, Ellipsoid):
        return _sphere_triangles() * shape.primitive.radii
    raise ValueError(f"shape '{shape.name}': expected an ellipsoid or a mesh, got {type(shape.primitive).__name__}")


def _sphere_triangles() -> np.ndarray:
    """(m, 3, 3) of a unit sphere, between circles of latitude."""
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _N_ALONG + 1)
    longitude = np.linspace(0.0, 2.0 * np.pi, _N_AROUND + 1)
    ring = np.stack([np.cos(longitude), np.sin(longitude), np.zeros_like(longitude)], axis=-1)
    grid = np.cos(latitude)[:, None, None] * ring + np.sin(latitude)[:, None, None] * np.array([0.0, 0.0, 1.0])
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    lower = np.stack([a, b, c], axis=2)[1:].reshape(-1, 3, 3)  # those at the south pole have no area
    upper = np.stack([a, c, d], axis=2)[:-1].reshape(-1, 3, 3)
    return np.concatenate([lower, upper])
