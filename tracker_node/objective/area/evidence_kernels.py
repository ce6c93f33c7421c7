"""Many poses of a body against maps of evidence: the kernels.

A map says of every pixel how much speaks for the body there (log-odds). The score of a pose is the sum of the map over the pixels
that the posed body covers: pixels of the body that are left out are missing in it, pixels of the scene that are covered count
against it.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from ...camera.model import NEAR
from ...model.kinematic_chain import forward_kinematics
from ...render.raycast.coefficients import (
    INVISIBLE,
    N_COEFFICIENTS,
    farthest_depth,
    normalized_box,
    pixel_box,
    shape_coefficients,
)
from ...render.raycast.kernels import LABEL_BITS, LANES, draw_shape
from ...render.shape_arrays import CONE


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _cone_box(dims, T, box):
    """Normalised coordinates (x0, y0, x1, y1) around the spheres about a cone's ends; False when these are not in front."""
    box[0], box[1], box[2], box[3] = 1e30, 1e30, -1e30, -1e30
    for end in range(2):
        z = dims[3 + end]
        radius = max(dims[0], dims[1]) * (1.0 + dims[2] * z)
        depth = T[2, 2] * z + T[2, 3]
        if depth < radius + NEAR:
            return False
        # sine of half the sphere's angle over its cosine, and what an oblique view adds
        reach = radius / np.sqrt(depth * depth - radius * radius)
        for i in range(2):
            middle = (T[i, 2] * z + T[i, 3]) / depth
            reach_i = reach * (1.0 + middle * middle)
            box[i], box[2 + i] = min(box[i], middle - reach_i), max(box[2 + i], middle + reach_i)
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def draw_body(kinds, dims, T_cam_world, Ts_world_shape, params, limits, xs, ys, size, coefficients, buffer, out):
    """Draw all shapes into ``buffer`` (h, w rounded up to sixteen), before what is farther; ``out`` (4,): what they may cover."""
    T, box, pixels, whole = np.empty((4, 4)), np.empty(4), np.empty(4, dtype=np.int64), np.zeros(4, dtype=np.int64)
    whole[2], whole[3] = size[0], size[1]
    corner = np.int64(0)  # as 0, its value would be part of a type
    out[0], out[1], out[2], out[3] = size[0], size[1], 0, 0
    for s in range(kinds.shape[0]):
        for i in range(4):
            for j in range(4):
                value = 0.0
                for m in range(4):
                    value += T_cam_world[i, m] * Ts_world_shape[s, m, j]
                T[i, j] = value
        if farthest_depth(kinds[s], dims[s], T) < NEAR:
            continue
        bounds = shape_coefficients(kinds[s], dims[s], T, coefficients)
        if bounds == INVISIBLE:
            continue
        inside = _cone_box(dims[s], T, box) if kinds[s] == CONE else normalized_box(kinds[s], dims[s], T, box)
        if inside:
            pixel_box(params, box, limits, whole, pixels)
        else:
            pixels[:] = whole
        if pixels[2] <= pixels[0] or pixels[3] <= pixels[1]:
            continue
        draw_shape(kinds[s], bounds, coefficients, s + 1, xs, ys, pixels, corner, corner, buffer)
        out[0], out[1] = min(out[0], pixels[0] // LANES * LANES), min(out[1], pixels[1])
        out[2], out[3] = max(out[2], pixels[2]), max(out[3], pixels[3])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _collect(buffer, region, width, maps, map_of_shape, total):
    """Add the maps (n_maps, h, w) under the body, and its pixels, to ``total`` (2,); the buffer is left all zero."""
    gain, covered = 0.0, 0
    for v in range(region[1], region[3]):
        for u in range(region[0], min(region[2], width)):
            label = buffer[v, u] & LABEL_BITS
            if label > 0:
                gain += maps[map_of_shape[label - 1], v, u]
                covered += 1
        for u in range(region[0], min(-(-region[2] // LANES) * LANES, buffer.shape[1])):
            buffer[v, u] = 0
    total[0] += gain
    total[1] += covered


@nb.njit(cache=True, nogil=True, error_model="numpy")
def place_shapes(chain, links, Ts_link_shape, roots, joints, Ts_world_shape):
    """Fill ``Ts_world_shape`` (n_states, n_shapes, 4, 4) of states with ``roots`` (n, 4, 4) and ``joints`` (n, n_axes).

    ``chain`` is what `forward_kinematics` takes of a kinematic chain.
    """
    parents, offsets, axis_start, axis_count, directions = chain
    Ts_world_link, twists = np.empty((parents.shape[0], 4, 4)), np.empty((6 + joints.shape[1], 6))
    for n in range(roots.shape[0]):
        forward_kinematics(parents, offsets, axis_start, axis_count, directions, roots[n], joints[n], Ts_world_link, twists)
        for s in range(links.shape[0]):
            for i in range(4):
                for j in range(4):
                    value = 0.0
                    for m in range(4):
                        value += Ts_world_link[links[s], i, m] * Ts_link_shape[s, m, j]
                    Ts_world_shape[n, s, i, j] = value


@nb.njit(cache=True, nogil=True, error_model="numpy")
def score_poses(kinds, dims, Ts_world_shape, camera, rays, maps, map_of_shape, buffer, totals):
    """Sums of the maps under posed bodies, and pixels of them, added to ``totals`` (n_states, 2), in one camera.

    Parameters
    ----------
    kinds, dims : (n,), (n, 5) of the shapes. Ts_world_shape : (n_states, n, 4, 4).
    camera : params, limits, T_cam_world, (width, height).
    rays : xs, ys of a `RayTable`.
    maps : (n_maps, h, w) float32. map_of_shape : (n,) which of them a shape reads.
    buffer : (h, w rounded up to sixteen) int32, all zero; it is left so.
    """
    params, limits, T_cam_world, size = camera
    xs, ys = rays
    coefficients, region = np.empty(N_COEFFICIENTS, dtype=np.float32), np.empty(4, dtype=np.int64)
    for n in range(Ts_world_shape.shape[0]):
        draw_body(kinds, dims, T_cam_world, Ts_world_shape[n], params, limits, xs, ys, size, coefficients, buffer, region)
        if region[2] > region[0]:
            _collect(buffer, region, size[0], maps, map_of_shape, totals[n])
