"""Maps for `AreaScore`: how much the color of every pixel speaks for each part of the body against the background."""

from __future__ import annotations

import numpy as np

from ...compiled.kernels import compiled
from ...observation.appearance_kernels import log_positive
from ...render.occluders import SAYS_NOTHING
from ..lines.colors import other_density

_DARK = np.float32(30.0)  # added to an intensity, so that the hue of dark pixels, which is noise, counts little
_HUE = np.float32(255.0)


@compiled
def fill_log_ratios(bgr, log_body, scene, room, silhouette, neighbors, darkest, step, clamp, region, maps):
    """Fill maps with the mean log(p_class / p_scene) of the colors in each cell of an image.

    Cells are ``bgr.shape[0] // h`` pixels high, or a little more.

    Parameters
    ----------
    bgr : (height, width, 3) uint8.
    log_body : (n_colors, n_classes) log densities.
    scene, room, silhouette, neighbors, darkest : as in `lines.colors.read_lines`.
    step : every n-th pixel of a cell is read, in both directions.
    clamp : largest absolute log-ratio of a pixel.
    region : (u0, v0, u1, v1) cells that are filled.
    maps : (n_classes, h, w) float32; cells beside the region stay as they are.
    """
    n_classes, height, width = maps.shape
    cell = np.empty(n_classes, dtype=np.float32)
    pixels, least_variance = room
    shown, against = silhouette
    who, their_colors = neighbors
    most = np.float32(0.5 / least_variance)
    rows, columns = bgr.shape[0] / height, bgr.shape[1] / width
    for i in range(region[1], region[3]):
        top, bottom = int(i * rows), int((i + 1) * rows)
        for j in range(region[0], region[2]):
            left, right = int(j * columns), int((j + 1) * columns)
            count = 0
            cell[:] = np.float32(0.0)
            for v in range(top, bottom, step):
                for u in range(left, right, step):
                    b, g, r = np.uint32(bgr[v, u, 0]), np.uint32(bgr[v, u, 1]), np.uint32(bgr[v, u, 2])
                    color = (np.int64(b >> 4) << 8) | np.int64(g & 0xF0) | np.int64(r >> 4)
                    mean = pixels[v, u] if pixels.size > 0 else np.uint32(0)
                    of_scene, label = scene[color], np.int64(who[v, u]) if who.size > 0 else np.int64(0)
                    count += 1
                    if label == SAYS_NOTHING:
                        continue
                    if label > 0:
                        mean, of_scene = np.uint32(0), their_colors[label - 1, color]
                    packed = b | (g << np.uint32(8)) | (r << np.uint32(16))
                    density = other_density(packed, mean, of_scene, most, np.float32(darkest))
                    other = log_positive(density * against[shown[v, u]] if shown.size > 0 else density)
                    for k in range(n_classes):
                        cell[k] += min(max(log_body[color, k] - other, -clamp), clamp)
            for k in range(n_classes):
                maps[k, i, j] = cell[k] / np.float32(count)


@compiled(fastmath=True, inline="always")
def _robust(x, y, z, cap):
    """Cost, 0..1, of a difference; one half where its square is the ``cap``."""
    square = x * x + y * y + z * z
    return square / (square + cap)


@compiled(fastmath=True)
def _color_cost(r, g, b, red, green, blue, caps):
    """Robust cost, 0..2, of one color against another: half of it by RGB, half by RGB over intensity.

    ``caps`` (2,) are the squared differences that cost one half of the most.
    """
    one, two = _HUE / (r + g + b + _DARK), _HUE / (red + green + blue + _DARK)
    raw = _robust(r - red, g - green, b - blue, caps[0])
    return raw + _robust(r * one - red * two, g * one - green * two, b * one - blue * two, caps[1])


@compiled(fastmath=True)
def background_costs(bgr, background, caps, costs):
    """Cost of every pixel if the image shows the background.

    Parameters
    ----------
    bgr, background : (h, w, 3) uint8.
    caps : (2,) see `_color_cost`.
    costs : (h, w) float32, overwritten, 0..2.
    """
    for v in range(costs.shape[0]):
        for u in range(costs.shape[1]):
            costs[v, u] = _color_cost(
                np.float32(bgr[v, u, 2]), np.float32(bgr[v, u, 1]), np.float32(bgr[v, u, 0]),
                np.float32(background[v, u, 2]), np.float32(background[v, u, 1]), np.float32(background[v, u, 0]), caps,
            )  # fmt: skip


@compiled(fastmath=True)
def fill_explained(bgr, costs, colors, caps, maps):
    """Fill maps with how much less a pixel costs in the color of a part than as background.

    Parameters
    ----------
    bgr : (h, w, 3) uint8.
    costs : (h, w) of `background_costs`.
    colors : (n, 3) RGB, one a map.
    caps : (2,) see `_color_cost`.
    maps : (n, h, w) float32, overwritten.
    """
    width = np.uint64(maps.shape[2])
    seen = np.empty((6, maps.shape[2]), dtype=np.float32)  # of a row: RGB, and RGB over intensity
    for v in range(maps.shape[1]):
        for u in range(width):
            b, g, r = np.float32(bgr[v, u, 0]), np.float32(bgr[v, u, 1]), np.float32(bgr[v, u, 2])
            one = _HUE / (r + g + b + _DARK)
            seen[0, u], seen[1, u], seen[2, u], seen[3, u], seen[4, u], seen[5, u] = r, g, b, r * one, g * one, b * one
        for k in range(maps.shape[0]):
            _explained_row(seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], costs[v], colors[k], caps, maps[k, v])


@compiled(fastmath=True)
def _explained_row(r, g, b, hue_r, hue_g, hue_b, costs, color, caps, out):
    """One row of `fill_explained` for one color (`_color_cost`). By itself, for the sake of vectors."""
    red, green, blue = color[0], color[1], color[2]
    over = _HUE / (red + green + blue + _DARK)
    hue_red, hue_green, hue_blue, raw_cap, hue_cap = red * over, green * over, blue * over, caps[0], caps[1]
    for u in range(np.uint64(out.size)):
        raw = _robust(r[u] - red, g[u] - green, b[u] - blue, raw_cap)
        out[u] = costs[u] - raw - _robust(hue_r[u] - hue_red, hue_g[u] - hue_green, hue_b[u] - hue_blue, hue_cap)
