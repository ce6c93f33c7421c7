"""Triangles for the shapes of a body, fine enough that a renderer of triangles shows the shapes themselves.

A polyhedron between the points of a round surface is too small everywhere; ours have their points a little outside, so that
they keep the volume of the shape. Flat surfaces are divided too: a lens bends their edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone

ELLIPSOID_SUBDIVISIONS = 4  # of an icosahedron: 5120 triangles, about 90 around
CONE_SEGMENTS, CONE_RINGS, CAP_RINGS = 96, 12, 3
FLAT_CELLS = 32  # the longest edge of a box is divided into so many
MESH_CELLS = 16  # the edges of a mesh are divided until they are as short as that fraction of its diagonal...
MESH_FACES = 20_000  # ...unless it has that many triangles already
_CAP_SIDES = (-1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Patch:
    """Triangles with one texture or none.

    Attributes
    ----------
    vertices, normals : (n, 3) in the frame of the shape, meters; unit outward normals of the surface itself.
    faces : (m, 3), counter-clockwise seen from outside.
    colors : (n, 3) RGB in 0..1.
    uv, texture : (n, 2) with v upward, and the texture (h, w, 3) uint8 RGB that replaces ``colors``; or None.
    two_sided : whether it is seen from behind as well.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    colors: np.ndarray
    uv: np.ndarray | None = None
    texture: np.ndarray | None = None
    two_sided: bool = False


def tessellate(primitive: Primitive, color_rgb: tuple[int, int, int]) -> tuple[Patch, ...]:
    """The surface of a shape as triangles.

    Parameters
    ----------
    primitive : of any kind.
    color_rgb : 0..255, shown where it has no colors of its own.

    Returns
    -------
    One patch, or one for each face of a box.
    """
    color = np.asarray(color_rgb, dtype=np.float64) / 255.0
    if isinstance(primitive, Ellipsoid):
        return (_ellipsoid(primitive, color),)
    if isinstance(primitive, TruncatedCone):
        return (_cone(primitive, color),)
    if isinstance(primitive, Box):
        return tuple(_box_face(primitive, face, color) for face in range(6))
    return (_mesh(primitive, color),)


def _uniform(color: np.ndarray, n: int) -> np.ndarray:
    return np.broadcast_to(color, (n, 3))


def _ellipsoid(ellipsoid: Ellipsoid, color: np.ndarray) -> Patch:
    import trimesh  # a fifth of a second, which a report of cones does without

    sphere = trimesh.creation.icosphere(subdivisions=ELLIPSOID_SUBDIVISIONS)
    points, radii = np.asarray(sphere.vertices), np.asarray(ellipsoid.radii)
    scale = (4.0 / 3.0 * math.pi / sphere.volume) ** (1.0 / 3.0)
    normals = points / radii
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Patch(scale * radii * points, normals, np.asarray(sphere.faces), _uniform(color, len(points)))


def _cone(cone: TruncatedCone, color: np.ndarray) -> Patch:
    n = CONE_SEGMENTS
    angles = 2.0 * np.pi / n * np.arange(n)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    step = 2.0 * math.pi / n
    outside = math.sqrt(step / math.sin(step)) * np.array([cone.a, cone.b])  # the polygon has the area of the ellipse
    z = np.linspace(cone.z1, cone.z2, CONE_RINGS + 1)
    side = np.concatenate([np.column_stack([(1.0 + cone.k * zi) * outside * circle, np.full(n, zi)]) for zi in z])
    normal = np.column_stack([circle * (cone.b, cone.a), np.full(n, -cone.a * cone.b * cone.k)])  # Knossow et al., below eq. 4
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    vertices, normals = [side], [np.tile(normal, (len(z), 1))]
    faces = [_strips(CONE_RINGS + 1, n, 0)]
    for end, sign in zip((cone.z1, cone.z2), _CAP_SIDES, strict=True):
        rim = (1.0 + cone.k * end) * outside * circle
        fractions = np.linspace(0.0, 1.0, CAP_RINGS + 1)
        cap = np.concatenate([np.column_stack([fraction * rim, np.full(n, end)]) for fraction in fractions])
        strips = _strips(CAP_RINGS + 1, n, sum(map(len, vertices)))
        faces.append(strips if sign < 0.0 else strips[:, ::-1])
        vertices.append(cap)
        normals.append(np.broadcast_to((0.0, 0.0, sign), cap.shape))
    points = np.concatenate(vertices)
    return Patch(points, np.concatenate(normals), np.concatenate(faces), _uniform(color, len(points)))


