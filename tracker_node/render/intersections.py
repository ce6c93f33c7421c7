"""Lines of sight against boxes and triangle meshes: where they enter, and whether anything is in the way."""

from __future__ import annotations

import numba as nb
import numpy as np

from .mesh_edges import COUNT, FIRST, HIGH, LOW

# Columns of ``ranges``, one row per shape: its edges, the root of its tree, what sort of solid it is, whether its caps count
FIRST_EDGE, N_EDGES, ROOT, SORT, CAPS = range(5)
N_RANGE_COLUMNS = 5
NO_SOLID, BOX_SOLID, CONVEX_MESH, MESH = range(4)

NO_HIT = 1e30
_STACK = 64


@nb.njit(cache=True, nogil=True, error_model="numpy")
def to_shape(T, center, dx, dy, dz):
    """A ray of the world in the frame of a shape: origin and direction, (6,)."""
    wx, wy, wz = center[0] - T[0, 3], center[1] - T[1, 3], center[2] - T[2, 3]
    return (
        T[0, 0] * wx + T[1, 0] * wy + T[2, 0] * wz,
        T[0, 1] * wx + T[1, 1] * wy + T[2, 1] * wz,
        T[0, 2] * wx + T[1, 2] * wy + T[2, 2] * wz,
        T[0, 0] * dx + T[1, 0] * dy + T[2, 0] * dz,
        T[0, 1] * dx + T[1, 1] * dy + T[2, 1] * dz,
        T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz,
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def slab_interval(node, ray, t_min, t_max):
    """The part (t_in, t_out) of [t_min, t_max] in which a ray (origin, direction) is in the box of a node; t_in > t_out: none."""
    for axis in range(3):
        origin, speed = ray[axis], ray[axis + 3]
        low, high = node[LOW + axis], node[HIGH + axis]
        if abs(speed) < 1e-12:
            if origin < low or origin > high:
                return 1.0, 0.0
            continue
        a, b = (low - origin) / speed, (high - origin) / speed
        if a > b:
            a, b = b, a
        t_min, t_max = max(t_min, a), min(t_max, b)
        if t_min > t_max:
            return 1.0, 0.0
    return t_min, t_max


@nb.njit(cache=True, nogil=True, error_model="numpy")
def triangle_hit(triangle, ray):
    """t where a ray meets a triangle, from either side, or `NO_HIT` (Moeller & Trumbore 1997)."""
    ex, ey, ez = triangle[3], triangle[4], triangle[5]
    fx, fy, fz = triangle[6], triangle[7], triangle[8]
    px, py, pz = ray[4] * fz - ray[5] * fy, ray[5] * fx - ray[3] * fz, ray[3] * fy - ray[4] * fx
    determinant = ex * px + ey * py + ez * pz
    if determinant == 0.0:
        return NO_HIT
    sx, sy, sz = ray[0] - triangle[0], ray[1] - triangle[1], ray[2] - triangle[2]
    u = (sx * px + sy * py + sz * pz) / determinant
    if u < 0.0 or u > 1.0:
        return NO_HIT
    qx, qy, qz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
    v = (ray[3] * qx + ray[4] * qy + ray[5] * qz) / determinant
    if v < 0.0 or u + v > 1.0:
        return NO_HIT
    return (fx * qx + fy * qy + fz * qz) / determinant


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mesh_hit(nodes, triangles, root, ray, t_max, any_hit):
    """Least t in (0, t_max) at which a ray meets a mesh (with ``any_hit``: the first that is found), or `NO_HIT`."""
    stack = np.empty(_STACK, dtype=np.int64)
    stack[0], top, best = root, 1, NO_HIT
    while top > 0:
        top -= 1
        node = nodes[stack[top]]
        t_in, t_out = slab_interval(node, ray, 0.0, min(t_max, best))
        if t_in > t_out:
            continue
        first, count = int(node[FIRST]), int(node[COUNT])
        if count == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
            continue
        for i in range(first, first + count):
            t = triangle_hit(triangles[i], ray)
            if 0.0 < t < t_max and t < best:
                if any_hit:
                    return t
                best = t
    return best


@nb.njit(cache=True, nogil=True, error_model="numpy")
def solid_hit(surfaces, shape, T, center, dx, dy, dz, t_max, any_hit):
    """Least t in [0, t_max) at which the ray center + t * (dx, dy, dz) is in a box or meets a mesh, or `NO_HIT`."""
    ranges, _, nodes, triangles = surfaces
    sort, root = ranges[shape, SORT], ranges[shape, ROOT]
    if sort == NO_SOLID:
        return NO_HIT
    ray = to_shape(T, center, dx, dy, dz)
    if sort == BOX_SOLID:
        t_in, t_out = slab_interval(nodes[root], ray, 0.0, t_max)
        return t_in if t_in < t_out else NO_HIT
    return mesh_hit(nodes, triangles, root, ray, t_max, any_hit)
