"""Correspondence lines of one camera in one call: cameras run on threads, and nothing is kept between calls.

How well the lines of one camera bear a state out, as kernels.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import project_point
from ...compiled.kernels import compiled
from ...render.contour.generators import OUTER, world_spheres
from ...render.contour.samples import CLASS, LINK, SHAPE, collect_samples, keep_inside
from ...render.occluders import drop_covered
from .correspondence import draw_lines, fill_lower, linearize_lines
from .surfaces import shift_means
from .table import LINE_NU, LINE_NV, LINE_U, LINE_V, LOG_RATIO, MEAN, POINT, PRECISION, SHARP


@compiled
def correspond_camera(
    view, cover, classes, shapes, bounds, Ts_shape, Ts_link, camera, n_samples, outward_px, options, surfaces, slot, sums
):  # fmt: skip
    """Draw the lines of the contours that one camera sees of a body, and sum them.

    Parameters
    ----------
    view : (bgr, densities, room, silhouette, neighbors) of `draw_lines`.
    cover : (h, w) depth of what stands before the body, of size zero where nothing does.
    classes : (n_shapes,) color classes.
    shapes, bounds : `ShapeArrays.packed`, `ShapeArrays.bounds`.
    Ts_shape, Ts_link : (n_shapes, 4, 4), (n_links, 4, 4), to the world.
    camera, n_samples, outward_px : of `collect_samples`.
    options : (`N_OPTIONS`,) of `correspondence`.
    surfaces : (n_shapes, 4) meters, see `surfaces.Surfaces`; of size zero: those of the shapes.
    slot : (rows, pixels, info, lines), which are filled.
    sums : (normal, gradient, stats) of `sum_camera`.

    Returns
    -------
    Number of lines.
    """
    bgr, densities, room, silhouette, neighbors = view
    rows, pixels, info, lines = slot
    spheres = np.empty((Ts_shape.shape[0], 4))
    world_spheres(Ts_shape, bounds, spheres)
    n = collect_samples(shapes, Ts_shape, spheres, camera, n_samples, outward_px, rows, pixels, info)
    n = keep_inside(rows, pixels, info, n, bgr.shape[1], bgr.shape[0])
    if cover.size:
        n = drop_covered(cover, rows, pixels, info, n, 0.5 * outward_px)
    draw_lines(
        bgr, densities, room, silhouette, neighbors, classes, shapes, Ts_shape, spheres, Ts_link, camera, rows, pixels, info, n,
        options, lines,
    )  # fmt: skip
    if surfaces.size:
        shift_means(lines, info, n, Ts_link, camera, surfaces)
    sum_camera(lines, info, n, Ts_link, camera, options, sums)
    return n


@compiled
def sum_camera(lines, info, n, Ts_link, camera, options, sums):
    """Residuals of lines at a pose of the body, summed by link.

    Parameters
    ----------
    lines, info, n : of `correspond_camera`, the first ``n`` rows.
    Ts_link : (n_links, 4, 4), where the body is.
    camera, options : see `correspond_camera`.
    sums : normal (n_links, 6, 6), gradient (n_links, 6) and statistics (`N_STATISTICS`,), overwritten.
    """
    normal, gradient, stats = sums
    normal[:] = 0.0
    gradient[:] = 0.0
    linearize_lines(lines, info, n, Ts_link, camera, options, normal, gradient, stats)
    fill_lower(normal)


# Rows of the evidence of one camera
EXPECTED, FOUND, CLOSE, CHI2, SUM_LOG_RATIO, FILLED, EMPTY = range(7)
N_EVIDENCE = 7
_FAR = 0.6  # fraction of a line's reach, farther out than which its contour is where all of it has the body's colors, or none...
_COMMON = 1.0  # px^-2: ...which are common beyond, too, where it is no more precise than that
_UNSEEN_PX = 1e6  # residual of what the camera cannot see


@compiled
def line_residuals(lines, info, n, Ts_link, camera, residuals):
    """Residuals of lines at a pose of the body.

    Parameters
    ----------
    lines, info, n : (., `N_LINE_COLUMNS`) and (., `N_INFO_COLUMNS`), the first ``n`` rows.
    Ts_link : (n_links, 4, 4), where the body is.
    camera : (params, R_cam_world, t_cam_world, center).
    residuals : (>= n,) pixels, overwritten; very large where the camera cannot see the point.
    """
    params, R, t, _ = camera
    for j in range(n):
        link, a, b, c = info[j, LINK], lines[j, POINT], lines[j, POINT + 1], lines[j, POINT + 2]
        px = Ts_link[link, 0, 0] * a + Ts_link[link, 0, 1] * b + Ts_link[link, 0, 2] * c + Ts_link[link, 0, 3]
        py = Ts_link[link, 1, 0] * a + Ts_link[link, 1, 1] * b + Ts_link[link, 1, 2] * c + Ts_link[link, 1, 3]
        pz = Ts_link[link, 2, 0] * a + Ts_link[link, 2, 1] * b + Ts_link[link, 2, 2] * c + Ts_link[link, 2, 3]
        ok, u, v, _, _, _, _, _, _ = project_point(
            params, R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0], R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1],
            R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2],
        )  # fmt: skip
        residuals[j] = _UNSEEN_PX
        if ok:
            du, dv = u - lines[j, LINE_U], v - lines[j, LINE_V]
            residuals[j] = lines[j, LINE_NU] * du + lines[j, LINE_NV] * dv - lines[j, MEAN]


@compiled
def keep_sharp(lines, residuals, distances, variances, kept):
    """Add absolute residuals and variances of lines that have a sharp contour to those of other cameras.

    Parameters
    ----------
    lines, residuals : of `line_residuals`.
    distances, variances : pixels, and pixels^2, added to.
    kept : how many of them are in use.

    Returns
    -------
    int : how many are.
    """
    for j in range(lines.shape[0]):
        if lines[j, PRECISION] > SHARP:
            distances[kept], variances[kept] = abs(residuals[j]), 1.0 / lines[j, PRECISION]
            kept += 1
    return kept


@compiled
def count_evidence(lines, info, n, residuals, model_variance, close_px, reach_px, evidence):
    """Add the lines of the body's outline to the evidence of its parts.

    Parameters
    ----------
    lines, info, n, residuals : see `line_residuals`.
    model_variance : pixels^2, by which contours are off beyond their noise.
    close_px : residual below which a line counts as `CLOSE`.
    reach_px : how far out lines look.
    evidence : (`N_EVIDENCE`, n_shapes), added to.
    """
    for j in range(n):
        if info[j, CLASS] != OUTER:
            continue
        shape, precision = info[j, SHAPE], lines[j, PRECISION]
        evidence[EXPECTED, shape] += 1.0
        evidence[SUM_LOG_RATIO, shape] += lines[j, LOG_RATIO]
        if precision > 0.0:
            evidence[FOUND, shape] += 1.0
            evidence[CHI2, shape] += residuals[j] ** 2 / (1.0 / precision + model_variance)
            if abs(residuals[j]) < close_px:
                evidence[CLOSE, shape] += 1.0
            elif residuals[j] > _FAR * reach_px and lines[j, MEAN] < -_FAR * reach_px:
                evidence[EMPTY, shape] += 1.0
            elif precision < _COMMON and residuals[j] < -_FAR * reach_px and lines[j, MEAN] > _FAR * reach_px:
                evidence[FILLED, shape] += 1.0


# Neighbors on a contour see the same pixels: their errors are correlated
_FARTHEST_PX = 25.0  # between neighbors on one contour
_MOST = 20.0
_OWN = 0.25  # fraction of a line's own variance that does not average out


@compiled
def add_correlated(lines, info, n, taken, found, length_px, sums):
    """Add what one camera's lines contribute to the scatter of a fit, and to its information.

    A line's weight goes by its own variance plus ``taken``. What adds up in a fit is ``found`` and a quarter of the line's own.
    To the scatter a line adds its weight squared times that, times how many lines have one error in common.

    The errors of lines that are s pixels apart on one contour are taken to have the correlation r = exp(-s / ``length_px``), for
    which (1 + r) / (1 - r) lines in a row weigh as much as a single one that is far from all others.

    Parameters
    ----------
    lines, info, n : (., `N_LINE_COLUMNS`) and (., `N_INFO_COLUMNS`), the first ``n`` rows.
    taken, found : pixels^2, variance of lines beyond their own: that of the weights, and that which is observed.
    length_px : of the correlation along a contour.
    sums : (n_links, 2), added to.
    """
    gaps = np.full(n + 1, -1.0)  # to the line before; negative: none
    last = -1
    for j in range(n):
        if lines[j, PRECISION] <= 0.0:
            continue
        if last >= 0 and info[j, SHAPE] == info[last, SHAPE]:
            gap = math.hypot(lines[j, LINE_U] - lines[last, LINE_U], lines[j, LINE_V] - lines[last, LINE_V])
            if gap < _FARTHEST_PX:
                gaps[j] = gap
        last = j
    after = -1.0
    for j in range(n - 1, -1, -1):
        if lines[j, PRECISION] <= 0.0:
            continue
        before = gaps[j]
        share = 1.0
        if before >= 0.0 or after >= 0.0:
            gap = 0.5 * (before + after) if before >= 0.0 and after >= 0.0 else max(before, after)
            r = math.exp(-gap / length_px)
            share = min((1.0 + r) / max(1.0 - r, 1e-9), _MOST)
        after = before
        weight = 1.0 / (1.0 / lines[j, PRECISION] + taken)
        sums[info[j, LINK], 0] += weight * weight * (found + _OWN / lines[j, PRECISION]) * share
        sums[info[j, LINK], 1] += weight
