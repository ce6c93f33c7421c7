"""The default renderer: every ray of a camera against every shape that may be in its way, in closed form.

Distortion is honored exactly: a pixel's ray comes from a table that is made once per lens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.light import Light, pack_lights
from ...camera.model import NEAR, CameraModel
from ...camera.rig import Camera
from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ...model.shapes.primitives import Box, Mesh, is_closed
from ..renderer import ColoredView, Region, RenderedView
from ..shape_arrays import OTHER, MadeOnce, RayTable, ShapeArrays, ray_table
from ..solids import light_mesh
from .coefficients import BOX, INVISIBLE, N_COEFFICIENTS, farthest_depth, normalized_box, pixel_box, shape_coefficients
from .kernels import LABEL_BITS, LANES, draw_shape, unpack_depth, unpack_labels, unpack_mask
from .lighting import lights_in_camera
from .mesh_kernels import N_TRIANGLE_COLUMNS, draw_mesh, mesh_box, pose_vertices
from .shading import N_FRAME_COLUMNS, fill_frames, shade
from .surface_arrays import surface_arrays


@dataclass(frozen=True, eq=False)
class _Drawables:
    kinds: np.ndarray  # as ShapeArrays, with BOX for boxes
    dims: np.ndarray
    meshes: dict[int, Mesh]  # by index of the shape
    closed: frozenset[int]  # those that are closed
    n_triangles: int


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
    closed = frozenset(i for i, mesh in meshes.items() if is_closed(mesh))
    return _Drawables(kinds, dims, meshes, closed, sum(len(mesh.faces) for mesh in meshes.values()))


def _make_light_drawables(model: ArticulatedModel) -> _Drawables:
    """The same with meshes of few faces."""
    full = _drawables(model)
    meshes = {i: light_mesh(mesh) for i, mesh in full.meshes.items()}
    return replace(full, meshes=meshes, n_triangles=sum(len(mesh.faces) for mesh in meshes.values()))


_drawables: Callable[[ArticulatedModel], _Drawables] = MadeOnce(_make_drawables)
_light_drawables: Callable[[ArticulatedModel], _Drawables] = MadeOnce(_make_light_drawables)


@compiled
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


@compiled
def _draw_shapes(kinds, bounds, coefficients, xs, ys, boxes, row_offset, column_offset, buffer):
    for s in range(kinds.shape[0]):
        if bounds[s] != INVISIBLE:
            draw_shape(kinds[s], bounds[s], coefficients[s], s + 1, xs, ys, boxes[s], row_offset, column_offset, buffer)


def checked_region(region: Region | None, model: CameraModel) -> Region:
    """A region that lies within the image.

    Parameters
    ----------
    region : (u0, v0, u1, v1), or None for the whole image.
    model : the lens, which knows the image's size.

    Returns
    -------
    (u0, v0, u1, v1).

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


@dataclass(frozen=True, eq=False)
class Cast:
    """What is in front at every pixel of the part of an image that a body may cover, and the body as the camera sees it.

    Attributes
    ----------
    buffer : (h, w) int32, inverse depth and label of `kernels`; 0 where nothing is.
    numbers : (h, w) int32, where a mesh is in front: the number of its triangle; (0, 0) when the body has no meshes.
    region : (u0, v0, u1, v1), the part of the image; the pixel (u0, v0) is ``buffer[0, column]``.
    column : see there; the columns before it, and those behind ``u1``, only fill up to whole groups of sixteen.
    table : the camera's rays.
    coefficients : (n, .) float32 of the shapes, of `coefficients`.
    frames : (n, .) float32, of `shading.fill_frames`; (0, .) unless asked for.
    triangles : (m, .) float32 of the meshes, of `mesh_kernels`.
    """

    buffer: np.ndarray
    numbers: np.ndarray
    region: Region
    column: int
    table: RayTable
    coefficients: np.ndarray
    frames: np.ndarray
    triangles: np.ndarray


