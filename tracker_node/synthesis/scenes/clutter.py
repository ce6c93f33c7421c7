"""A room in which everything is patterned and strongly colored, so that no color is the body's own."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from .rasterizer import TexturedMesh
from .room import HALF_SIZE, HEIGHT, quad

_TEXELS_PER_M = 90.0


def meshes(seed: int) -> list[TexturedMesh]:
    """Floor, ceiling and walls, meters, Z up, floor at z = 0."""
    rng = np.random.default_rng([seed, 11])
    s, h = HALF_SIZE, HEIGHT
    corners = [(-s, -s), (s, -s), (s, s), (-s, s), (-s, -s)]
    result = [quad([(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], patches(rng, 2 * s, 2 * s))]
    result.append(quad([(-s, s, h), (s, s, h), (s, -s, h), (-s, -s, h)], patches(rng, 2 * s, 2 * s)))
    for (xa, ya), (xb, yb) in pairwise(corners):
        result.append(quad([(xb, yb, 0), (xa, ya, 0), (xa, ya, h), (xb, yb, h)], patches(rng, 2 * s, h)))
    return result


def patches(rng: np.random.Generator, width_m: float, height_m: float) -> np.ndarray:
    """Texture of things of 0.1 to 0.9 m over each other, half of them strongly colored.

    Parameters
    ----------
    rng : random numbers.
    width_m, height_m : of the surface.

    Returns
    -------
    (h, w, 3) uint8 RGB.
    """
    width, height = int(width_m * _TEXELS_PER_M), int(height_m * _TEXELS_PER_M)
    image: np.ndarray = np.empty((height, width, 3), dtype=np.float32)
    image[:] = _color(rng)
    for _ in range(int(9.0 * width_m * height_m)):
        w, h = (rng.uniform(0.1, 0.9, 2) ** 1.5 * _TEXELS_PER_M).astype(int) + 4
        thing: np.ndarray = np.empty((h, w, 3), dtype=np.float32)
        thing[:] = _color(rng)
        kind = rng.integers(4)
        if kind == 0:
            rows, columns = np.indices((h, w)) // int(rng.integers(4, 14))
            thing[(rows + columns) % 2 == 1] = _color(rng)
        elif kind == 1:
            thing[:, (np.arange(w) // int(rng.integers(3, 10))) % 2 == 1] = _color(rng)
        _lay(image, thing, rng)
    grain = rng.standard_normal((height, width, 1)).astype(np.float32)
    return np.clip(image + 6.0 * cv2.GaussianBlur(grain, (0, 0), 0.7)[:, :, None], 0, 255).astype(np.uint8)


def _lay(image: np.ndarray, thing: np.ndarray, rng: np.random.Generator) -> None:
    """``thing`` on ``image``, turned by any angle, anywhere."""
    (h, w), (height, width) = thing.shape[:2], image.shape[:2]
    turn = cv2.getRotationMatrix2D((0.5 * w, 0.5 * h), float(rng.uniform(0.0, 180.0)), 1.0)
    x, y = rng.uniform(0, width), rng.uniform(0, height)
    reach = 0.5 * np.hypot(w, h) + 2.0
    x0, x1 = max(0, int(x - reach)), min(width, int(x + reach) + 1)
    y0, y1 = max(0, int(y - reach)), min(height, int(y + reach) + 1)
    turn[:, 2] += (x - x0 - 0.5 * w, y - y0 - 0.5 * h)
    window = np.ascontiguousarray(image[y0:y1, x0:x1])
    cv2.warpAffine(thing, turn, (x1 - x0, y1 - y0), dst=window, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)
    image[y0:y1, x0:x1] = window


def _color(rng: np.random.Generator) -> np.ndarray:
    """RGB (3,): every other one gray or pale, the others of any hue and strong."""
    saturation = rng.uniform(0.45, 0.95) if rng.random() < 0.5 else rng.uniform(0.0, 0.35)
    hsv = np.array([[[rng.uniform(0.0, 360.0), saturation, rng.uniform(0.25, 0.95)]]], dtype=np.float32)
    return 255.0 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0]
