"""Contours to a fraction of a pixel: by the fraction of the color inside in the mixed pixels around them."""

from __future__ import annotations

import numba as nb

from .colors import color_at
from .table import LINE_NU, LINE_NV, LINE_U, LINE_V, MEAN, PRECISION, SHARP, WIDTH

_FLANK = 3  # colors on either side that stand for body and beyond
_DEEP = 5  # inside, where the part is wide enough
_GAP = 1.5  # pixels that the optics may mix, on either side
_WINDOW = 4  # places across the contour whose mixture is summed
_LEAST_CONTRAST = 300.0  # squared gray levels
_FARTHEST = 1.5  # pixels


@nb.njit(cache=True, nogil=True, error_model="numpy")
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
