"""Contours to a fraction of a pixel: by the fraction of the color inside in the mixed pixels around them.

Lines across inner edges: where, between two faces of one part, the brightness changes.

Both faces have the part's color, so no color distribution separates them; but light falls on them differently. A line
across their edge is explained by two mean colors with a step between them: the squared error of that, for every place of the
step, over the variance of what is left is the log-likelihood of the place.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import compiled
from .colors import color_at
from .table import LINE_NU, LINE_NV, LINE_U, LINE_V, MEAN, PRECISION, SHARP, WIDTH

_FLANK = 3  # colors on either side that stand for body and beyond
_DEEP = 5  # inside, where the part is wide enough
_GAP = 1.5  # pixels that the optics may mix, on either side
_WINDOW = 4  # places across the contour whose mixture is summed
_LEAST_CONTRAST = 300.0  # squared gray levels
_FARTHEST = 1.5  # pixels


@compiled
def refine_lines(bgr, plan, n, scale, lines):
    """Move the means of precise lines to where the mixture of colors is even, with their precision.

    The colors are those of this very line, left and right of the mixed pixels; their variance gives that of the result.
    The color inside is followed to the edge: light from above makes round parts brighter towards their upper contours, which
    would else be found up to 0.2 pixels too far out.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    plan, n : (., `N_PLAN_COLUMNS`), the first ``n`` rows.
    scale : pixels from one place of a line to the next.
    lines : (., `N_LINE_COLUMNS`); mean and precision are changed where they become better.
    """
    for j in range(n):
        if not lines[j, PRECISION] > SHARP:
            continue
        nu, nv = lines[j, LINE_NU], lines[j, LINE_NV]
        u, v = lines[j, LINE_U] + lines[j, MEAN] * nu, lines[j, LINE_V] + lines[j, MEAN] * nv
        room = int(plan[j, WIDTH] * scale - _GAP - 1.0)
        on_image, spread = True, 0.0
        inside_b, inside_g, inside_r, beyond_b, beyond_g, beyond_r = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for side in range(2):
            count, sign = (min(_DEEP, max(1, room)), -1.0) if side == 0 else (_FLANK, 1.0)
            sum_b, sum_g, sum_r, squares = 0.0, 0.0, 0.0, 0.0
            slope_b, slope_g, slope_r = 0.0, 0.0, 0.0
            middle = 0.5 * (count - 1)
            for k in range(count):
                t = sign * (_GAP + 0.5 + k)
                seen, b, g, r = color_at(bgr, u + t * nu, v + t * nv)
                on_image = on_image and seen
                sum_b, sum_g, sum_r = sum_b + b, sum_g + g, sum_r + r
                squares += b * b + g * g + r * r
                slope_b, slope_g, slope_r = slope_b + (k - middle) * b, slope_g + (k - middle) * g, slope_r + (k - middle) * r
            mean_b, mean_g, mean_r = sum_b / count, sum_g / count, sum_r / count
            squares -= count * (mean_b * mean_b + mean_g * mean_g + mean_r * mean_r)
            if side == 0 and count == _DEEP:
                # Round parts brighten or darken towards their edge: the color there, by a straight line through those within, as
                # far as their noise lets it be seen
                per = 12.0 / (count * (count * count - 1.0))
                steep = per * (slope_b * slope_b + slope_g * slope_g + slope_r * slope_r)
                squares -= steep
                noise = squares / (count - 2.0)
                away = -(middle + _GAP + 0.5) * per * max(steep - noise, 0.0) / max(steep, 1e-9)
                mean_b, mean_g, mean_r = mean_b + away * slope_b, mean_g + away * slope_g, mean_r + away * slope_r
            spread += max(squares, 0.0) / max(count - 1, 1)
            if side == 0:
                inside_b, inside_g, inside_r = mean_b, mean_g, mean_r
            else:
                beyond_b, beyond_g, beyond_r = mean_b, mean_g, mean_r
        away_b, away_g, away_r = inside_b - beyond_b, inside_g - beyond_g, inside_r - beyond_r
        contrast = away_b * away_b + away_g * away_g + away_r * away_r
        if contrast < _LEAST_CONTRAST:
            continue
        share = 0.0
        for k in range(_WINDOW):
            t = k + 0.5 - 0.5 * _WINDOW
            seen, b, g, r = color_at(bgr, u + t * nu, v + t * nv)
            on_image = on_image and seen
            value = (b - beyond_b) * away_b + (g - beyond_g) * away_g + (r - beyond_r) * away_r
            share += min(max(value / contrast, -0.2), 1.2)
        shift = share - 0.5 * _WINDOW
        if not on_image or abs(shift) > _FARTHEST:
            continue
        variance = 0.01 + (spread / 3.0 + 48.0) * _WINDOW / contrast
        if variance < 1.0 / lines[j, PRECISION]:
            lines[j, MEAN] += shift
            lines[j, PRECISION] = 1.0 / variance


LEAST_PIXELS = 3  # on either side of a step
_LEAST_VARIANCE = 9.0  # gray levels squared, per channel
_LEAST_GAIN = 10.0  # log-likelihood by which a step must beat none
_MIXED = 0.25  # variance, in places: the pixel that shows both sides may count for either
_NEGLIGIBLE = -20.0  # log-likelihood
ERROR = 4  # column of the squared error of a step there, behind the running sums of three colors and of their squares
N_SUM_COLUMNS = 5


@compiled
def step_distribution(bgr, u, v, nu, nv, scale, inside, outside, sums):
    """Offset of a step in brightness along a line.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    u, v, nu, nv : pixel and direction of the line.
    scale : pixels from one place of the line to the next.
    inside, outside : places before (u, v), and beyond it; the step leaves `LEAST_PIXELS` on either side.
    sums : (>= inside + outside + 1, `N_SUM_COLUMNS`), overwritten.

    Returns
    -------
    Mean and precision, in places, and log-ratio; a precision of zero: no step.
    """
    height, width, n = bgr.shape[0], bgr.shape[1], inside + outside
    low, high = LEAST_PIXELS - inside, outside - LEAST_PIXELS
    if high - low < 2 or low > 0 or high < 0:  # a face so narrow that the step would be searched beside it
        return 0.0, 0.0, 0.0
    for c in range(ERROR):
        sums[0, c] = 0.0
    for k in range(n):
        t = (k + 0.5 - inside) * scale
        i, j = int(math.floor(v + t * nv + 0.5)), int(math.floor(u + t * nu + 0.5))  # noqa: RUF046
        if not (0 <= i < height and 0 <= j < width):
            return 0.0, 0.0, 0.0
        b, g, r = np.float64(bgr[i, j, 0]), np.float64(bgr[i, j, 1]), np.float64(bgr[i, j, 2])
        sums[k + 1, 0], sums[k + 1, 1], sums[k + 1, 2] = sums[k, 0] + b, sums[k, 1] + g, sums[k, 2] + r
        sums[k + 1, 3] = sums[k, 3] + b * b + g * g + r * r
    b, g, r = sums[n, 0], sums[n, 1], sums[n, 2]
    best, of_one = 1e30, sums[n, 3] - (b * b + g * g + r * r) / n
    for place in range(inside + low, inside + high + 1):
        before_b, before_g, before_r = sums[place, 0], sums[place, 1], sums[place, 2]
        b, g, r = sums[n, 0] - before_b, sums[n, 1] - before_g, sums[n, 2] - before_r
        error = sums[n, 3] - (before_b * before_b + before_g * before_g + before_r * before_r) / place
        error -= (b * b + g * g + r * r) / (n - place)  # of two mean colors
        sums[place, ERROR] = error
        best = min(best, error)
    variance = max(_LEAST_VARIANCE, best / (3.0 * n - 6.0))
    gain = 0.5 * (of_one - best) / variance
    if gain < _LEAST_GAIN:
        return 0.0, 0.0, 0.0
    mass, first, second = 0.0, 0.0, 0.0
    for d in range(low, high + 1):
        exponent = 0.5 * (best - sums[inside + d, ERROR]) / variance
        if exponent < _NEGLIGIBLE:
            continue
        p = math.exp(exponent)
        mass += p
        first += p * d
        second += p * d * d
    mean, middle = first / mass, 0.5 * (low + high)
    spread, uniform = max(second / mass - mean * mean, 0.0) + _MIXED, ((high - low + 1.0) ** 2) / 12.0
    precision = 1.0 / spread - 1.0 / uniform  # that the line ends somewhere is no evidence
    if precision <= 0.02 / uniform:
        return 0.0, 0.0, 0.0
    mean = (mean / spread - middle / uniform) / precision
    return min(max(mean, float(low)), float(high)), precision, gain
