"""Correspondence lines: where, along the normal of a contour sample, the colors change from the body's to those beyond it.

A line has pixels on both sides of its sample. For a contour that is ``d`` pixels farther out, the log-likelihood of their colors
is, up to a constant, the sum of log(p_body / p_beyond) over the pixels inside; where the part is so narrow that the line reaches
across it, over those between its two contours. All of them together are a distribution of d, of which mean and variance are kept
(as in region-based trackers, e.g. Stoiber et al., 2020). On the finest scale the mean is refined below the pixel by the fraction
of the color inside in the mixed pixels. With the state the sample moves by n . (pixel - pixel at first), the residual is
that minus the mean.

What lies beyond is the scene, or, for contours within the outline, the part behind or the scene.

Where on a correspondence line the contour is: mean and variance over the places where it may be.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import NEAR, project_point
from ...compiled.kernels import compiled
from ...render.contour.generators import INNER, N_COLUMNS, NORMAL, P
from ...render.contour.samples import (
    BEYOND,
    CLASS,
    JACOBIAN,
    LINK,
    N_INFO_COLUMNS,
    N_PIXEL_COLUMNS,
    NU,
    NV,
    SHAPE,
    U,
    V,
    chords_px,
)
from ...render.contour.visibility import ray_interval
from .colors import exp_negative, read_lines
from .refinement import N_SUM_COLUMNS, refine_lines, step_distribution
from .table import (
    BEFORE,
    BEHIND,
    LINE_NU,
    LINE_NV,
    LINE_U,
    LINE_V,
    LOG_RATIO,
    LONGEST,
    MEAN,
    N_LINE_COLUMNS,
    N_PLAN_COLUMNS,
    OWN,
    POINT,
    PRECISION,
    WIDTH,
)

# Indices of the options
SCALE, HALF_LENGTH, CLAMP, SHARPNESS, MODEL_VARIANCE, ROBUST, CORRELATION, FINE, SHADOW = range(9)
N_OPTIONS = 9
# Indices of the statistics of one camera
COST, SQUARES, WEIGHT, COUNT, N_SAMPLES = range(5)
N_STATISTICS = 5

@compiled
def _plan(shapes, Ts, spheres, camera, rows, pixels, info, n, chords, classes, half, scale, plan):
    """Fill ``plan`` (n, `N_PLAN_COLUMNS`); `BEFORE` is -1 of inner edges."""
    for j in range(n):
        shape, beyond = info[j, SHAPE], info[j, BEYOND]
        width = max(1, int(chords[j, 0] / scale + 0.5))
        plan[j, OWN], plan[j, WIDTH], plan[j, BEHIND], plan[j, BEFORE] = classes[shape], width, -1, -1
        if beyond == shape:  # another side of the same part
            continue
        plan[j, BEFORE] = width if width <= half else 0
        if info[j, CLASS] == INNER and beyond >= 0:
            plan[j, BEHIND] = classes[beyond]
    _look_beyond(shapes, Ts, spheres, camera, rows, pixels, info, n, scale, plan)


@compiled
def _look_beyond(shapes, Ts, spheres, camera, rows, pixels, info, n, scale, plan):
    """Where another part of the body shows beyond the other side of a narrow part, it counts as wide.

    Beyond: three pixels inside of the contour opposite.
    """
    _, R, _, center = camera
    n_shapes = spheres.shape[0]
    for j in range(n):
        if plan[j, BEFORE] <= 0:
            continue
        nx, ny, nz = rows[j, NORMAL], rows[j, NORMAL + 1], rows[j, NORMAL + 2]
        cx = R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz
        cy = R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz
        cz = R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz
        along_u = pixels[j, JACOBIAN] * cx + pixels[j, JACOBIAN + 1] * cy + pixels[j, JACOBIAN + 2] * cz
        along_v = pixels[j, JACOBIAN + 3] * cx + pixels[j, JACOBIAN + 4] * cy + pixels[j, JACOBIAN + 5] * cz
        step = -(plan[j, WIDTH] * scale + 3.0) / math.sqrt(along_u * along_u + along_v * along_v)
        dx, dy, dz = (rows[j, P] + step * nx - center[0], rows[j, P + 1] + step * ny - center[1],
                      rows[j, P + 2] + step * nz - center[2])  # fmt: skip
        length_sq = dx * dx + dy * dy + dz * dz
        for other in range(n_shapes):
            wx, wy, wz = spheres[other, 0] - center[0], spheres[other, 1] - center[1], spheres[other, 2] - center[2]
            dot = wx * dx + wy * dy + wz * dz
            square = (wx * wx + wy * wy + wz * wz - spheres[other, 3] * spheres[other, 3]) * length_sq
            if square > dot * dot or other == info[j, SHAPE]:
                continue
            hit, _, t_out = ray_interval(shapes, other, Ts[other], center, dx, dy, dz)
            if hit and t_out > 0.0:
                plan[j, BEFORE] = 0
                break


@compiled
def _fit_creases(bgr, chords, info, n, half, scale, lines):
    """Mean, precision and log-ratio of the lines across inner edges."""
    sums, margin = np.empty((LONGEST + 1, N_SUM_COLUMNS)), int(2.0 / scale + 0.5)
    for j in range(n):
        if info[j, BEYOND] != info[j, SHAPE]:
            continue
        inside, free = max(1, int(chords[j, 0] / scale + 0.5)) - margin, int(chords[j, 1] / scale) - margin
        mean, precision, lines[j, LOG_RATIO] = step_distribution(
            bgr, lines[j, LINE_U], lines[j, LINE_V], lines[j, LINE_NU], lines[j, LINE_NV], scale, min(inside, 2 * half),
            min(free, 2 * half), sums,
        )  # fmt: skip
        lines[j, MEAN], lines[j, PRECISION] = scale * mean, precision / (scale * scale)


@compiled
def draw_lines(
    bgr, colors, room, silhouette, neighbors, classes, shapes, Ts_shape, spheres, Ts_link, camera, rows, pixels, info, n, options,
    lines,
):  # fmt: skip
    """Draw one line per contour sample and fit its distribution.

    The steps go over all lines one after another: an array that is handed from function to function for every line costs more
    than what is done with it.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    colors : (body (n_classes, n_colors), scene (n_colors,)) densities.
    room, silhouette, neighbors : see `colors.read_lines`.
    classes, shapes, Ts_shape : see `lines.camera.correspond_camera`.
    spheres : of `contour.world_spheres`.
    Ts_link, camera : (n_links, 4, 4), and (params, R, t, center).
    rows, pixels, info, n : of `render.contour.samples.collect_samples`.
    options : (`N_OPTIONS`,); ``options[SCALE]``: pixels from one place on the line to the next.
    lines : (n, `N_LINE_COLUMNS`), overwritten.
    """
    body, scene = colors
    scale, half = options[SCALE], int(options[HALF_LENGTH])
    for j in range(n):
        link = info[j, LINK]
        x, y, z = rows[j, P] - Ts_link[link, 0, 3], rows[j, P + 1] - Ts_link[link, 1, 3], rows[j, P + 2] - Ts_link[link, 2, 3]
        for i in range(3):
            lines[j, POINT + i] = Ts_link[link, 0, i] * x + Ts_link[link, 1, i] * y + Ts_link[link, 2, i] * z
        lines[j, LINE_U], lines[j, LINE_V] = pixels[j, U], pixels[j, V]
        lines[j, LINE_NU], lines[j, LINE_NV] = pixels[j, NU], pixels[j, NV]
    chords, plan = np.empty((n, 2)), np.empty((n, N_PLAN_COLUMNS), dtype=np.int32)
    chords_px(shapes, Ts_shape, camera, rows, pixels, info, n, (2 * half + 2) * scale, chords)
    _plan(shapes, Ts_shape, spheres, camera, rows, pixels, info, n, chords, classes, half, scale, plan)
    odds = np.empty((n, LONGEST), dtype=np.float32)
    read_lines(
        bgr, body, scene, room, silhouette, neighbors, np.float32(options[SHADOW]), np.float32(options[CLAMP]), scale, half,
        lines, plan, n, odds,
    )  # fmt: skip
    fit_distributions(odds, plan, n, half, scale, options[SHARPNESS], lines)
    _fit_creases(bgr, chords, info, n, half, scale, lines)
    if options[FINE] > 0.0:
        refine_lines(bgr, plan, n, scale, lines)


@compiled
def linearize_lines(lines, info, n, Ts_link, camera, options, normal, gradient, stats):
    """Add one camera's lines to the normal matrices of its links.

    Squared residuals are divided by their variance (that of the distribution and the model's own), robustly (Geman-McClure at
    ``options[ROBUST]`` standard deviations), and count as one in ``options[CORRELATION]``.

    Parameters
    ----------
    lines, info, n : (., `N_LINE_COLUMNS`) and (., `N_INFO_COLUMNS`), the first ``n`` rows.
    Ts_link : (n_links, 4, 4), where the body is.
    camera, options : (params, R, t, center), and (`N_OPTIONS`,).
    normal, gradient : (n_links, 6, 6), upper triangles, and (n_links, 6), added to.
    stats : (`N_STATISTICS`,), overwritten.
    """
    params, R, t, _ = camera
    robust_sq, model_variance, share = options[ROBUST] ** 2, options[MODEL_VARIANCE], 1.0 / options[CORRELATION]
    stats[:] = 0.0
    stats[N_SAMPLES] = n
    fx, fy, cx, cy, skew, plain = params[0], params[1], params[2], params[3], params[4], params[5] == 0.0
    g = np.empty(6)
    for j in range(n):
        if lines[j, PRECISION] <= 0.0:
            continue
        link, a, b, c = info[j, LINK], lines[j, POINT], lines[j, POINT + 1], lines[j, POINT + 2]
        px = Ts_link[link, 0, 0] * a + Ts_link[link, 0, 1] * b + Ts_link[link, 0, 2] * c + Ts_link[link, 0, 3]
        py = Ts_link[link, 1, 0] * a + Ts_link[link, 1, 1] * b + Ts_link[link, 1, 2] * c + Ts_link[link, 1, 3]
        pz = Ts_link[link, 2, 0] * a + Ts_link[link, 2, 1] * b + Ts_link[link, 2, 2] * c + Ts_link[link, 2, 3]
        x = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0]
        y = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1]
        z = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2]
        if plain and z >= NEAR:  # no distortion: without a call
            iz = 1.0 / z
            xn, yn = x * iz, y * iz
            u, v = fx * xn + skew * yn + cx, fy * yn + cy
            ux, uy, vx, vy = fx * iz, skew * iz, 0.0, fy * iz
            uz, vz = -(ux * xn + uy * yn), -vy * yn
        else:
            ok, u, v, ux, uy, uz, vx, vy, vz = project_point(params, x, y, z)
            if not ok:
                continue
        nu, nv = lines[j, LINE_NU], lines[j, LINE_NV]
        r = nu * (u - lines[j, LINE_U]) + nv * (v - lines[j, LINE_V]) - lines[j, MEAN]
        hx, hy, hz = nu * ux + nv * vx, nu * uy + nv * vy, nu * uz + nv * vz
        h0 = R[0, 0] * hx + R[1, 0] * hy + R[2, 0] * hz
        h1 = R[0, 1] * hx + R[1, 1] * hy + R[2, 1] * hz
        h2 = R[0, 2] * hx + R[1, 2] * hy + R[2, 2] * hz
        g[0], g[1], g[2] = h0, h1, h2
        g[3], g[4], g[5] = py * h2 - pz * h1, pz * h0 - px * h2, px * h1 - py * h0
        precision = 1.0 / (1.0 / lines[j, PRECISION] + model_variance)
        chi2 = r * r * precision
        ratio = robust_sq / (robust_sq + chi2)
        w = share * precision * ratio * ratio
        for a in range(6):
            wa = w * g[a]
            gradient[link, a] += wa * r
            for b in range(a, 6):
                normal[link, a, b] += wa * g[b]
        stats[COST] += share * ratio * chi2
        weight = precision * ratio * ratio
        stats[SQUARES] += weight * r * r
        stats[WEIGHT] += weight
        stats[COUNT] += 1.0


@compiled
def fill_lower(normal):
    """Make the matrices symmetric whose upper triangles have been summed."""
    for link in range(normal.shape[0]):
        for a in range(6):
            for b in range(a):
                normal[link, a, b] = normal[link, b, a]


def line_arrays(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Empty (rows, pixels, info, lines) for at most ``n`` samples."""
    return (
        np.zeros((n, N_COLUMNS)),
        np.zeros((n, N_PIXEL_COLUMNS)),
        np.zeros((n, N_INFO_COLUMNS), dtype=np.int32),
        np.zeros((n, N_LINE_COLUMNS)),
    )


