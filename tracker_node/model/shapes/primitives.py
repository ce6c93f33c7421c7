"""Shapes of body parts, each in its own frame, meters.

Round cones: all that a sphere covers whose center goes straight from one point to another while its radius changes evenly.

One is a row of `N_CAPSULE` numbers, meters; where its radius stays, it is a capsule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ...compiled.kernels import compiled


@dataclass(frozen=True)
class TruncatedCone:
    """Truncated elliptical cone X = (a (1 + k z) cos t, b (1 + k z) sin t, z), z in [z1, z2] (Knossow et al., eq. 4).

    ``a``, ``b`` are the half-axes at z = 0 (meters), ``k`` the taper per meter; 1 + k z > 0 on [z1, z2]. Flat caps close it.
    """

    a: float
    b: float
    k: float
    z1: float
    z2: float

    def __post_init__(self):
        if not (self.a > 0 and self.b > 0 and self.z2 > self.z1):
            raise ValueError(f"expected a, b > 0 and z1 < z2, got {self}")
        if min(1 + self.k * self.z1, 1 + self.k * self.z2) <= 0:
            raise ValueError(f"expected 1 + k z > 0 on [z1, z2], got {self}")


@dataclass(frozen=True)
class Ellipsoid:
    """Axis-aligned ellipsoid about its frame's origin with half-axes ``radii`` (3,) in meters."""

    radii: tuple[float, float, float]

    def __post_init__(self):
        if len(self.radii) != 3 or min(self.radii) <= 0:
            raise ValueError(f"expected three positive radii, got {self.radii}")


