"""Shapes packed into arrays for the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.articulated_model import ArticulatedModel
from ..model.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone

CONE, ELLIPSOID, OTHER = 0, 1, 2


@dataclass(frozen=True, eq=False)
class ShapeArrays:
    """What never changes while a model moves.

    Attributes
    ----------
    kinds : (n,) `CONE`, `ELLIPSOID` or `OTHER`.
    dims : (n, 5) cone (a, b, k, z1, z2), ellipsoid (rx, ry, rz, 0, 0), others zeros.
    links : (n,) index of the link that carries the shape.
    bounds : (n, 4) center (shape frame) and radius of a bounding sphere, metres.
    """

    kinds: np.ndarray
    dims: np.ndarray
    links: np.ndarray
    bounds: np.ndarray

    @property
    def packed(self) -> tuple[np.ndarray, ...]:
        """What the contour kernels take."""
        return self.kinds, self.dims, self.links

    @classmethod
    def from_model(cls, model: ArticulatedModel) -> ShapeArrays:
        n = len(model.shapes)
        kinds, dims, bounds = np.full(n, OTHER, dtype=np.int64), np.zeros((n, 5)), np.zeros((n, 4))
        for i, shape in enumerate(model.shapes):
            primitive = shape.primitive
            if isinstance(primitive, TruncatedCone):
                kinds[i] = CONE
                dims[i] = primitive.a, primitive.b, primitive.k, primitive.z1, primitive.z2
            elif isinstance(primitive, Ellipsoid):
                kinds[i] = ELLIPSOID
                dims[i, :3] = primitive.radii
            bounds[i] = _bounding_sphere(primitive)
        return cls(kinds, dims, model.shape_links, bounds)


def _bounding_sphere(primitive: Primitive) -> np.ndarray:
    if isinstance(primitive, TruncatedCone):
        middle = 0.5 * (primitive.z1 + primitive.z2)
        scale = max(1 + primitive.k * primitive.z1, 1 + primitive.k * primitive.z2)
        radius = np.hypot(max(primitive.a, primitive.b) * scale, 0.5 * (primitive.z2 - primitive.z1))
        return np.array([0.0, 0.0, middle, radius])
    if isinstance(primitive, Ellipsoid):
        return np.array([0.0, 0.0, 0.0, max(primitive.radii)])
    if isinstance(primitive, Box):
        return np.array([0.0, 0.0, 0.0, 0.5 * np.linalg.norm(primitive.size)])
    if isinstance(primitive, Mesh):
        center = 0.5 * (primitive.vertices.min(axis=0) + primitive.vertices.max(axis=0))
        return np.append(center, np.linalg.norm(primitive.vertices - center, axis=1).max())
    raise TypeError(f"expected a primitive, got {type(primitive).__name__}")