_NEGLIGIBLE = np.float32(20.0)  # a log-likelihood lower by this
_ZERO = np.float32(0.0)


@compiled(fastmath={"reassoc", "contract"})
def fit_distributions(odds, plan, n, half, scale, sharpness, lines):
    """Mean and precision of the contour's offset, and the log-ratio, of lines that have colors.

    Parameters
    ----------
    odds : (n, .) the pixels between -half and half; before them, where the part is so narrow that the line reaches across it
        wherever its contour may be, as many as it is wide.
    plan, n : (., `N_PLAN_COLUMNS`), the first ``n`` rows.
    half, scale : offsets are -half ... half places, ``scale`` pixels apart.
    sharpness : factor of the log-likelihoods, for pixels that are not independent.
    lines : (., `N_LINE_COLUMNS`), these three columns written, in pixels.
    """
    values, count = np.empty(LONGEST, dtype=np.float32), np.uint64(2 * half + 1)
    middle, factor = np.float32(half), np.float32(sharpness)
    uniform = half * (half + 1.0) / 3.0 + 1.0 / 12.0
    for j in range(n):
        width = plan[j, BEFORE]
        if width < 0:
            continue
        value = _ZERO
        for k in range(width):
            value += odds[j, k]
        values[0] = best = value
        narrow = width > 0
        for k in range(2 * half):
            value += odds[j, k + width] - odds[j, k] if narrow else odds[j, k]
            values[k + 1] = value
            best = max(best, value)
        mass, first, second = _ZERO, _ZERO, _ZERO
        for k in range(count):
            d = np.float32(np.int32(k)) - middle
            p = exp_negative(min(factor * (best - values[k]), _NEGLIGIBLE))
            mass += p
            first += p * d
            second += p * d * d
        mean = first / mass
        variance = max(second / mass - mean * mean, _ZERO) + 1.0 / 12.0
        # The limits of the line are a prior of their own, whose mean is zero: it is taken out again
        precision = 1.0 / variance - 1.0 / uniform
        if precision <= 0.02 / uniform:
            lines[j, MEAN], lines[j, PRECISION], lines[j, LOG_RATIO] = 0.0, 0.0, 0.0
            continue
        mean = mean / (variance * precision)
        none = _ZERO if narrow else max(values[0], values[2 * half])
        lines[j, MEAN] = scale * min(max(mean, -float(half)), float(half))
        lines[j, PRECISION] = precision / (scale * scale)
        lines[j, LOG_RATIO] = sharpness * (best - none)
