"""Correspondence lines of one camera in one call: cameras run on threads, and nothing is kept between calls."""

from __future__ import annotations

import numba as nb
import numpy as np

from ...render.contour.generators import world_spheres
from ...render.contour.samples import collect_samples, keep_inside
from ...render.occluders import drop_covered
from .correspondence import draw_lines, fill_lower, linearize_lines
from .surfaces import shift_means


@nb.njit(cache=True, nogil=True, error_model="numpy")
def correspond_camera(
    view, cover, classes, shapes, bounds, Ts_shape, Ts_link, camera, n_samples, outward_px, options, surfaces, slot, sums
):  # fmt: skip
    """Draw the lines of the contours that one camera sees of a body, and sum them.

    Parameters
    ----------
    view : (bgr, densities, room, silhouette) of `draw_lines`.
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
    bgr, densities, room, silhouette = view
    rows, pixels, info, lines = slot
    spheres = np.empty((Ts_shape.shape[0], 4))
    world_spheres(Ts_shape, bounds, spheres)
    n = collect_samples(shapes, Ts_shape, spheres, camera, n_samples, outward_px, rows, pixels, info)
    n = keep_inside(rows, pixels, info, n, bgr.shape[1], bgr.shape[0])
    if cover.size:
        n = drop_covered(cover, rows, pixels, info, n, 0.5 * outward_px)
    draw_lines(
        bgr, densities, room, silhouette, classes, shapes, Ts_shape, spheres, Ts_link, camera, rows, pixels, info, n, options,
        lines,
    )  # fmt: skip
    if surfaces.size:
        shift_means(lines, info, n, Ts_link, camera, surfaces)
    sum_camera(lines, info, n, Ts_link, camera, options, sums)
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy")
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
