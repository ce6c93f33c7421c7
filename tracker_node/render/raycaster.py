"""The default renderer: every ray of a camera against every shape that may be in its way, in closed form.

Distortion is honored exactly: a pixel's ray comes from a table that is made once per lens.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba as nb
import numpy as np

from ..camera.camera_model import NEAR, CameraModel
from ..camera.camera_rig import Camera
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration
from ..model.primitives import Box, Mesh
from .ray_coefficients import (
    BOX,
    INVISIBLE,
    N_COEFFICIENTS,
    farthest_depth,
    normalized_box,
    pixel_box,
    shape_coefficients,
)
from .ray_kernels import LABEL_BITS, LANES, draw_shape, draw_triangle, unpack_depth, unpack_labels, unpack_mask
from .ray_table import MadeOnce, ray_table
from .renderer import Region, RenderedView
from .shape_arrays import OTHER, ShapeArrays


@dataclass(frozen=True, eq=False)
class _Drawables:
    kinds: np.ndarray  # as ShapeArrays, with BOX for boxes
    dims: np.ndarray
    meshes: dict[int, Mesh]  # by index of the shape


def _make_drawables(model: ArticulatedModel) -> _Drawables:
    if len(model.shapes) > LABEL_BITS:
        raise ValueError(f"expected at most {LABEL_BITS} shapes, got {len(model.shapes)}")
    arrays = ShapeArrays.from_model(model)
    kinds, dims, meshes = arrays.kinds.copy(), arrays.dims.copy(), {}
    for i, shape in enumerate(model.shapes):
        if isinstance(shape.primitive, Box):
            kinds[i], dims[i, :3] = BOX, shape.primitive.size
        elif isinstance(shape.primitive, Mesh):
            meshes[i] = shape.primitive
    return _Drawables(kinds, dims, meshes)


_drawables: Callable[[ArticulatedModel], _Drawables] = MadeOnce(_make_drawables)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _prepare(params, limits, kinds, dims, T_cam_world, Ts_world_shape, region, coefficients, bounds, boxes):
    """Coefficients (n, .), kinds of bounds (n,) and pixel boxes (n, 4) of all shapes that are not meshes."""
    T, box, row = np.empty((4, 4)), np.empty(4), np.empty(coefficients.shape[1])
    for s in range(kinds.shape[0]):
        boxes[s, 0], boxes[s, 1], boxes[s, 2], boxes[s, 3] = region[0], region[1], region[0], region[1]
        bounds[s] = INVISIBLE
        if kinds[s] == OTHER:
            continue
        for i in range(4):
            for j in range(4):
                value = 0.0
                for m in range(4):
                    value += T_cam_world[i, m] * Ts_world_shape[s, m, j]
                T[i, j] = value
        if farthest_depth(kinds[s], dims[s], T) < NEAR:
            continue
        bounds[s] = shape_coefficients(kinds[s], dims[s], T, row)
        if bounds[s] == INVISIBLE:
            continue
        for i in range(row.shape[0]):
            coefficients[s, i] = row[i]
        if normalized_box(kinds[s], dims[s], T, box):
            pixel_box(params, box, limits, region, boxes[s])
        else:
            boxes[s, 2], boxes[s, 3] = region[2], region[3]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _draw_shapes(kinds, bounds, coefficients, xs, ys, boxes, row_offset, column_offset, buffer):
    for s in range(kinds.shape[0]):
        if bounds[s] != INVISIBLE:
            draw_shape(kinds[s], bounds[s], coefficients[s], s + 1, xs, ys, boxes[s], row_offset, column_offset, buffer)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _mesh_box(points, params, limits, region, out):
    """Pixel box ``out`` (4,) within ``region`` of points (n, 3) in the camera frame; the region if some are not in front."""
    box = np.array([1e30, 1e30, -1e30, -1e30])
    nearest, farthest = 1e30, -1e30
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        nearest, farthest = min(nearest, z), max(farthest, z)
        if z >= NEAR:
            box[0], box[1], box[2], box[3] = min(box[0], x / z), min(box[1], y / z), max(box[2], x / z), max(box[3], y / z)
    if farthest < NEAR:
        return
    if nearest >= NEAR:
        pixel_box(params, box, limits, region, out)
    else:
        out[2], out[3] = region[2], region[3]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _draw_mesh(points, faces, params, limits, region, label, xs, ys, row_offset, column_offset, buffer):
    """Triangles of ``points`` (n, 3) in the camera frame, also those that reach behind the camera."""
    c, box, pixels = np.empty(14, dtype=np.float32), np.empty(4), np.empty(4, dtype=np.int64)
    n = np.empty((3, 3))
    for t in range(faces.shape[0]):
        x0, y0, in_front = 0.0, 0.0, True
        box[0], box[1], box[2], box[3] = 1e30, 1e30, -1e30, -1e30
        for i in range(3):
            p = points[faces[t, i]]
            in_front = in_front and p[2] >= NEAR
            if in_front:
                x0, y0 = p[0] / p[2], p[1] / p[2]
                box[0], box[1], box[2], box[3] = min(box[0], x0), min(box[1], y0), max(box[2], x0), max(box[3], y0)
            a, b = points[faces[t, (i + 1) % 3]], points[faces[t, (i + 2) % 3]]
            n[i, 0], n[i, 1], n[i, 2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        first = points[faces[t, 0]]
        volume = first[0] * n[0, 0] + first[1] * n[0, 1] + first[2] * n[0, 2]
        if volume == 0.0:
            continue
        if not in_front:
            x0, y0 = 0.0, 0.0
            pixels[0], pixels[1], pixels[2], pixels[3] = region[0], region[1], region[2], region[3]
        else:
            pixel_box(params, box, limits, region, pixels)
        c[0], c[1] = x0, y0
        c[11], c[12], c[13] = 0.0, 0.0, 0.0
        for i in range(3):
            lx, ly, lz = n[i, 0] / volume, n[i, 1] / volume, n[i, 2] / volume
            c[2 + 3 * i], c[3 + 3 * i], c[4 + 3 * i] = lz + x0 * lx + y0 * ly, lx, ly
        for j in range(3):
            c[11 + j] = c[2 + j] + c[5 + j] + c[8 + j]
        draw_triangle(c, label, xs, ys, pixels, row_offset, column_offset, buffer)


def checked_region(region: Region | None, model: CameraModel) -> Region:
    """``region``, or the whole image.

    Raises
    ------
    ValueError : a region that is empty or reaches beyond the image.
    """
    if region is None:
        return 0, 0, model.width, model.height
    u0, v0, u1, v1 = (int(value) for value in region)
    if not (0 <= u0 < u1 <= model.width and 0 <= v0 < v1 <= model.height):
        raise ValueError(f"expected a region (u0, v0, u1, v1) within {model.width} x {model.height}, got {tuple(region)}")
    return u0, v0, u1, v1


def _cast(configuration: Configuration, camera: Camera, region: Region) -> tuple[np.ndarray, Region, int]:
    """Packed pixels of the part of ``region`` that the body may cover, that part, and where its first column lies."""
    table, drawables = ray_table(camera.model), _drawables(configuration.model)
    n = len(drawables.kinds)
    T_cam_world, Ts_world_shape = camera.T_cam_world, configuration.Ts_world_shape
    coefficients = np.zeros((n, N_COEFFICIENTS), dtype=np.float32)
    bounds, boxes = np.empty(n, dtype=np.int64), np.empty((n, 4), dtype=np.int64)
    limits, params = table.limits, camera.model.params
    _prepare(
        params, limits, drawables.kinds, drawables.dims, T_cam_world, Ts_world_shape, region, coefficients, bounds, boxes
    )  # fmt: skip
    posed = {}
    for i, mesh in drawables.meshes.items():
        T = T_cam_world @ Ts_world_shape[i]
        posed[i] = mesh.vertices @ T[:3, :3].T + T[:3, 3]
        _mesh_box(posed[i], params, limits, region, boxes[i])
    seen = boxes[(boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])]
    if len(seen):
        (u0, v0), (u1, v1) = seen[:, :2].min(axis=0).tolist(), seen[:, 2:].max(axis=0).tolist()
    else:
        u0, v0, u1, v1 = region[0], region[1], region[0], region[1]
    start = u0 // LANES * LANES
    buffer = np.zeros((v1 - v0, -(-(u1 - start) // LANES) * LANES), dtype=np.int32)
    _draw_shapes(drawables.kinds, bounds, coefficients, table.xs, table.ys, boxes, v0, start, buffer)
    for i, points in posed.items():
        faces, box = drawables.meshes[i].faces, tuple(boxes[i].tolist())
        _draw_mesh(points, faces, params, limits, box, i + 1, table.xs, table.ys, v0, start, buffer)
    return buffer, (u0, v0, u1, v1), u0 - start


def render_view(configuration: Configuration, camera: Camera, region: Region | None = None) -> RenderedView:
    """Labels and depth of a body as ``camera`` sees it.

    Shapes that the camera is inside of are not drawn. Where two shapes have the same depth (to 3e-5) the later one shows.

    Parameters
    ----------
    region : (u0, v0, u1, v1) of the image to render; the whole image without it.
    """
    region = checked_region(region, camera.model)
    buffer, (u0, v0, u1, v1), column = _cast(configuration, camera, region)
    height, width = region[3] - region[1], region[2] - region[0]
    labels, depth = np.zeros((height, width), dtype=np.uint8), np.full((height, width), np.inf, dtype=np.float32)
    inside = slice(v0 - region[1], v1 - region[1]), slice(u0 - region[0], u1 - region[0])
    unpack_labels(buffer, column, labels[inside])
    unpack_depth(buffer, column, depth[inside])
    return RenderedView(labels, depth, region)


def render_mask(configuration: Configuration, camera: Camera, region: Region | None = None) -> np.ndarray:
    """Mask (h, w) uint8 of a body as ``camera`` sees it, 255 where it is: `render_view` without the rest."""
    region = checked_region(region, camera.model)
    buffer, (u0, v0, u1, v1), column = _cast(configuration, camera, region)
    mask = np.zeros((region[3] - region[1], region[2] - region[0]), dtype=np.uint8)
    unpack_mask(buffer, column, mask[v0 - region[1] : v1 - region[1], u0 - region[0] : u1 - region[0]])
    return mask


def render_labels(configuration: Configuration, camera: Camera, margin_px: int = 0) -> tuple[Region, np.ndarray] | None:
    """Where a body is in the image, and its labels there: what tracking asks for, in the least time.

    Returns
    -------
    region : (u0, v0, u1, v1), the body's bounding box grown by ``margin_px`` within the image.
    labels : (h, w) uint8 on the region, as of `RenderedView`.

    None when no part of the body is in the image.
    """
    model = camera.model
    buffer, (u0, v0, u1, v1), column = _cast(configuration, camera, (0, 0, model.width, model.height))
    if u0 == u1 or v0 == v1:
        return None
    region = max(0, u0 - margin_px), max(0, v0 - margin_px), min(model.width, u1 + margin_px), min(model.height, v1 + margin_px)
    labels = np.zeros((region[3] - region[1], region[2] - region[0]), dtype=np.uint8)
    unpack_labels(buffer, column, labels[v0 - region[1] : v1 - region[1], u0 - region[0] : u1 - region[0]])
    return region, labels
