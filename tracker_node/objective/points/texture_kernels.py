"""Colors of surface points compared with an image, whatever the camera's brightness and contrast.

Each channel of each camera has a gain a and an offset b of its own: r = m - (a I + b), with m the color of a point and I that
of the image where the point is seen. The best a and b for the weights w are known in closed form, and the Gauss-Newton matrix
is that of the residual without them (variable projection): what a change of brightness would explain as well carries no
information.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import NEAR, project_point
from ...compiled.kernels import compiled

LEAST_POINTS = 12  # of one camera
LEAST_GAIN = 1e-3
NOISE_VARIANCE = 1.0  # gray levels squared, of an image: a flat region correlates with nothing
REWEIGHTED = 3  # rounds of weights
N_WRENCH = 6
_LARGE = 1e100  # of a product, whose next factor is far from what a float can hold

# What a point is to a camera: of no interest; seen at first but no longer within the image; within the image
UNSEEN, OUTSIDE, INSIDE = 0, 1, 2


@compiled
def look(points, Ts_world_link, camera, picture, frozen, flags, values, gradients, places):
    """Colors of the image at the points that face the camera.

    Parameters
    ----------
    points : (positions, normals, links), see `SurfacePoints`.
    Ts_world_link : (n_links, 4, 4).
    camera : (params, R_cam_world, t_cam_world, center, least cosine of a face to the line of sight).
    picture : ((h, w, 3) uint8 RGB, how many times the image was halved).
    frozen : points that are `UNSEEN` stay so, and others become `OUTSIDE` at worst.
    flags : (n,) overwritten: `UNSEEN`, `OUTSIDE` or `INSIDE`.
    values, gradients, places : (n, 3), (n, 3, 3) image_D_point in world axes, (n, 3) world. Valid where a point is `INSIDE`.

    Returns
    -------
    int : points within the image.
    """
    positions, normals, links = points
    params, R, t, center, least_cosine = camera
    pixels, octave = picture
    height, width = pixels.shape[0], pixels.shape[1]
    shrink = 1.0 / (1 << octave)
    inside, plain = 0, params[5] == 0.0
    for i in range(positions.shape[0]):
        T = Ts_world_link[links[i]]
        if frozen and flags[i] == UNSEEN:
            continue
        flags[i] = OUTSIDE if frozen else UNSEEN
        p, n, x = positions[i], normals[i], places[i]
        facing, far = 0.0, 0.0
        for a in range(3):
            x[a] = T[a, 0] * p[0] + T[a, 1] * p[1] + T[a, 2] * p[2] + T[a, 3]
            away = center[a] - x[a]
            facing += (T[a, 0] * n[0] + T[a, 1] * n[1] + T[a, 2] * n[2]) * away
            far += away * away
        if not frozen and facing < least_cosine * np.sqrt(far):
            continue
        xc = R[0, 0] * x[0] + R[0, 1] * x[1] + R[0, 2] * x[2] + t[0]
        yc = R[1, 0] * x[0] + R[1, 1] * x[1] + R[1, 2] * x[2] + t[1]
        zc = R[2, 0] * x[0] + R[2, 1] * x[1] + R[2, 2] * x[2] + t[2]
        if plain and zc >= NEAR:  # no distortion: without a call
            iz = 1.0 / zc
            xn, yn = xc * iz, yc * iz
            ok, u, v = True, params[0] * xn + params[4] * yn + params[2], params[1] * yn + params[3]
            ux, uy, vx, vy = params[0] * iz, params[4] * iz, 0.0, params[1] * iz
            uz, vz = -(ux * xn + uy * yn), -vy * yn
        else:
            ok, u, v, ux, uy, uz, vx, vy, vz = project_point(params, xc, yc, zc)
        u, v = u * shrink, v * shrink
        if not ok or u < 0.0 or v < 0.0 or u >= width - 1.0 or v >= height - 1.0:
            continue
        flags[i] = INSIDE
        inside += 1
        left, top = int(u), int(v)
        fu, fv = u - left, v - top
        for c in range(3):
            q00, q01 = float(pixels[top, left, c]), float(pixels[top, left + 1, c])
            q10, q11 = float(pixels[top + 1, left, c]), float(pixels[top + 1, left + 1, c])
            upper, lower = q00 + fu * (q01 - q00), q10 + fu * (q11 - q10)
            values[i, c] = upper + fv * (lower - upper)
            along_u = (q01 - q00 + fv * (q11 - q10 - q01 + q00)) * shrink
            along_v = (lower - upper) * shrink
            gx, gy, gz = along_u * ux + along_v * vx, along_u * uy + along_v * vy, along_u * uz + along_v * vz
            for a in range(3):
                gradients[i, c, a] = gx * R[0, a] + gy * R[1, a] + gz * R[2, a]
    return inside


@compiled
def _sum_log1p(squares):
    """Sum of log(1 + square), by the logarithm of products: one takes as long as twenty."""
    total, product = 0.0, 1.0
    for k in range(squares.size):
        product *= 1.0 + squares[k]
        if product > _LARGE:
            total += math.log(product)
            product = 1.0
    return total + math.log(product)


@compiled
def fit_brightness(colors, values, flags, channel, scale, weights):
    """Best gain and offset of one channel under a Cauchy kernel.

    A point that is `OUTSIDE` has no weight and costs as much as on a flat image; the image's noise, which the gain enlarges,
    costs too.

    Parameters
    ----------
    colors, values, flags : (n, 3) of the texture, (n, 3) of the image, and (n,), of `look`.
    channel : 0..2.
    scale : of the kernel, gray levels.
    weights : (n,), overwritten.

    Returns
    -------
    Gain, offset, weighted mean of I, weighted sum of (I - mean)^2, sum of weights, robust cost, that of a flat image, points.
    """
    n, count, inside, plain_mean = colors.shape[0], 0, 0, 0.0
    own, seen, places = np.empty(n), np.empty(n), np.empty(n, dtype=np.int64)  # of the points within the image, in a row
    for i in range(n):
        weights[i] = 0.0
        if flags[i] != UNSEEN:
            count += 1
            plain_mean += colors[i, channel]
        if flags[i] == INSIDE:
            own[inside], seen[inside], places[inside] = colors[i, channel], values[i, channel], i
            inside += 1
    if count == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    plain_mean /= count
    squares, k = np.empty(n), 0
    for i in range(n):
        if flags[i] != UNSEEN:
            off = (colors[i, channel] - plain_mean) / scale
            squares[k] = off * off
            k += 1
    flat = scale * scale * _sum_log1p(squares[:count])
    for k in range(inside):
        off = (own[k] - plain_mean) / scale
        squares[k] = off * off
    flat_inside = scale * scale * _sum_log1p(squares[:inside])
    if inside < LEAST_POINTS:
        return 0.0, 0.0, 0.0, 0.0, 0.0, flat, flat, count
    gain, offset, mean_i, var_i, total = 0.0, 0.0, 0.0, 0.0, 0.0
    counts = np.ones(inside)
    for _ in range(REWEIGHTED):
        total, mean_i, mean_m = 0.0, 0.0, 0.0
        for k in range(inside):
            w = counts[k]
            total += w
            mean_i += w * seen[k]
            mean_m += w * own[k]
        mean_i, mean_m = mean_i / total, mean_m / total
        var_i, covariance = 0.0, 0.0
        for k in range(inside):
            d = seen[k] - mean_i
            wd = counts[k] * d
            var_i += wd * d
            covariance += wd * (own[k] - mean_m)
        gain = max(covariance / (var_i + NOISE_VARIANCE * total), LEAST_GAIN)
        offset = mean_m - gain * mean_i
        for k in range(inside):
            off = (own[k] - gain * seen[k] - offset) / scale
            squares[k] = off * off
            counts[k] = 1.0 / (1.0 + squares[k])
    for k in range(inside):
        weights[places[k]] = counts[k]
    cost = scale * scale * _sum_log1p(squares[:inside]) + gain * gain * NOISE_VARIANCE * total
    return gain, offset, mean_i, var_i, total, cost + flat - flat_inside, flat, count


@compiled
def add_channel(colors, values, gradients, places, links, flags, channel, fit, weights, normal, gradient, shared):
    """Add one channel to the normal equations of the links.

    Parameters
    ----------
    colors, values, gradients, places : see `look` and `fit_brightness`.
    links, flags : (n,), and that of `look`.
    channel : 0..2.
    fit, weights : of `fit_brightness`.
    normal, gradient : (n_links, 6, 6) and (n_links, 6), about twists (v, omega) at the world's origin, added to.
    shared : (2, n_links, 6) what gain and offset take away, added to: H loses the outer product of each of its two rows.
    """
    gain, offset, mean_i, var_i, total = fit[0], fit[1], fit[2], fit[3], fit[4]
    one, two = 1.0 / np.sqrt(total), 1.0 / np.sqrt(max(var_i, 1e-12))
    wrench, upper = np.empty(N_WRENCH), np.zeros(normal.shape)
    for i in range(colors.shape[0]):
        if flags[i] != INSIDE:
            continue
        w, g, x, link = weights[i], gradients[i, channel], places[i], links[i]
        r = colors[i, channel] - gain * values[i, channel] - offset
        for a in range(3):
            wrench[a] = -gain * g[a]
        wrench[3] = -gain * (x[1] * g[2] - x[2] * g[1])
        wrench[4] = -gain * (x[2] * g[0] - x[0] * g[2])
        wrench[5] = -gain * (x[0] * g[1] - x[1] * g[0])
        d = values[i, channel] - mean_i
        for a in range(N_WRENCH):
            weighted = w * wrench[a]
            gradient[link, a] += weighted * r
            shared[0, link, a] += weighted * one
            shared[1, link, a] += weighted * d * two
            for b in range(a, N_WRENCH):
                upper[link, a, b] += weighted * wrench[b]
    for link in range(normal.shape[0]):
        for a in range(N_WRENCH):
            normal[link, a, a] += upper[link, a, a]
            for b in range(a + 1, N_WRENCH):
                normal[link, a, b] += upper[link, a, b]
                normal[link, b, a] += upper[link, a, b]
