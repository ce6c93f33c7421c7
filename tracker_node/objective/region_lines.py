"""Correspondence lines: where, along the normal of a contour sample, the colors change from the body's to those beyond it.

A line has pixels on both sides of its sample. For a contour that is ``d`` pixels farther out, the log-likelihood of their colors
is, up to a constant, the sum of log(p_body / p_beyond) over the pixels inside; where the part is so narrow that the line reaches
across it, over those between its two contours. All of them together are a distribution of d, of which mean and variance are kept
(as in region-based trackers, e.g. Stoiber et al., 2020). On the finest scale the mean is refined below the pixel by the share
that the color inside has in the mixed pixels. With the state the sample moves by n . (pixel - pixel at first), the residual is
that minus the mean.

What lies beyond is the scene, or, for contours within the outline, the part behind or the scene.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from ..camera.camera_model import project_point
from ..observation.appearance_kernels import log_positive
from ..render.contour import INNER, N_COLUMNS, NORMAL, P
from ..render.contour_samples import (
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
from ..render.contour_visibility import ray_interval
from .region_steps import N_SUM_COLUMNS, step_distribution

# Columns of a line: point in the link's frame, pixel and normal of the sample when the line was drawn, how far out the contour is
# (mean, px) and how sure that is (1/variance, px^-2), log-likelihood of a contour near there against none on the line
POINT, LINE_U, LINE_V, LINE_NU, LINE_NV, MEAN, PRECISION, LOG_RATIO = 0, 3, 4, 5, 6, 7, 8, 9
N_LINE_COLUMNS = 10
# Indices of the options
SCALE, HALF_LENGTH, CLAMP, SHARPNESS, MODEL_VARIANCE, ROBUST, CORRELATION, FINE, SHADOW = range(9)
N_OPTIONS = 9
# Indices of the statistics of one camera
COST, SQUARES, WEIGHT, COUNT, N_SAMPLES = range(5)
N_STATISTICS = 5

_LONGEST = 96  # pixels of a line
_NEGLIGIBLE = -20.0  # log-likelihood
_ONE, _HALF, _PI = np.float32(1.0), np.float32(0.5), np.float32(math.pi)
_SEEN = np.uint8(1)
_BIN_VOLUME = np.float32(16.0**3)
_OUTLIER = np.float32(0.05)  # share of colors that the empty scene does not explain, where it is known
_FAR = np.float32(12.0)  # half a squared distance beyond which a density is nothing
_SHADOW_DENSITY = np.float32(0.2 / 75.0)  # as in `observation.appearance`: one pixel in five, of a brightness in 75 grey levels


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _room_density(b, g, r, mean_b, mean_g, mean_r, variance, darkest):
    """Density per bin of a color where the empty scene shows, lit or in shadow."""
    db, dg, dr = b - mean_b, g - mean_g, r - mean_r
    half_precision = _HALF / variance
    square = half_precision * (db * db + dg * dg + dr * dr)
    share = half_precision / _PI
    if square < _FAR:
        return _BIN_VOLUME * share * math.sqrt(share) * math.exp(-square)
    gain = (b * mean_b + g * mean_g + r * mean_r) / (mean_b * mean_b + mean_g * mean_g + mean_r * mean_r + _ONE)
    if not darkest < gain < _ONE:
        return np.float32(0.0)
    db, dg, dr = b - gain * mean_b, g - gain * mean_g, r - gain * mean_r
    square = half_precision * (db * db + dg * dg + dr * dr)
    if square > _FAR:
        return np.float32(0.0)
    return _BIN_VOLUME * _SHADOW_DENSITY * share * math.exp(-square)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def other_density(b, g, r, of_scene, room, i, j, darkest):
    """Density per bin of the color of pixel (i, j) where the scene shows: ``of_scene``, or by the room where that is known."""
    mean, variance, known = room
    if known.size > 0 and known[i, j] == _SEEN:
        return _OUTLIER * of_scene + _room_density(
            np.float32(b), np.float32(g), np.float32(r), mean[i, j, 0], mean[i, j, 1], mean[i, j, 2], variance[i, j], darkest
        )
    return of_scene


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _read_line(bgr, body, beyond, scene, room, darkest, has_beyond, u, v, nu, nv, start, step, count, clamp, odds):
    """Fill ``odds[0]`` with the clamped log(p_body / p_beyond) of ``count`` pixels from ``start`` on; zero beyond the image."""
    height, width = bgr.shape[0], bgr.shape[1]
    mean, variance, known = room
    has_room = known.size > 0
    ours, others = odds[0], odds[1]
    for k in range(count):
        t = start + k * step
        i, j = np.int64(math.floor(v + t * nv + 0.5)), np.int64(math.floor(u + t * nu + 0.5))
        if i < 0 or i >= height or j < 0 or j >= width:
            ours[k], others[k] = _ONE, _ONE
            continue
        b, g, r = bgr[i, j, 0], bgr[i, j, 1], bgr[i, j, 2]
        color = (np.int64(b >> 4) << 8) | np.int64(g & 0xF0) | np.int64(r >> 4)
        other = scene[color]
        if has_room and known[i, j] == _SEEN:
            other = _OUTLIER * other + _room_density(
                np.float32(b), np.float32(g), np.float32(r), mean[i, j, 0], mean[i, j, 1], mean[i, j, 2], variance[i, j],
                darkest,
            )  # fmt: skip
        if has_beyond:
            other = _HALF * (other + beyond[color])
        ours[k], others[k] = body[color], other
    for k in range(np.uint64(count)):  # by itself, for the sake of vectors
        value = log_positive(ours[k] / others[k])
        ours[k] = min(max(value, -clamp), clamp)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _distribution(odds, n, half, width, sharpness, total, line):
    """Mean and precision (in steps of the line) of the contour's offset, and the log-ratio, into ``line``.

    ``odds`` (n,): pixel k lies (k + 0.5 - n/2) steps out; offsets are -half ... half. ``total`` (n + 1,) becomes the running sum.
    """
    total[0] = 0.0
    for k in range(n):
        total[k + 1] = total[k] + odds[k]
    middle = n // 2
    narrow = width < middle - half  # the line reaches across the part wherever its contour may be
    best = -1e30
    for d in range(-half, half + 1):
        value = total[middle + d] - (total[middle + d - width] if narrow else 0.0)
        best = max(best, value)
    mass, first, second = 0.0, 0.0, 0.0
    for d in range(-half, half + 1):
        value = total[middle + d] - (total[middle + d - width] if narrow else 0.0)
        exponent = sharpness * (value - best)
        if exponent < _NEGLIGIBLE:
            continue
        p = math.exp(exponent)
        mass += p
        first += p * d
        second += p * d * d
    mean = first / mass
    variance = max(second / mass - mean * mean, 0.0) + 1.0 / 12.0
    uniform = half * (half + 1.0) / 3.0 + 1.0 / 12.0
    # The limits of the line are a prior of their own, whose mean is zero: it is taken out again
    precision = 1.0 / variance - 1.0 / uniform
    if precision <= 0.02 / uniform:
        line[MEAN], line[PRECISION], line[LOG_RATIO] = 0.0, 0.0, 0.0
        return
    mean = mean / (variance * precision)
    line[MEAN] = min(max(mean, -float(half)), float(half))
    line[PRECISION] = precision
    none = 0.0 if narrow else max(total[middle - half], total[middle + half])
    line[LOG_RATIO] = sharpness * (best - none)


_FLANK = 3  # colors on either side that stand for body and beyond
_GAP = 1.5  # pixels that the optics may mix, on either side
_WINDOW = 4  # places across the contour whose mixture is summed


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _color_at(bgr, u, v, out):
    """Bilinear color at a pixel into ``out`` (3,); False beyond the image."""
    x, y = math.floor(u), math.floor(v)
    i, j = int(y), int(x)
    if i < 0 or j < 0 or i + 1 >= bgr.shape[0] or j + 1 >= bgr.shape[1]:
        return False
    a, b = u - x, v - y
    w00, w01, w10, w11 = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
    for c in range(3):
        out[c] = w00 * bgr[i, j, c] + w01 * bgr[i, j + 1, c] + w10 * bgr[i + 1, j, c] + w11 * bgr[i + 1, j + 1, c]
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _refine(bgr, width, line, work):
    """Find the contour to a fraction of a pixel: by the share that the color inside has in the mixed pixels around it.

    The colors are those of this very line, left and right of the mixed pixels; how much they vary says how sure the result is.
    """
    u, v = line[LINE_U] + line[MEAN] * line[LINE_NU], line[LINE_V] + line[MEAN] * line[LINE_NV]
    nu, nv = line[LINE_NU], line[LINE_NV]
    n_inside = min(_FLANK, max(1, int(width - _GAP - 1.0)))
    color, inside, beyond = work[0], work[1], work[2]
    inside[:] = 0.0
    beyond[:] = 0.0
    spread = 0.0
    for side in range(2):
        mean, count = (inside, n_inside) if side == 0 else (beyond, _FLANK)
        sign = -1.0 if side == 0 else 1.0
        squares = 0.0
        for k in range(count):
            t = sign * (_GAP + 0.5 + k)
            if not _color_at(bgr, u + t * nu, v + t * nv, color):
                return
            for c in range(3):
                mean[c] += color[c]
                squares += color[c] * color[c]
        for c in range(3):
            mean[c] /= count
            squares -= count * mean[c] * mean[c]
        spread += squares / max(count - 1, 1)
    contrast = 0.0
    for c in range(3):
        contrast += (inside[c] - beyond[c]) ** 2
    if contrast < 300.0:
        return
    share = 0.0
    for k in range(_WINDOW):
        t = k + 0.5 - 0.5 * _WINDOW
        if not _color_at(bgr, u + t * nu, v + t * nv, color):
            return
        value = 0.0
        for c in range(3):
            value += (color[c] - beyond[c]) * (inside[c] - beyond[c])
        share += min(max(value / contrast, -0.2), 1.2)
    shift = share - 0.5 * _WINDOW
    if abs(shift) > 1.5:
        return
    variance = 0.01 + (spread / 3.0 + 48.0) * _WINDOW / contrast
    if variance < 1.0 / line[PRECISION]:
        line[MEAN] += shift
        line[PRECISION] = 1.0 / variance


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _continues(shapes, Ts, spheres, shape, camera, row, pixel, inward_px):
    """Does another part of the body show ``inward_px`` inside a contour?"""
    _, R, _, center = camera
    nx = R[0, 0] * row[NORMAL] + R[0, 1] * row[NORMAL + 1] + R[0, 2] * row[NORMAL + 2]
    ny = R[1, 0] * row[NORMAL] + R[1, 1] * row[NORMAL + 1] + R[1, 2] * row[NORMAL + 2]
    nz = R[2, 0] * row[NORMAL] + R[2, 1] * row[NORMAL + 1] + R[2, 2] * row[NORMAL + 2]
    along_u = pixel[JACOBIAN] * nx + pixel[JACOBIAN + 1] * ny + pixel[JACOBIAN + 2] * nz
    along_v = pixel[JACOBIAN + 3] * nx + pixel[JACOBIAN + 4] * ny + pixel[JACOBIAN + 5] * nz
    step = -inward_px / math.sqrt(along_u * along_u + along_v * along_v)
    dx = row[P] + step * row[NORMAL] - center[0]
    dy = row[P + 1] + step * row[NORMAL + 1] - center[1]
    dz = row[P + 2] + step * row[NORMAL + 2] - center[2]
    length_sq = dx * dx + dy * dy + dz * dz
    for other in range(spheres.shape[0]):
        wx, wy, wz = spheres[other, 0] - center[0], spheres[other, 1] - center[1], spheres[other, 2] - center[2]
        dot = wx * dx + wy * dy + wz * dz
        if other == shape or wx * wx + wy * wy + wz * wz - dot * dot / length_sq > spheres[other, 3] ** 2:
            continue
        hit, _, t_out = ray_interval(shapes, other, Ts[other], center, dx, dy, dz)
        if hit and t_out > 0.0:
            return True
    return False


@nb.njit(cache=True, nogil=True, error_model="numpy")
def draw_lines(
    bgr, colors, room, classes, shapes, Ts_shape, spheres, Ts_link, camera, rows, pixels, info, n, options, lines
):  # fmt: skip
    """Draw one line per contour sample and fit its distribution: fill ``lines`` (n, `N_LINE_COLUMNS`).

    ``colors``: (body (n_classes, n_colors), scene (n_colors,)) densities; ``classes`` (n_shapes,). ``rows``, ``pixels`` and
    ``info`` are of `contour_samples.collect_samples`, ``spheres`` of `contour.world_spheres`. ``options[SCALE]``: pixels from one
    place on the line to the next. ``room``: (mean, variance, known) of the empty scene, see `observation.appearance.SceneModel`;
    of size zero where nothing is known of it.
    """
    body, scene = colors
    scale, half, clamp = options[SCALE], int(options[HALF_LENGTH]), np.float32(options[CLAMP])
    odds, total = np.empty((2, _LONGEST), dtype=np.float32), np.empty(_LONGEST + 1, dtype=np.float32)
    sums = np.empty((_LONGEST + 1, N_SUM_COLUMNS))
    work, chords = np.empty((3, 3)), np.empty((n, 2))
    chords_px(shapes, Ts_shape, camera, rows, pixels, info, n, (2 * half + 2) * scale, chords)
    for j in range(n):
        line, u, v, nu, nv = lines[j], pixels[j, U], pixels[j, V], pixels[j, NU], pixels[j, NV]
        shape, link = info[j, SHAPE], info[j, LINK]
        x, y, z = rows[j, P] - Ts_link[link, 0, 3], rows[j, P + 1] - Ts_link[link, 1, 3], rows[j, P + 2] - Ts_link[link, 2, 3]
        for i in range(3):
            line[POINT + i] = Ts_link[link, 0, i] * x + Ts_link[link, 1, i] * y + Ts_link[link, 2, i] * z
        line[LINE_U], line[LINE_V], line[LINE_NU], line[LINE_NV] = u, v, nu, nv
        own, beyond = classes[shape], info[j, BEYOND]
        width = max(1, int(chords[j, 0] / scale + 0.5))
        if beyond == shape:  # another side of the same part
            margin = int(2.0 / scale + 0.5)
            free = int(chords[j, 1] / scale)
            line[MEAN], line[PRECISION], line[LOG_RATIO] = step_distribution(
                bgr, u, v, nu, nv, scale,
                min(width - margin, 2 * half), min(free - margin, 2 * half), sums,
            )  # fmt: skip
            line[MEAN] *= scale
            line[PRECISION] /= scale * scale
            if options[FINE] > 0.0 and line[PRECISION] > 0.3:
                _refine(bgr, width * scale, line, work)
            continue
        if width <= half and _continues(shapes, Ts_shape, spheres, shape, camera, rows[j], pixels[j], width * scale + 3.0):
            width = half + 1  # what lies behind the part's other side is body as well
        inside = half + min(width, half) + 1  # steps on either side
        count = 2 * inside
        has_beyond = info[j, CLASS] == INNER and beyond >= 0
        other = classes[beyond] if has_beyond else 0
        _read_line(
            bgr, body[own], body[other], scene, room, options[SHADOW], has_beyond, u, v, nu, nv,
            (0.5 - inside) * scale, scale, count, clamp, odds,
        )  # fmt: skip
        _distribution(odds[0], count, half, width, options[SHARPNESS], total, line)
        line[MEAN] *= scale
        line[PRECISION] /= scale * scale
        if options[FINE] > 0.0 and line[PRECISION] > 0.3:
            _refine(bgr, width * scale, line, work)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def linearize_lines(lines, info, n, Ts_link, camera, options, normal, gradient, stats):
    """Add one camera's lines, the body being where ``Ts_link`` says, to the normal matrices of its links.

    Residuals are divided by their variance (that of the distribution and the model's own), robustly (Geman-McClure at
    ``options[ROBUST]`` standard deviations), and count as one in ``options[CORRELATION]``. ``normal`` (n_links, 6, 6), upper
    triangles, and ``gradient`` (n_links, 6) are added to; ``stats`` (`N_STATISTICS`,) is overwritten.
    """
    params, R, t, _ = camera
    robust_sq, model_variance, share = options[ROBUST] ** 2, options[MODEL_VARIANCE], 1.0 / options[CORRELATION]
    stats[:] = 0.0
    stats[N_SAMPLES] = n
    g = np.empty(6)
    for j in range(n):
        line = lines[j]
        if line[PRECISION] <= 0.0:
            continue
        link = info[j, LINK]
        T = Ts_link[link]
        px = T[0, 0] * line[POINT] + T[0, 1] * line[POINT + 1] + T[0, 2] * line[POINT + 2] + T[0, 3]
        py = T[1, 0] * line[POINT] + T[1, 1] * line[POINT + 1] + T[1, 2] * line[POINT + 2] + T[1, 3]
        pz = T[2, 0] * line[POINT] + T[2, 1] * line[POINT + 1] + T[2, 2] * line[POINT + 2] + T[2, 3]
        x = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0]
        y = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1]
        z = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2]
        ok, u, v, ux, uy, uz, vx, vy, vz = project_point(params, x, y, z)
        if not ok:
            continue
        nu, nv = line[LINE_NU], line[LINE_NV]
        r = nu * (u - line[LINE_U]) + nv * (v - line[LINE_V]) - line[MEAN]
        hx, hy, hz = nu * ux + nv * vx, nu * uy + nv * vy, nu * uz + nv * vz
        h0 = R[0, 0] * hx + R[1, 0] * hy + R[2, 0] * hz
        h1 = R[0, 1] * hx + R[1, 1] * hy + R[2, 1] * hz
        h2 = R[0, 2] * hx + R[1, 2] * hy + R[2, 2] * hz
        g[0], g[1], g[2] = h0, h1, h2
        g[3], g[4], g[5] = py * h2 - pz * h1, pz * h0 - px * h2, px * h1 - py * h0
        precision = 1.0 / (1.0 / line[PRECISION] + model_variance)
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


@nb.njit(cache=True, nogil=True, error_model="numpy")
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