BOX_FACES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True)
class Box:
    """Axis-aligned box about its frame's origin with full edge lengths ``size`` (3,) in meters.

    Parameters
    ----------
    face_colors_rgb : (6, 3) uint8 in the order of `BOX_FACES`; None: the shape's one color.
    textures : six textures (h, w, 3) uint8 RGB, or None for a face without one, in the order of `BOX_FACES`. A texture
        fills its face as seen from outside: rows run down and columns to the right to a viewer for whom z points up (on the faces
        +z and -z: y).
    """

    size: tuple[float, float, float]
    face_colors_rgb: np.ndarray | None = field(default=None, compare=False)
    textures: tuple[np.ndarray | None, ...] | None = field(default=None, compare=False)

    def __post_init__(self):
        if len(self.size) != 3 or min(self.size) <= 0:
            raise ValueError(f"expected three positive edge lengths, got {self.size}")
        object.__setattr__(self, "face_colors_rgb", _colors(self.face_colors_rgb, 6))
        if self.textures is not None:
            if len(self.textures) != 6:
                raise ValueError(f"expected six textures (or None for a face), got {len(self.textures)}")
            object.__setattr__(self, "textures", tuple(None if t is None else _texture(t) for t in self.textures))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangle mesh: ``vertices`` (n, 3) meters, ``faces`` (m, 3) vertex indices, counter-clockwise seen from outside.

    Its color is the first of these that is given; else the shape's one color.

    Parameters
    ----------
    texture, uv : (h, w, 3) uint8 RGB, and (m, 3, 2) where the corners of every face lie in it: u to the right, v upward, 0..1
        over the whole texture.
    vertex_colors_rgb : (n, 3) uint8, blended over each face.
    face_colors_rgb : (m, 3) uint8.
    normals : (n, 3) unit vertex normals for shading; None: the faces are shaded flat.
    """

    vertices: np.ndarray
    faces: np.ndarray
    face_colors_rgb: np.ndarray | None = None
    vertex_colors_rgb: np.ndarray | None = None
    uv: np.ndarray | None = None
    texture: np.ndarray | None = None
    normals: np.ndarray | None = None

    def __post_init__(self):
        set_ = object.__setattr__
        vertices = np.array(self.vertices, dtype=np.float64)
        faces = np.array(self.faces, dtype=np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"expected vertices (n, 3) and faces (m, 3), got {vertices.shape} and {faces.shape}")
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(f"expected face indices in [0, {len(vertices)}), got up to {faces.max()}")
        set_(self, "vertices", vertices)
        set_(self, "faces", faces)
        set_(self, "face_colors_rgb", _colors(self.face_colors_rgb, len(faces)))
        set_(self, "vertex_colors_rgb", _colors(self.vertex_colors_rgb, len(vertices)))
        if (self.texture is None) != (self.uv is None):
            raise ValueError("expected both texture and uv, got only one of them")
        if self.texture is not None:
            uv = np.array(self.uv, dtype=np.float64)
            if uv.shape != (len(faces), 3, 2):
                raise ValueError(f"expected uv ({len(faces)}, 3, 2), got {uv.shape}")
            set_(self, "uv", uv)
            set_(self, "texture", _texture(self.texture))
        if self.normals is not None:
            normals = np.array(self.normals, dtype=np.float64)
            if normals.shape != vertices.shape:
                raise ValueError(f"expected normals {vertices.shape}, got {normals.shape}")
            set_(self, "normals", normals)


def is_closed(mesh: Mesh) -> bool:
    """Whether a mesh encloses a volume, with all faces outward: its inside cannot be seen from outside.

    Vertices at the same place (to a nanometre) count as one.
    """
    if not len(mesh.faces):
        return False
    welded = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)[1].reshape(-1)
    faces = welded[mesh.faces].astype(np.int64)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    n = len(mesh.vertices)
    there, back = np.sort(start * n + end), np.sort(end * n + start)
    corners = mesh.vertices[mesh.faces]
    volume = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum()
    return bool(volume > 0.0 and np.array_equal(there, back) and (np.diff(there) > 0).all())


def _colors(colors: np.ndarray | None, n: int) -> np.ndarray | None:
    if colors is None:
        return None
    colors = np.array(colors)
    if colors.shape != (n, 3) or colors.min(initial=0) < 0 or colors.max(initial=0) > 255:
        raise ValueError(f"expected ({n}, 3) colors (r, g, b) in 0..255, got {colors.shape}")
    return colors.astype(np.uint8)


def _texture(texture: np.ndarray) -> np.ndarray:
    texture = np.ascontiguousarray(texture)
    if texture.dtype != np.uint8 or texture.ndim != 3 or texture.shape[2] != 3 or 0 in texture.shape:
        raise ValueError(f"expected a texture (h, w, 3) uint8, got {texture.dtype} {texture.shape}")
    return texture


Primitive = TruncatedCone | Ellipsoid | Box | Mesh


START, START_RADIUS, END, END_RADIUS, N_CAPSULE = 0, 3, 4, 7, 8


@compiled
def nearest_on(cone, x, y, z):
    """Place on a round cone whose sphere's surface is nearest to a point.

    With t0 the foot of the perpendicular of length h on the axis of length l, and the radius growing by r over it, the distance
    is least at t0 + r h / (l sqrt(l^2 - r^2)).

    Parameters
    ----------
    cone : (`N_CAPSULE`,) meters.
    x, y, z : of the point, meters.

    Returns
    -------
    0 at the cone's start, 1 at its end.
    """
    dx, dy, dz = cone[END] - cone[START], cone[END + 1] - cone[START + 1], cone[END + 2] - cone[START + 2]
    wx, wy, wz = x - cone[START], y - cone[START + 1], z - cone[START + 2]
    grows = cone[END_RADIUS] - cone[START_RADIUS]
    length_sq = dx * dx + dy * dy + dz * dz
    if length_sq <= grows * grows + 1e-18:  # one end's sphere holds all
        return 1.0 if grows > 0.0 else 0.0
    foot = (wx * dx + wy * dy + wz * dz) / length_sq
    height = math.sqrt(max(wx * wx + wy * wy + wz * wz - foot * foot * length_sq, 0.0))
    return min(max(foot + grows * height / math.sqrt(length_sq * (length_sq - grows * grows)), 0.0), 1.0)


@compiled
def point_gap(cone, x, y, z):
    """Distance of a point from the surface of a round cone.

    Parameters
    ----------
    cone : (`N_CAPSULE`,) meters.
    x, y, z : of the point, meters.

    Returns
    -------
    Meters; negative within it.
    """
    t, square = nearest_on(cone, x, y, z), 0.0
    for i, value in enumerate((x, y, z)):
        d = cone[START + i] + t * (cone[END + i] - cone[START + i]) - value
        square += d * d
    return math.sqrt(square) - cone[START_RADIUS] - t * (cone[END_RADIUS] - cone[START_RADIUS])


@compiled
def point_gaps(cones, points, out):
    """Fill ``out`` with the distance of each point from the nearest of some round cones.

    Parameters
    ----------
    cones, points : (n_cones, `N_CAPSULE`) and (n_points, 3), meters.
    out : (n_points,) meters, negative within a cone.
    """
    for j in range(points.shape[0]):
        out[j] = np.inf
        for i in range(cones.shape[0]):
            out[j] = min(out[j], point_gap(cones[i], points[j, 0], points[j, 1], points[j, 2]))


@compiled
def count_held(cones, points, out):
    """Fill ``out`` with the number of points within each round cone.

    Parameters
    ----------
    cones, points : (n_cones, `N_CAPSULE`) and (n_points, 3), meters.
    out : (n_cones,) integers.
    """
    for i in range(cones.shape[0]):
        out[i] = 0
        for j in range(points.shape[0]):
            if point_gap(cones[i], points[j, 0], points[j, 1], points[j, 2]) < 0.0:
                out[i] += 1
