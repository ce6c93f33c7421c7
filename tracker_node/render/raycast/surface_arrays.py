"""Colors, normals and textures of a model's shapes, packed into arrays for the kernels; and colors read out of the textures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.shapes.primitives import Box, Mesh
from ..shape_arrays import MadeOnce
from .kernels import pixel_function

NO_TEXTURE = -1
N_LEVELS = 12  # of a texture, each half as large as the one before; the last ones repeat once there is but one pixel


@dataclass(frozen=True, eq=False)
class SurfaceArrays:
    """What never changes while a model moves. Triangles of all meshes are numbered one after the other.

    Attributes
    ----------
    colors : (n, 6, 3) float32 RGB, 0..255, of the faces of a box in the order of `primitives.BOX_FACES`; six times the
        same of other shapes.
    textures : (n, 6) index of the texture on each face of a box (of a mesh: six times the same), or `NO_TEXTURE`.
    corners : (m, 3, 6) float32, of the corners of the triangles: unit normal (shape frame), and color as in ``colors``, or with
        a texture (u, v, 0), u to the right and v **downward**, 0..1 over the whole texture.
    levels : (k, `N_LEVELS`, 3) first texel, width and height of each level of each texture.
    texels : (t, 3) uint8 RGB, row by row.
    """

    colors: np.ndarray
    textures: np.ndarray
    corners: np.ndarray
    levels: np.ndarray
    texels: np.ndarray


class _Album:
    """Textures with all their levels, one after the other."""

    def __init__(self):
        self.levels: list[list[tuple[int, int, int]]] = []
        self.texels: list[np.ndarray] = [np.zeros((0, 3), dtype=np.uint8)]
        self._size = 0

    def add(self, texture: np.ndarray) -> int:
        rows: list[tuple[int, int, int]] = []
        for _ in range(N_LEVELS):
            height, width = texture.shape[:2]
            if not rows or rows[-1][1:] != (width, height):
                start = self._size
                self.texels.append(texture.reshape(-1, 3))
                self._size += width * height
            rows.append((start, width, height))
            texture = cv2.resize(texture, (max(1, width // 2), max(1, height // 2)), interpolation=cv2.INTER_AREA)
        self.levels.append(rows)
        return len(self.levels) - 1


def _corner_colors(mesh: Mesh, color_rgb: tuple[int, int, int]) -> np.ndarray:
    if mesh.uv is not None:
        return np.stack([mesh.uv[..., 0], 1.0 - mesh.uv[..., 1], np.zeros(mesh.uv.shape[:2])], axis=-1)
    if mesh.vertex_colors_rgb is not None:
        return mesh.vertex_colors_rgb[mesh.faces]
    if mesh.face_colors_rgb is not None:
        return np.repeat(mesh.face_colors_rgb[:, None], 3, axis=1)
    return np.broadcast_to(np.array(color_rgb), (len(mesh.faces), 3, 3))


def _corner_normals(mesh: Mesh) -> np.ndarray:
    if mesh.normals is not None:
        return mesh.normals[mesh.faces]
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return np.repeat(normals[:, None], 3, axis=1)


def _make_surface_arrays(model: ArticulatedModel) -> SurfaceArrays:
    n, album = len(model.shapes), _Album()
    colors, textures = np.empty((n, 6, 3), dtype=np.float32), np.full((n, 6), NO_TEXTURE, dtype=np.int64)
    corners = [np.zeros((0, 3, 6))]
    for i, shape in enumerate(model.shapes):
        primitive = shape.primitive
        colors[i] = shape.color_rgb
        if isinstance(primitive, Box):
            if primitive.face_colors_rgb is not None:
                colors[i] = primitive.face_colors_rgb
            for j, texture in enumerate(primitive.textures or ()):
                if texture is not None:
                    textures[i, j] = album.add(texture)
        elif isinstance(primitive, Mesh):
            corners.append(np.concatenate([_corner_normals(primitive), _corner_colors(primitive, shape.color_rgb)], axis=-1))
            if primitive.texture is not None:
                textures[i] = album.add(primitive.texture)
    levels = np.array(album.levels, dtype=np.int64).reshape(-1, N_LEVELS, 3)
    return SurfaceArrays(colors, textures, np.concatenate(corners).astype(np.float32), levels, np.concatenate(album.texels))


surface_arrays: Callable[[ArticulatedModel], SurfaceArrays] = MadeOnce(_make_surface_arrays)


_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@pixel_function
def _bilinear(texels, start, width, height, u, v):
    """Color (r, g, b) of a level of a texture at (u, v), 0..1 from its upper left corner; its border goes on outside."""
    x = min(max(u * np.float32(width) - _HALF, _ZERO), np.float32(width - 1))
    y = min(max(v * np.float32(height) - _HALF, _ZERO), np.float32(height - 1))
    i, j = int(x), int(y)
    fx, fy = x - np.float32(i), y - np.float32(j)
    a = start + j * width + i
    b = a + (1 if i + 1 < width else 0)
    down = width if j + 1 < height else 0
    c, d = a + down, b + down
    wa, wb, wc, wd = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy), (_ONE - fx) * fy, fx * fy
    return (
        wa * texels[a, 0] + wb * texels[b, 0] + wc * texels[c, 0] + wd * texels[d, 0],
        wa * texels[a, 1] + wb * texels[b, 1] + wc * texels[c, 1] + wd * texels[d, 1],
        wa * texels[a, 2] + wb * texels[b, 2] + wc * texels[c, 2] + wd * texels[d, 2],
    )


@pixel_function
def sample(levels, texels, texture, u, v, ux, vx, uy, vy):
    """Color of a texture, of the levels whose texels are about as large as a pixel.

    Parameters
    ----------
    levels, texels : of `SurfaceArrays`.
    texture : index of the texture.
    u, v : place, 0..1 from its upper left corner.
    ux, vx : what one pixel to the right changes (u, v) by.
    uy, vy : what one pixel down changes (u, v) by.

    Returns
    -------
    r, g, b : float32 in 0..255.
    """
    width, height = levels[texture, 0, 1], levels[texture, 0, 2]
    ux, uy, vx, vy = ux * np.float32(width), uy * np.float32(width), vx * np.float32(height), vy * np.float32(height)
    square = max(ux * ux + vx * vx, uy * uy + vy * vy)
    if not square > _ONE:
        return _bilinear(texels, levels[texture, 0, 0], width, height, u, v)
    level = min(_HALF * np.log2(square), np.float32(N_LEVELS - 2))
    k = int(level)
    f = level - np.float32(k)
    r0, g0, b0 = _bilinear(texels, levels[texture, k, 0], levels[texture, k, 1], levels[texture, k, 2], u, v)
    r1, g1, b1 = _bilinear(texels, levels[texture, k + 1, 0], levels[texture, k + 1, 1], levels[texture, k + 1, 2], u, v)
    return r0 + f * (r1 - r0), g0 + f * (g1 - g0), b0 + f * (b1 - b0)
