"""Many poses of one limb against the colors of an image, with the rest of the body as it is: the kernels.

Everything is as small as `limb_score.LimbScore` makes it. A pixel's log-likelihood goes from that of the
scene's colors to that of a part's where the part shows; so does a pose's, by the sum over what shows of the limb. Where the rest
of the body is before the limb, the limb changes nothing; where it is behind, what it would have gained there is lost.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from ...observation.appearance_kernels import log_positive
from ...render.raycast.coefficients import N_COEFFICIENTS
from ...render.raycast.kernels import LABEL_BITS, LANES
from ..lines.colors import other_density
from .evidence_kernels import draw_body

REST = np.int32(LABEL_BITS)  # label of all that is not the limb


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_maps(bgr, log_body, scene, room, darkest, step, clamp, region, maps):
    """Fill ``maps`` (h, w, n_classes) with the mean log(p_class / p_scene) of the colors in each cell of the image, on its
    ``region`` (u0, v0, u1, v1); the rest stays as it is.

    Cells are ``bgr.shape[0] // h`` pixels high, or a little more, and of their pixels every ``step``-th is looked at.
    ``log_body`` (n_colors, n_classes): log densities; ``scene``, ``room`` and ``darkest`` as in `lines.colors.read_lines`.
    """
    height, width, n_classes = maps.shape
    pixels, least_variance = room
    most = np.float32(0.5 / least_variance)
    rows, columns = bgr.shape[0] / height, bgr.shape[1] / width
    for i in range(region[1], region[3]):
        top, bottom = int(i * rows), int((i + 1) * rows)
        for j in range(region[0], region[2]):
            left, right = int(j * columns), int((j + 1) * columns)
            cell, count = maps[i, j], 0
            cell[:] = np.float32(0.0)
            for v in range(top, bottom, step):
                for u in range(left, right, step):
                    b, g, r = np.uint32(bgr[v, u, 0]), np.uint32(bgr[v, u, 1]), np.uint32(bgr[v, u, 2])
                    color = (np.int64(b >> 4) << 8) | np.int64(g & 0xF0) | np.int64(r >> 4)
                    mean = pixels[v, u] if pixels.size > 0 else np.uint32(0)
                    packed = b | (g << np.uint32(8)) | (r << np.uint32(16))
                    other = log_positive(other_density(packed, mean, scene[color], most, np.float32(darkest)))
                    for k in range(n_classes):
                        cell[k] += min(max(log_body[color, k] - other, -clamp), clamp)
                    count += 1
            for k in range(n_classes):
                cell[k] /= np.float32(count)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def draw_rest(kinds, dims, Ts_world_shape, camera, rays, maps, map_of_shape, buffer, gains):
    """Draw what is not the limb into ``buffer`` (all zero), labeled `REST`, and what it gains, pixel by pixel, into ``gains``."""
    params, limits, T_cam_world, size = camera
    coefficients, region = np.empty(N_COEFFICIENTS, dtype=np.float32), np.empty(4, dtype=np.int64)
    draw_body(kinds, dims, T_cam_world, Ts_world_shape, params, limits, rays[0], rays[1], size, coefficients, buffer, region)
    gains[:] = np.float32(0.0)
    for v in range(region[1], region[3]):
        for u in range(region[0], min(region[2], size[0])):
            label = buffer[v, u] & LABEL_BITS
            if label > 0:
                gains[v, u] = maps[v, u, map_of_shape[label - 1]]
                buffer[v, u] |= REST


@nb.njit(cache=True, nogil=True, error_model="numpy")
def score_limb(kinds, dims, Ts_world_shape, camera, rays, maps, map_of_shape, rest, gains, buffer, totals):
    """Add what a limb gains, and the pixels in which it shows, to ``totals`` (n_poses, 2), in one camera.

    ``kinds`` and ``dims`` (n,), (n, 5) and ``map_of_shape`` (n,) are of the limb's shapes, ``Ts_world_shape`` (n_poses, n, 4, 4);
    ``rest`` and ``gains`` of `draw_rest`; ``buffer`` is a copy of ``rest``, and left so.
    """
    params, limits, T_cam_world, size = camera
    coefficients, region = np.empty(N_COEFFICIENTS, dtype=np.float32), np.empty(4, dtype=np.int64)
    for n in range(Ts_world_shape.shape[0]):
        draw_body(
            kinds, dims, T_cam_world, Ts_world_shape[n], params, limits, rays[0], rays[1], size, coefficients, buffer, region
        )
        gain, seen = 0.0, 0
        for v in range(region[1], region[3]):
            for u in range(region[0], min(region[2], size[0])):
                label = buffer[v, u] & LABEL_BITS
                if 0 < label < REST:
                    gain += maps[v, u, map_of_shape[label - 1]] - gains[v, u]
                    seen += 1
            for u in range(region[0], min(-(-region[2] // LANES) * LANES, buffer.shape[1])):
                buffer[v, u] = rest[v, u]
        totals[n, 0] += gain
        totals[n, 1] += seen
