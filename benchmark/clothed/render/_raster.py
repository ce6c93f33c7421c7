"""A small rasterizer: nearest triangle of every pixel, for cameras and for the shadow maps of lights.

A view is a matrix (3, 4) that takes a world point to (u z, v z, z), u and v in pixels, integers at pixel centers.
"""

from __future__ import annotations

import numba as nb
import numpy as np

_NEAR_M = 0.1


def view_of(K: np.ndarray, T_world_cam: np.ndarray) -> np.ndarray:
    """The view of a camera.

    Parameters
    ----------
    K : (3, 3) intrinsics.
    T_world_cam : (4, 4) pose, x right, y down, z forward.

    Returns
    -------
    (3, 4) matrix.
    """
    R, t = T_world_cam[:3, :3], T_world_cam[:3, 3]
    return K @ np.concatenate([R.T, (-R.T @ t)[:, None]], axis=1)


def looking_at(position: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Pose (4, 4) of an upright camera: x right, y down, z towards the target.

    Parameters
    ----------
    position, target : (3,) world, meters.

    Returns
    -------
    ``T_world_cam``.
    """
    z = (target - position) / np.linalg.norm(target - position)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), position
    return pose


def project(view: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Pixels and depths.

    Parameters
    ----------
    view : (3, 4).
    points : (n, 3) world, meters.

    Returns
    -------
    (n, 3): u, v, and depth in meters.
    """
    uvz = points @ view[:, :3].T + view[:, 3]
    uvz[:, :2] /= uvz[:, 2:]
    return uvz


@nb.njit(cache=True)
def nearest(projected, faces, culls, inverse_depth, face):
    """Draw triangles into a buffer.

    Parameters
    ----------
    projected : (n, 3) pixels and depths of the vertices.
    faces : (m, 3).
    culls : leave out what is seen from behind.
    inverse_depth : (h, w) float32, 0 where there is nothing; changed.
    face : (h, w) int32 of the triangle drawn; changed.
    """
    rows, columns = inverse_depth.shape
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if projected[a, 2] < _NEAR_M or projected[b, 2] < _NEAR_M or projected[c, 2] < _NEAR_M:
            continue
        ua, va, ub, vb, uc, vc = (
            projected[a, 0], projected[a, 1], projected[b, 0], projected[b, 1], projected[c, 0], projected[c, 1]
        )  # fmt: skip
        area = (ub - ua) * (vc - va) - (vb - va) * (uc - ua)
        if area == 0.0 or (culls and area > 0.0):  # v points down: what faces the camera turns the other way
            continue
        za, zb, zc = 1.0 / projected[a, 2], 1.0 / projected[b, 2], 1.0 / projected[c, 2]
        for v in range(max(0, int(np.ceil(min(va, vb, vc)))), min(rows - 1, int(np.floor(max(va, vb, vc)))) + 1):
            for u in range(max(0, int(np.ceil(min(ua, ub, uc)))), min(columns - 1, int(np.floor(max(ua, ub, uc)))) + 1):
                wa = ((ub - u) * (vc - v) - (vb - v) * (uc - u)) / area
                wb = ((uc - u) * (va - v) - (vc - v) * (ua - u)) / area
                wc = 1.0 - wa - wb
                if wa < 0.0 or wb < 0.0 or wc < 0.0:
                    continue
                z = wa * za + wb * zb + wc * zc
                if z > inverse_depth[v, u]:
                    inverse_depth[v, u] = z
                    face[v, u] = f
