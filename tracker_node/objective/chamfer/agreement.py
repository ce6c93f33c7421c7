"""Agreement of outline and silhouette in one camera, counted sample by sample.

A robust residual says how far those samples are off that have found something; it stays small when half of the body is
somewhere else. What tells is how much of the body's outline lies on the silhouette's boundary, and how much of that boundary
lies on the outline.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from ...render.contour.generators import N_COLUMNS, OUTER, SAMPLES, draw_contour
from ...render.contour.samples import N_PIXEL_COLUMNS, NU, NV, U, V, project_samples
from ..contour_residual import bilinear, columns_of, nearest_sample

OUTLINE, ON_BOUNDARY, BOUNDARY, ON_OUTLINE = range(4)
"""Of one camera: samples of the body's outline; those on the silhouette's boundary; points of that boundary; those on the
outline."""
N_AGREEMENT = 4


@nb.njit(cache=True, nogil=True, error_model="numpy")
def count_agreement(shapes, Ts, camera, maps, decided, n_samples, limits, samples, counts):
    """Count how much of outline and silhouette boundary lie on each other in one camera.

    Parameters
    ----------
    shapes, Ts, camera, maps : see `contour_residual.linearize_camera`.
    decided : (flags, picks, n_picks) that it has filled.
    n_samples : on a generator line.
    limits : (close_px, alignment): how near a boundary has to be, and the least cosine between the normals.
    samples : as in its ``work``, overwritten.
    counts : (`N_AGREEMENT`,), overwritten.
    """
    flags, picks, n_picks = decided
    params, R, t, center = camera
    silhouette, _, origin, boundary = maps
    close, alignment = limits
    most = SAMPLES * n_samples
    rows, pixels, outwards = np.empty((most, N_COLUMNS)), np.empty((most, N_PIXEL_COLUMNS)), np.empty(most)
    counts[:] = 0.0
    n_outline = 0
    for shape in range(flags.shape[0]):
        count = draw_contour(shapes, shape, Ts[shape], center, n_samples, np.bool_(False), picks[shape], n_picks, rows)
        project_samples(params, R, t, rows, count, 0.0, pixels, outwards)
        for j in range(count):
            if flags[shape, j] != OUTER or outwards[j] < 0.0:
                continue
            u, v, nu, nv = pixels[j, U], pixels[j, V], pixels[j, NU], pixels[j, NV]
            sample = samples[n_outline]
            sample[0], sample[1], sample[2], sample[3] = u - origin[0], v - origin[1], nu, nv
            n_outline += 1
            ok, value, gu, gv = bilinear(silhouette, sample[0], sample[1])
            if not ok:  # beyond the border of the image, where there is nothing to agree with
                continue
            counts[OUTLINE] += 1.0
            slope = math.sqrt(gu * gu + gv * gv)
            if abs(value) < close and gu * nu + gv * nv > alignment * slope:
                counts[ON_BOUNDARY] += 1.0
    columns = columns_of(samples, n_outline)
    squares = np.empty(columns.shape[1], dtype=np.int32)
    reach_sq = np.float32(close * close)
    for i in range(0, boundary.shape[0], 2):  # fractions need no more
        counts[BOUNDARY] += 1.0
        if nearest_sample(columns[0], columns[1], columns[2], columns[3], boundary[i], alignment, reach_sq, squares) >= 0:
            counts[ON_OUTLINE] += 1.0