def _strips(rings: int, n: int, first: int) -> np.ndarray:
    """Triangles (., 3) between closed rings of ``n`` points each, numbered from ``first``."""
    i, j = np.meshgrid(np.arange(rings - 1) * n, np.arange(n), indexing="ij")
    a, b = (i + j).ravel(), (i + (j + 1) % n).ravel()
    return first + np.concatenate([np.column_stack([a, b, b + n]), np.column_stack([a, b + n, a + n])])


def _box_face(box: Box, face: int, color: np.ndarray) -> Patch:
    size = np.asarray(box.size)
    axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
    normal = sign * np.eye(3)[axis]
    up = np.eye(3)[1 if axis == 2 else 2]
    right = np.cross(up, normal)
    width, height = float(np.abs(right) @ size), float(up @ size)
    columns, rows = (max(1, math.ceil(FLAT_CELLS * length / size.max())) for length in (width, height))
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    uv = np.column_stack([u.ravel(), v.ravel()])
    vertices = 0.5 * size[axis] * normal + (uv[:, :1] - 0.5) * width * right + (uv[:, 1:] - 0.5) * height * up
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    a = (j * (columns + 1) + i).ravel()
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    if box.face_colors_rgb is not None:
        color = box.face_colors_rgb[face] / 255.0
    texture = box.textures[face] if box.textures is not None else None
    normals = np.broadcast_to(normal, vertices.shape)
    return Patch(vertices, normals, faces, _uniform(color, len(vertices)), None if texture is None else uv, texture)


def _mesh(mesh: Mesh, color: np.ndarray) -> Patch:
    corners = mesh.vertices[mesh.faces]
    if mesh.normals is not None:
        normals = mesh.normals[mesh.faces]
    else:
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-30)
        normals = np.repeat(flat[:, None], 3, axis=1)
    if mesh.vertex_colors_rgb is not None:
        colors = mesh.vertex_colors_rgb[mesh.faces] / 255.0
    elif mesh.face_colors_rgb is not None:
        colors = np.repeat(mesh.face_colors_rgb[:, None] / 255.0, 3, axis=1)
    else:
        colors = np.broadcast_to(color, corners.shape)
    uv = np.zeros((*corners.shape[:2], 2)) if mesh.uv is None else mesh.uv
    attributes = _divided(np.concatenate([corners, normals, colors, uv], axis=2)).reshape(-1, 11)
    attributes, numbers = np.unique(attributes.astype(np.float32), axis=0, return_inverse=True)
    return Patch(
        attributes[:, :3], attributes[:, 3:6], numbers.reshape(-1, 3), attributes[:, 6:9],
        None if mesh.uv is None else attributes[:, 9:], mesh.texture, two_sided=True,
    )  # fmt: skip


def _divided(corners: np.ndarray) -> np.ndarray:
    """Attributes (m, 3, .) at the corners of triangles, position first: each triangle in four until all are small.

    All at once, so that no triangle has a corner in the middle of its neighbor's edge.
    """
    points = corners[..., :3].reshape(-1, 3)
    limit = np.linalg.norm(np.ptp(points, axis=0)) / MESH_CELLS if len(points) else 0.0
    while 4 * len(corners) <= MESH_FACES and len(corners):
        edges = corners[..., :3] - np.roll(corners[..., :3], 1, axis=1)
        if np.linalg.norm(edges, axis=2).max() <= limit:
            break
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        corners = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return corners
