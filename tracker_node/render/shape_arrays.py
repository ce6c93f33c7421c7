"""Shapes packed into arrays for the kernels.

The ray of every pixel of a lens, computed once per lens.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

import numpy as np

from ..camera.distortion import MODEL_IDS, distort, undistort
from ..camera.model import CameraModel
from ..compiled.kernels import compiled
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration
from ..model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone
from . import solids

PLACES = 4  # of a shape, see `shape_places`
PADDING = 16  # rows of a table are filled up to a multiple of this

Owner = TypeVar("Owner")
Made = TypeVar("Made")


class MadeOnce(Generic[Owner, Made]):
    """What is computed once for an object and dies with it (models and lenses are immutable, but not hashable)."""

    def __init__(self, make: Callable[[Owner], Made]):
        self._make = make
        self._made: dict[int, Made] = {}
        self._locks: dict[int, Lock] = {}  # of each object: what is made of it is made once, and of two by two threads

    def __call__(self, owner: Owner) -> Made:
        key = id(owner)
        found = self._made.get(key)
        if found is None:
            with self._locks.setdefault(key, Lock()):
                found = self._made.get(key)
                if found is None:
                    found = self._made[key] = self._make(owner)
                    weakref.finalize(owner, self._forget, key)
        return found

    def _forget(self, key: int) -> None:
        self._made.pop(key, None)
        self._locks.pop(key, None)


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


_STRAIGHT = MODEL_IDS["none"]


@compiled
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


@compiled
def _fill(params, width, xs, ys):
    """Rays of all pixels; each starts from its neighbor's, which is several times faster than starting anew."""
    fx, fy, cx, cy, skew = params[0], params[1], params[2], params[3], params[4]
    model_id, k = int(params[5]), params[8:]
    for v in range(xs.shape[0]):
        x, y, known = 0.0, 0.0, False
        yd = (v - cy) / fy
        if model_id == _STRAIGHT:
            for u in range(width):
                xs[v, u], ys[v, u] = (u - cx - skew * yd) / fx, yd
        for u in range(width if model_id == _STRAIGHT else 0, width):
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
        kinds, dims = np.full(n, OTHER, dtype=np.int64), np.zeros((n, 5))
        for i, shape in enumerate(model.shapes):
            primitive = shape.primitive
            if isinstance(primitive, TruncatedCone):
                kinds[i] = CONE
                dims[i] = primitive.a, primitive.b, primitive.k, primitive.z1, primitive.z2
            elif isinstance(primitive, Ellipsoid):
                kinds[i] = ELLIPSOID
                dims[i, :3] = primitive.radii
        surfaces = _surfaces([shape.primitive for shape in model.shapes], caps)
        return cls(kinds, dims, model.shape_links, bounding_spheres(model), surfaces)


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


def bounding_spheres(model: ArticulatedModel) -> np.ndarray:
    """(n_shapes, 4) those of all shapes of a model."""
    return np.array([bounding_sphere(shape.primitive) for shape in model.shapes]).reshape(-1, 4)


def shape_places(body: Configuration, bounds: np.ndarray) -> np.ndarray:
    """Points by which it is seen where the shapes of a body are.

    Parameters
    ----------
    body : at its state.
    bounds : (n_shapes, 4) `bounding_spheres`.

    Returns
    -------
    (`PLACES` n_shapes, 3) meters, world: of each shape the middle, and as far as it reaches along its three axes.
    """
    T = body.Ts_world_shape
    middles = (np.einsum("nij,nj->ni", T[:, :3, :3], bounds[:, :3]) + T[:, :3, 3])[:, None]
    spokes = bounds[:, 3, None, None] * np.swapaxes(T[:, :3, :3], 1, 2)
    return np.concatenate([middles, middles + spokes], axis=1).reshape(-1, 3)


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
