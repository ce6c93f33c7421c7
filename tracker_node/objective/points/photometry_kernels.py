"""Colors of a body's surface points against a blurred image: residuals, derivatives, and their sums by link."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from ...camera.model import project_point

COST, WEIGHTED_SQUARES, WEIGHT, COUNT, N_SUMS = 0, 1, 2, 3, 4


@nb.njit(cache=True, nogil=True, error_model="numpy")
def add_points(points, used_links, Ts_world_link, camera, picture, robust_scale, derivatives, normal, gradient, sums):
    """Add the points of some links to a camera's sums.

    A point that has left the image costs what a difference of ``robust_scale`` does, wherever it goes.

    Parameters
    ----------
    points : positions (n, 3) in the frames of their links, links (n,), features (n, n_channels) that they should have.
    used_links : (n_links,) mask.
    Ts_world_link : (n_links, 4, 4).
    camera : params, R_cam_world (3, 3), t_cam_world (3,).
    picture : features (h, w, n_channels) float32, first column and row (of the full image), and how often that was halved.
    robust_scale : gray levels at which a difference begins to count as something else.
    derivatives : False leaves ``normal`` and ``gradient`` alone.
    normal, gradient : (n_links, 6, 6) and (n_links, 6), about twists (v, omega) at the world's origin, added to.
    sums : (`N_SUMS`,) robust cost, weighted squares, weights and number of points, added to.
    """
    positions, links, features = points
    params, R, t = camera
    pixels, u0, v0, octave = picture
    height, width, n_channels = pixels.shape
    shrink, scale2 = 1.0 / (1 << octave), robust_scale * robust_scale
    x, g, b, M = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    W = np.zeros((6, 3))  # wrench_D_force of a point: the force, and its moment about the world's origin
    W[0, 0], W[1, 1], W[2, 2] = 1.0, 1.0, 1.0
    for i in range(positions.shape[0]):
        link = links[i]
        if not used_links[link]:
            continue
        T, p = Ts_world_link[link], positions[i]
        for a in range(3):
            x[a] = T[a, 0] * p[0] + T[a, 1] * p[1] + T[a, 2] * p[2] + T[a, 3]
        ok, u, v, ux, uy, uz, vx, vy, vz = project_point(
            params,
            R[0, 0] * x[0] + R[0, 1] * x[1] + R[0, 2] * x[2] + t[0],
            R[1, 0] * x[0] + R[1, 1] * x[1] + R[1, 2] * x[2] + t[1],
            R[2, 0] * x[0] + R[2, 1] * x[1] + R[2, 2] * x[2] + t[2],
        )
        sums[COUNT] += 1.0
        u, v = (u - u0 + 0.5) * shrink - 0.5, (v - v0 + 0.5) * shrink - 0.5
        if not ok or u < 1.0 or v < 1.0 or u >= width - 2.0 or v >= height - 2.0:
            sums[COST] += scale2 * math.log(2.0)
            continue
        left, top = int(u), int(v)
        fu, fv = u - left, v - top
        square = 0.0
        for a in range(3):
            b[a] = 0.0
            for c in range(3):
                M[a, c] = 0.0
        for c in range(n_channels):
            q00, q01 = pixels[top, left, c], pixels[top, left + 1, c]
            q10, q11 = pixels[top + 1, left, c], pixels[top + 1, left + 1, c]
            upper, lower = q00 + fu * (q01 - q00), q10 + fu * (q11 - q10)
            r = upper + fv * (lower - upper) - features[i, c]
            square += r * r
            if derivatives:
                # Central differences at the four pixels around, interpolated: those of the bilinear surface itself jump at pixels
                left_u = (1.0 - fv) * (q01 - pixels[top, left - 1, c]) + fv * (q11 - pixels[top + 1, left - 1, c])
                right_u = (1.0 - fv) * (pixels[top, left + 2, c] - q00) + fv * (pixels[top + 1, left + 2, c] - q10)
                upper_v = (1.0 - fu) * (q10 - pixels[top - 1, left, c]) + fu * (q11 - pixels[top - 1, left + 1, c])
                lower_v = (1.0 - fu) * (pixels[top + 2, left, c] - q00) + fu * (pixels[top + 2, left + 1, c] - q01)
                along_u = 0.5 * (left_u + fu * (right_u - left_u)) * shrink
                along_v = 0.5 * (upper_v + fv * (lower_v - upper_v)) * shrink
                gx, gy, gz = along_u * ux + along_v * vx, along_u * uy + along_v * vy, along_u * uz + along_v * vz
                for a in range(3):
                    g[a] = gx * R[0, a] + gy * R[1, a] + gz * R[2, a]
                for a in range(3):
                    b[a] += g[a] * r
                    for d in range(3):
                        M[a, d] += g[a] * g[d]
        off = square / scale2
        weight = 1.0 / (1.0 + off)  # Cauchy
        sums[COST] += scale2 * math.log(1.0 + off)
        sums[WEIGHTED_SQUARES] += weight * square
        sums[WEIGHT] += weight
        if derivatives:
            W[3, 1], W[3, 2], W[4, 0], W[4, 2], W[5, 0], W[5, 1] = -x[2], x[1], x[2], -x[0], -x[1], x[0]
            for a in range(6):
                gradient[link, a] += weight * (W[a, 0] * b[0] + W[a, 1] * b[1] + W[a, 2] * b[2])
                for d in range(a, 6):
                    value = 0.0
                    for e in range(3):
                        value += W[a, e] * (M[e, 0] * W[d, 0] + M[e, 1] * W[d, 1] + M[e, 2] * W[d, 2])
                    normal[link, a, d] += weight * value


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mirror(normal):
    """Fill the lower triangles of (n, 6, 6)."""
    for link in range(normal.shape[0]):
        for a in range(6):
            for b in range(a):
                normal[link, a, b] = normal[link, b, a]