def cast(configuration: Configuration, camera: Camera, region: Region, frames: bool = True, light: bool = False) -> Cast:
    """Cast the rays of a part of an image against a body.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its lens and pose.
    region : (u0, v0, u1, v1) of the image.
    frames : fill what `shading.surface_at` needs.
    light : meshes of many triangles are drawn with few, to a pixel or so; without frames.

    Returns
    -------
    What is in front at each pixel, and what it was made of.
    """
    table, drawables = ray_table(camera.model), (_light_drawables if light else _drawables)(configuration.model)
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
        points, pixels = np.empty((len(mesh.vertices), 3)), np.empty((len(mesh.vertices), 2))
        pose_vertices(mesh.vertices, T_cam_world, Ts_world_shape[i], params, points, pixels)
        mesh_box(points, params, limits, region, boxes[i])
        posed[i] = points, pixels
    seen = boxes[(boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])]
    if len(seen):
        (u0, v0), (u1, v1) = seen[:, :2].min(axis=0).tolist(), seen[:, 2:].max(axis=0).tolist()
    else:
        u0, v0, u1, v1 = region[0], region[1], region[0], region[1]
    start = u0 // LANES * LANES
    buffer = np.zeros((v1 - v0, -(-(u1 - start) // LANES) * LANES), dtype=np.int32)
    _draw_shapes(drawables.kinds, bounds, coefficients, table.xs, table.ys, boxes, v0, start, buffer)
    numbers = np.zeros(buffer.shape if posed else (0, 0), dtype=np.int32)
    triangles = np.empty((drawables.n_triangles, N_TRIANGLE_COLUMNS), dtype=np.float32)
    first = 0
    for i, (points, pixels) in posed.items():
        faces = drawables.meshes[i].faces
        draw_mesh(
            points, pixels, faces, i in drawables.closed, params, boxes[i], i + 1, first, table.xs, table.ys, v0, start,
            triangles[first : first + len(faces)], buffer, numbers,
        )  # fmt: skip
        first += len(faces)
    shape_frames = np.empty((n if frames else 0, N_FRAME_COLUMNS), dtype=np.float32)
    if frames:
        surfaces = surface_arrays(configuration.model)
        fill_frames(
            drawables.kinds, bounds, drawables.dims, surfaces.colors, surfaces.textures, params, T_cam_world, Ts_world_shape,
            shape_frames,
        )  # fmt: skip
    return Cast(buffer, numbers, (u0, v0, u1, v1), u0 - start, table, coefficients, shape_frames, triangles)


def _part(inner: Region, outer: Region) -> tuple[slice, slice]:
    """Rows and columns of ``inner`` in an array of ``outer``."""
    return slice(inner[1] - outer[1], inner[3] - outer[1]), slice(inner[0] - outer[0], inner[2] - outer[0])


def render_view(configuration: Configuration, camera: Camera, region: Region | None = None) -> RenderedView:
    """Labels and depth of a body in a camera.

    Shapes that the camera is inside of are not drawn. Where two shapes have the same depth (to 3e-5) the later one shows.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its lens and pose.
    region : (u0, v0, u1, v1) of the image to render; the whole image without it.

    Returns
    -------
    Labels and depth on the region.
    """
    region = checked_region(region, camera.model)
    found = cast(configuration, camera, region, frames=False)
    height, width = region[3] - region[1], region[2] - region[0]
    labels, depth = np.zeros((height, width), dtype=np.uint8), np.full((height, width), np.inf, dtype=np.float32)
    inside = _part(found.region, region)
    unpack_labels(found.buffer, found.column, labels[inside])
    unpack_depth(found.buffer, found.column, depth[inside])
    return RenderedView(labels, depth, region)


def render_where_seen(configuration: Configuration, camera: Camera) -> RenderedView | None:
    """`render_view` of the part of the image that a body may cover; meshes of many triangles are drawn with few of them.

    Parameters
    ----------
    configuration, camera : as of `render_view`.

    Returns
    -------
    Labels and depth on that part; None when no part of the body is in the image.
    """
    found = cast(configuration, camera, (0, 0, camera.model.width, camera.model.height), frames=False, light=True)
    u0, v0, u1, v1 = found.region
    if u0 == u1 or v0 == v1:
        return None
    labels, depth = np.zeros((v1 - v0, u1 - u0), dtype=np.uint8), np.empty((v1 - v0, u1 - u0), dtype=np.float32)
    unpack_labels(found.buffer, found.column, labels)
    unpack_depth(found.buffer, found.column, depth)
    return RenderedView(labels, depth, found.region)


def render_mask(configuration: Configuration, camera: Camera, region: Region | None = None) -> np.ndarray:
    """Mask of a body in a camera: `render_view` without the rest.

    Parameters
    ----------
    configuration, camera, region : as of `render_view`.

    Returns
    -------
    (h, w) uint8, 255 where the body is, else 0.
    """
    region = checked_region(region, camera.model)
    found = cast(configuration, camera, region, frames=False)
    mask = np.zeros((region[3] - region[1], region[2] - region[0]), dtype=np.uint8)
    unpack_mask(found.buffer, found.column, mask[_part(found.region, region)])
    return mask


def render_color(
    configuration: Configuration, camera: Camera, lights: Sequence[Light] = (), region: Region | None = None
) -> ColoredView:
    """Labels, depth and colors of a body under lights, as a camera shows it.

    Colors are those at the middle of each pixel; a texture whose texels are smaller than pixels is averaged over about as many
    as a pixel covers along its longer side.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its lens, pose, gain and gamma.
    lights : in the world; none stands for an ambient light of intensity one (`camera.light`).
    region : (u0, v0, u1, v1) of the image to render; the whole image without it.

    Returns
    -------
    Labels, depth and colors on the region.
    """
    region = checked_region(region, camera.model)
    found, surfaces = cast(configuration, camera, region), surface_arrays(configuration.model)
    height, width = region[3] - region[1], region[2] - region[0]
    labels, depth = np.zeros((height, width), dtype=np.uint8), np.full((height, width), np.inf, dtype=np.float32)
    rgb = np.zeros((height, width, 3), dtype=np.float32)
    inside = _part(found.region, region)
    unpack_labels(found.buffer, found.column, labels[inside])
    shade(
        found.buffer, found.numbers, found.column, found.table.xs, found.table.ys, found.region[0], found.region[1],
        found.coefficients, found.frames, found.triangles, surfaces.corners, surfaces.levels, surfaces.texels,
        lights_in_camera(pack_lights(lights), camera.T_cam_world),
        np.array(camera.gain, dtype=np.float32), np.float32(1.0 / camera.gamma), rgb[inside], depth[inside],
    )  # fmt: skip
    return ColoredView(labels, depth, region, rgb)


class RaycastRenderer:
    """The functions of this module as a `Renderer`."""

    render_view = staticmethod(render_view)
    render_color = staticmethod(render_color)


def render_labels(configuration: Configuration, camera: Camera, margin_px: int = 0) -> tuple[Region, np.ndarray] | None:
    """Where a body is in the image, and its labels there: what tracking asks for, in the least time.

    Meshes of many triangles are drawn with few of them.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its lens and pose.
    margin_px : how far around the body the region reaches.

    Returns
    -------
    region : (u0, v0, u1, v1), the body's bounding box grown by ``margin_px`` within the image.
    labels : (h, w) uint8 on the region, as of `RenderedView`.

    None when no part of the body is in the image.
    """
    model = camera.model
    found = cast(configuration, camera, (0, 0, model.width, model.height), frames=False, light=True)
    u0, v0, u1, v1 = found.region
    if u0 == u1 or v0 == v1:
        return None
    region = max(0, u0 - margin_px), max(0, v0 - margin_px), min(model.width, u1 + margin_px), min(model.height, v1 + margin_px)
    labels = np.zeros((region[3] - region[1], region[2] - region[0]), dtype=np.uint8)
    unpack_labels(found.buffer, found.column, labels[_part(found.region, region)])
    return region, labels
