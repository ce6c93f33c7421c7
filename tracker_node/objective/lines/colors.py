"""The pixels along a correspondence line: log-ratio of body against what lies beyond it.

First all memory is read, so that the many places of a line are on their way at once; then everything is worked out side by side,
in blocks that the compiler turns into vectors.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import compiled
from ...observation.appearance import BINS
from ...observation.appearance_kernels import log_positive
from ...observation.region.background import LOG_STEP
from ...render.occluders import SAYS_NOTHING
from .table import BEFORE, BEHIND, LINE_NU, LINE_NV, LINE_U, LINE_V, LONGEST, OWN

_BLOCK = 16  # pixels that are worked out at once; divides `LONGEST`

_ZERO, _ONE, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_FAR = np.float32(12.0)  # half a squared distance beyond which a density is nothing
_LOG2_E = np.float32(1.4426950408889634)
_BYTE, _4, _8, _16, _24 = np.uint32(255), np.uint32(4), np.uint32(8), np.uint32(16), np.uint32(24)
_LOG_STEP = np.float32(LOG_STEP)
_OUTLIERS = np.float32(0.05)  # fraction of colors that the background does not explain, where it is known
# Densities per bin by half the precision of a pixel: of its color in light; in shadow, as in `observation.appearance`: one pixel
# in five, of a brightness in 75 gray levels
_LIT = np.float32((256.0 / BINS) ** 3 / math.pi**1.5)
_SHADED = np.float32((256.0 / BINS) ** 3 / math.pi * 0.2 / 75.0)


@compiled(inline="always")
def exp_negative(x):
    """exp(-x) of a float32 in [0, 80], to 1e-5 of its value: exponent, and a polynomial for the rest."""
    t = x * _LOG2_E
    whole = np.int32(t)
    f = t - np.float32(whole)  # 2^-f on [0, 1)
    rest = np.float32(0.2394617) + f * (np.float32(-0.05325672) + f * np.float32(0.00685914))
    rest = _ONE + f * (np.float32(-0.6930609) + f * rest)
    return rest * np.int32((np.int32(127) - whole) << np.int32(23)).view(np.float32)


@compiled(inline="always")
def other_density(color, mean, of_scene, most, darkest):
    """Density per bin of a pixel's color where the body does not show.

    Parameters
    ----------
    color : uint32, blue lowest.
    mean : uint32 of `observation.region.background.PackedRoom`; 0 where the pixel's background is not known.
    of_scene : density of the color in the scene, used where the background is not known and as its outliers.
    most : half the precision of the pixels that vary least.
    darkest : fraction of the background's brightness below which a pixel is no shadow.

    Returns
    -------
    float32.
    """
    b, g, r = np.float32(color & _BYTE), np.float32((color >> _8) & _BYTE), np.float32(color >> _16)
    mb, mg, mr = np.float32(mean & _BYTE), np.float32((mean >> _8) & _BYTE), np.float32((mean >> _16) & _BYTE)
    code = mean >> _24
    known = code > np.uint32(0)
    half_precision = most * exp_negative(_LOG_STEP * np.float32(code - np.uint32(known)))
    db, dg, dr = b - mb, g - mg, r - mr
    lit = half_precision * (db * db + dg * dg + dr * dr)
    gain = (b * mb + g * mg + r * mr) / (mb * mb + mg * mg + mr * mr + _ONE)
    db, dg, dr = b - gain * mb, g - gain * mg, r - gain * mr
    shaded = half_precision * (db * db + dg * dg + dr * dr)
    shaded = shaded if (gain > darkest) & (gain < _ONE) else _FAR
    square = min(lit if lit < _FAR else shaded, _FAR)
    factor = half_precision * (_LIT * math.sqrt(half_precision) if lit < _FAR else _SHADED)
    density = factor * exp_negative(square) if (square < _FAR) & known else _ZERO
    return (_OUTLIERS if known else _ONE) * of_scene + density


@compiled
def read_lines(bgr, body, scene, room, silhouette, neighbors, darkest, clamp, scale, half, lines, plan, n, odds):
    """Fill the clamped log(p_body / p_beyond) of each line's pixels; zero beyond the image.

    After the pixels before them, a line has 2 ``half`` about its sample, ``scale`` pixels apart.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    body, scene : (n_classes, n_colors) and (n_colors,) densities per color bin.
    room : packed background, of size zero where nothing is known of it.
    silhouette : `observation.region.silhouette.PackedSilhouette`, of size zero where there is none.
    neighbors : `render.occluders.PackedNeighbors`: another body in the place of the scene; one that stands before this one leaves
        nothing to be told.
    darkest : fraction of the background's brightness below which a pixel is no shadow.
    clamp : largest absolute log-ratio.
    scale, half : pixels from place to place, and places on either side.
    lines, plan, n : (., `N_LINE_COLUMNS`) and (., `N_PLAN_COLUMNS`), the first ``n`` rows.
    odds : (n, >= `LONGEST`), overwritten.
    """
    height, width = bgr.shape[0], bgr.shape[1]
    pixels, least_variance = room
    has_room, most = pixels.size > 0, np.float32(_HALF / np.float32(least_variance))
    colors, rooms = np.zeros(LONGEST, dtype=np.uint32), np.zeros(LONGEST, dtype=np.uint32)
    ours, scenes = np.ones(LONGEST, dtype=np.float32), np.ones(LONGEST, dtype=np.float32)
    beyonds, againsts = np.zeros(LONGEST, dtype=np.float32), np.ones(LONGEST, dtype=np.float32)
    shown, against = silhouette
    who, their_colors = neighbors
    has_silhouette, has_neighbors = shown.size > 0, who.size > 0
    says = np.ones(LONGEST, dtype=np.float32)
    for line in range(n):
        own, behind, before = plan[line, OWN], plan[line, BEHIND], plan[line, BEFORE]
        nu, nv = lines[line, LINE_NU], lines[line, LINE_NV]
        if before < 0:
            continue
        count, start = before + 2 * half, (0.5 - before - half) * scale
        du, dv = scale * nu, scale * nv
        x, y = lines[line, LINE_U] + start * nu + 0.5, lines[line, LINE_V] + start * nv + 0.5
        first, last = _inside(x, y, du, dv, width, height, count)
        for k in range(first, last):
            i, j = np.uint64(np.int64(y + k * dv)), np.uint64(np.int64(x + k * du))
            b, g, r = np.uint32(bgr[i, j, 0]), np.uint32(bgr[i, j, 1]), np.uint32(bgr[i, j, 2])
            colors[k] = b | (g << _8) | (r << _16)
            kind = ((b >> _4) << _8) | (g & np.uint32(0xF0)) | (r >> _4)
            ours[k], scenes[k] = body[own, kind], scene[kind]
            beyonds[k] = body[behind, kind] if behind >= 0 else _ZERO
            rooms[k] = pixels[i, j] if has_room else np.uint32(0)
            againsts[k] = against[shown[i, j]] if has_silhouette else _ONE
            if has_neighbors:
                label = np.int64(who[i, j])
                says[k] = _ZERO if label == SAYS_NOTHING else _ONE
                if 0 < label < SAYS_NOTHING:
                    rooms[k], scenes[k] = np.uint32(0), their_colors[label - 1, kind]
        weight = _HALF if behind >= 0 else _ONE
        for block in range(np.uint64((count + _BLOCK - 1) // _BLOCK)):
            for place in range(np.uint64(_BLOCK)):
                at = block * np.uint64(_BLOCK) + place
                other = other_density(colors[at], rooms[at], scenes[at], most, darkest)
                other = weight * other * againsts[at] + (_ONE - weight) * beyonds[at]
                odds[line, at] = says[at] * min(max(log_positive(ours[at] / other), -clamp), clamp)
        for k in range(first):
            odds[line, k] = _ZERO
        for k in range(last, count):
            odds[line, k] = _ZERO


@compiled
def _inside(x, y, du, dv, width, height, count):
    """The range of pixels (first, last; last exclusive) of a line that lie on the image."""
    end_x, end_y = x + (count - 1) * du, y + (count - 1) * dv
    if min(x, end_x) >= 0.0 and max(x, end_x) < width and min(y, end_y) >= 0.0 and max(y, end_y) < height:
        return 0, count
    first, last = count, count
    for k in range(count):
        inside = 0.0 <= x + k * du < width and 0.0 <= y + k * dv < height
        if inside and first == count:
            first = k
        if not inside and first < k:
            last = k
            break
    return (first, last) if first < last else (0, 0)


@compiled(inline="always")
def color_at(bgr, u, v):
    """Bilinear color of an image.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    u, v : pixel.

    Returns
    -------
    Whether it is on the image, blue, green, red.
    """
    x, y = math.floor(u), math.floor(v)
    i, j = int(y), int(x)
    inside = i >= 0 and j >= 0 and i + 1 < bgr.shape[0] and j + 1 < bgr.shape[1]
    if not inside:
        i, j = 0, 0
    top, left = np.uint64(i), np.uint64(j)
    low, right = top + np.uint64(1), left + np.uint64(1)
    a, b = u - x, v - y
    w00, w01, w10, w11 = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
    return (
        inside,
        w00 * bgr[top, left, 0] + w01 * bgr[top, right, 0] + w10 * bgr[low, left, 0] + w11 * bgr[low, right, 0],
        w00 * bgr[top, left, 1] + w01 * bgr[top, right, 1] + w10 * bgr[low, left, 1] + w11 * bgr[low, right, 1],
        w00 * bgr[top, left, 2] + w01 * bgr[top, right, 2] + w10 * bgr[low, left, 2] + w11 * bgr[low, right, 2],
    )
