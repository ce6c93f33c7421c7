"""Points on the textured faces of a body, each with the color that the texture has there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...errors import ModelError
from ...model.articulated import ArticulatedModel, Shape
from ...model.shapes.primitives import BOX_FACES, Box

# Normal, direction of a texture's columns, and of its rows, of each face of a box (`model.shapes.primitives.Box`)
_FACE_AXES = {
    "+x": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "-x": ((-1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "+y": ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
    "-y": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
    "+z": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "-z": ((0, 0, -1), (-1, 0, 0), (0, -1, 0)),
}


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points fixed to links.

    Attributes
    ----------
    positions, normals : (n, 3) in the frames of their links, meters; unit normals point outward.
    links : (n,) link of each point.
    colors : (n, 3) float32 RGB, 0..255, of the texture blurred as wide as the points are apart.
    spacing_m : distance of neighbors.
    """

    positions: np.ndarray
    normals: np.ndarray
    links: np.ndarray
    colors: np.ndarray
    spacing_m: float


def textured_extent(model: ArticulatedModel) -> float:
    """The longest edge of all textured faces, meters.

    Raises
    ------
    ModelError : when the model has no box with a texture on it.
    """
    edges = [max(abs(columns @ size), abs(rows @ size)) for _, size, (_, columns, rows), _ in _faces(model)]
    if not edges:
        raise ModelError(f"model '{model.name}' has no box with a texture on one of its faces (shapes.<name>.textures)")
    return float(max(edges))


def surface_points(model: ArticulatedModel, spacing_m: float) -> SurfacePoints:
    """A grid of points on every textured face.

    Parameters
    ----------
    model : with boxes that have textures.
    spacing_m : about how far apart points are.

    Returns
    -------
    The points of all faces.
    """
    textured_extent(model)
    positions, normals, links, colors = [], [], [], []
    for shape, size, (normal, columns, rows), texture in _faces(model):
        width, height = abs(columns @ size), abs(rows @ size)
        u, v = _cells(width, spacing_m), _cells(height, spacing_m)
        grid_u, grid_v = (g.ravel() for g in np.meshgrid(u, v))
        on_face = normal * size / 2.0 + np.outer((grid_u - 0.5) * width, columns) + np.outer((grid_v - 0.5) * height, rows)
        T = shape.T_link_shape
        positions.append(on_face @ T[:3, :3].T + T[:3, 3])
        normals.append(np.broadcast_to(T[:3, :3] @ normal, on_face.shape))
        links.append(np.full(len(on_face), model.chain.link_index(shape.link)))
        colors.append(_colors(texture, grid_u, grid_v, spacing_m, width, height))
    return SurfacePoints(
        np.concatenate(positions), np.concatenate(normals), np.concatenate(links), np.concatenate(colors), spacing_m
    )


def _faces(model: ArticulatedModel) -> list[tuple[Shape, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]]:
    """(shape, size of its box, (normal, columns, rows) of the face, texture) of every face with a texture."""
    found = []
    for shape in model.shapes:
        if isinstance(shape.primitive, Box):
            for name, texture in zip(BOX_FACES, shape.primitive.textures or (), strict=False):
                if texture is not None:
                    normal, columns, rows = (np.array(axis, dtype=np.float64) for axis in _FACE_AXES[name])
                    found.append((shape, np.array(shape.primitive.size), (normal, columns, rows), texture))
    return found


def _cells(length: float, spacing: float) -> np.ndarray:
    """Centers, 0..1, of the cells that a length is divided into."""
    n = max(2, round(length / spacing))
    return (np.arange(n) + 0.5) / n


def _colors(texture: np.ndarray, u: np.ndarray, v: np.ndarray, spacing: float, width: float, height: float) -> np.ndarray:
    rows, columns = texture.shape[:2]
    blurred: np.ndarray = texture.astype(np.float32)
    sigma_x, sigma_y = 0.5 * spacing * columns / width, 0.5 * spacing * rows / height
    if max(sigma_x, sigma_y) > 0.3:
        blurred = cv2.GaussianBlur(blurred, (0, 0), max(sigma_x, 0.1), sigmaY=max(sigma_y, 0.1), borderType=cv2.BORDER_REPLICATE)
    x, y = (u * columns - 0.5).astype(np.float32), (v * rows - 0.5).astype(np.float32)
    # In strips: cv2.remap takes no more than 32767 rows
    strips = zip(np.array_split(x, 1 + x.size // 30000), np.array_split(y, 1 + y.size // 30000), strict=True)
    sampled = [cv2.remap(blurred, a[:, None], b[:, None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for a, b in strips]
    return np.concatenate(sampled).reshape(-1, 3)
