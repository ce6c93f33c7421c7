"""Where in an image a body can be at all, from boxes around its shapes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...camera.model import NEAR
from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ...model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive
from ..renderer import Region
from ..shape_arrays import MadeOnce, ray_table
from .coefficients import pixel_box

_GROWN = 1.001  # polyhedra of the same volume as round shapes are that much larger, at most


def _ends(primitive: Primitive) -> np.ndarray:
    """(2, 3) lowest and highest coordinates in the frame of the shape."""
    if isinstance(primitive, Ellipsoid):
        half = np.asarray(primitive.radii)
    elif isinstance(primitive, Box):
        half = 0.5 * np.asarray(primitive.size)
    elif isinstance(primitive, Mesh):
        return np.stack([primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)])
    else:
        scale = max(1.0 + primitive.k * primitive.z1, 1.0 + primitive.k * primitive.z2)
        a, b = scale * primitive.a, scale * primitive.b
        return np.array([[-a, -b, primitive.z1], [a, b, primitive.z2]])
    return np.stack([-half, half])


def _make_corners(model: ArticulatedModel) -> np.ndarray:
    corners = np.empty((len(model.shapes), 8, 3))
    for i, shape in enumerate(model.shapes):
        low, high = _ends(shape.primitive)
        middle, half = 0.5 * (low + high), 0.5 * _GROWN * (high - low)
        corners[i] = middle + half * (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0)
    return corners


_corners: Callable[[ArticulatedModel], np.ndarray] = MadeOnce(_make_corners)


def corners_in_camera(configuration: Configuration, camera: Camera) -> np.ndarray:
    """Corners of boxes around the shapes.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its pose.

    Returns
    -------
    (n_shapes, 8, 3) camera frame, meters.
    """
    T = camera.T_cam_world @ configuration.Ts_world_shape
    return _corners(configuration.model) @ np.swapaxes(T[:, :3, :3], 1, 2) + T[:, None, :3, 3]


def body_extent(configuration: Configuration, camera: Camera, region: Region) -> Region | None:
    """A part of an image that holds all that a camera can see of a body there, and a little more.

    Parameters
    ----------
    configuration : the posed body.
    camera : with its lens and pose.
    region : (u0, v0, u1, v1) that counts.

    Returns
    -------
    (u0, v0, u1, v1) within the region; None if the body is not in it.
    """
    corners = corners_in_camera(configuration, camera)
    low, high = corners[..., 2].min(axis=1, initial=np.inf), corners[..., 2].max(axis=1, initial=-np.inf)
    if (high < NEAR).all():
        return None
    if (low[high >= NEAR] < NEAR).any():
        return region
    points = corners[low >= NEAR].reshape(-1, 3)
    points = points[:, :2] / points[:, 2:]
    out = np.empty(4, dtype=np.int64)
    box = np.concatenate([points.min(axis=0), points.max(axis=0)])
    pixel_box(camera.model.params, box, ray_table(camera.model).limits, np.array(region), out)
    u0, v0, u1, v1 = out.tolist()
    return (u0, v0, u1, v1) if u1 > u0 and v1 > v0 else None
