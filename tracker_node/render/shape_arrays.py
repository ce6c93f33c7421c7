"""Shapes packed into arrays for the kernels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone
from . import solids
from .ray_table import MadeOnce

CONE, ELLIPSOID, OTHER = 0, 1, 2

_solid_of: Callable[[Box | Mesh], solids.Solid] = MadeOnce(solids.solid_of)  # large meshes take a second


@dataclass(frozen=True, eq=False)
class ShapeArrays:
    """What never changes while a model moves.

    Attributes
    ----------
    kinds : (n,) `CONE`, `ELLIPSOID` or `OTHER`.
    dims : (n, 5) cone (a, b, k, z1, z2), ellipsoid (rx, ry, rz, 0, 0), others zeros.
    links : (n,) index of the link that carries the shape.
    bounds : (n, 4) center (shape frame) and radius of a bounding sphere, meters.
    surfaces : (ranges, edges, nodes, triangles), columns as in `solids`, those of all shapes one after the other; ranges, a row
        a shape, also say which caps count.
    """

    kinds: np.ndarray
    dims: np.ndarray
    links: np.ndarray
    bounds: np.ndarray
    surfaces: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

    @property
    def packed(self) -> tuple:
        """What the contour kernels take."""
        return self.kinds, self.dims, self.links, self.surfaces

    @classmethod
    def from_model(cls, model: ArticulatedModel, caps: bool = True) -> ShapeArrays:
        """Arrays of a model.

        Parameters
        ----------
        model : its shapes, in their order.
        caps : the rims of cones' end caps are contours, too.

        Returns
        -------
        One row per shape.
        """
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
            bounds[i] = bounding_sphere(primitive)
        return cls(kinds, dims, model.shape_links, bounds, _surfaces([shape.primitive for shape in model.shapes], caps))


def _surfaces(primitives: list[Primitive], caps: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    ranges = np.zeros((len(primitives), solids.N_RANGE_COLUMNS), dtype=np.int64)
    edges, nodes = [np.zeros((0, solids.N_EDGE_COLUMNS))], [np.zeros((0, solids.N_NODE_COLUMNS))]
    triangles = [np.zeros((0, solids.N_TRIANGLE_COLUMNS))]
    n_edges, n_nodes, n_triangles = 0, 0, 0
    for row, primitive in zip(ranges, primitives, strict=True):
        row[solids.CAPS] = caps and isinstance(primitive, TruncatedCone)
        if not isinstance(primitive, Box | Mesh):
            continue
        solid = _solid_of(primitive)
        row[solids.FIRST_EDGE], row[solids.N_EDGES], row[solids.ROOT] = n_edges, len(solid.edges), n_nodes
        mesh = solids.CONVEX_MESH if solid.convex else solids.MESH
        row[solids.SORT] = solids.BOX_SOLID if isinstance(primitive, Box) else mesh
        tree = solid.nodes.copy()
        tree[:, solids.FIRST] += np.where(tree[:, solids.COUNT] > 0, n_triangles, n_nodes)
        edges.append(solid.edges)
        nodes.append(tree)
        triangles.append(solid.triangles)
        n_edges, n_nodes, n_triangles = n_edges + len(solid.edges), n_nodes + len(tree), n_triangles + len(solid.triangles)
    return ranges, np.vstack(edges), np.vstack(nodes), np.vstack(triangles)


def bounding_sphere(primitive: Primitive) -> np.ndarray:
    """(4,) center in the frame of the shape, and radius, meters."""
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
