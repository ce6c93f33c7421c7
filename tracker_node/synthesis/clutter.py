"""A room in which everything is patterned and strongly colored, so that no color is the body's own."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from .rasterizer import TexturedMesh
from .room import HALF_SIZE, HEIGHT, quad

_TEXELS_PER_M = 90.0


def meshes(seed: int) -> list[TexturedMesh]:
    """Floor, ceiling and walls, metres, Z up, floor at z = 0."""
    rng = np.random.default_rng([seed, 11])
    s, h = HALF_SIZE, HEIGHT
    corners = [(-s, -s), (s, -s), (s, s), (-s, s), (-s, -s)]
    result = [quad([(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], patches(rng, 2 * s, 2 * s))]
    result.append(quad([(-s, s, h), (s, s, h), (s, -s, h), (-s, -s, h)], patches(rng, 2 * s, 2 * s)))
    for (xa, ya), (xb, yb) in pairwise(corners):
        result.append(quad([(xb, yb, 0), (xa, ya, 0), (xa, ya, h), (xb, yb, h)], patches(rng, 2 * s, h)))
    return result


def patches(rng: np.random.Generator, width_m: float, height_m: float) -> np.ndarray:
    """Texture (h, w, 3) uint8 RGB: things of 0.1 to 0.9 m over each other, half of them strongly colored."""
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
        turn = cv2.getRotationMatrix2D((0.5 * w, 0.5 * h), float(rng.uniform(0.0, 180.0)), 1.0)
        turn[:, 2] += np.array([rng.uniform(0, width), rng.uniform(0, height)]) - (0.5 * w, 0.5 * h)
        cv2.warpAffine(thing, turn, (width, height), dst=image, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)
    grain = rng.standard_normal((height, width, 1)).astype(np.float32)
    return np.clip(image + 6.0 * cv2.GaussianBlur(grain, (0, 0), 0.7)[:, :, None], 0, 255).astype(np.uint8)


def _color(rng: np.random.Generator) -> np.ndarray:
    """RGB (3,): every other one gray or pale, the others of any hue and strong."""
    saturation = rng.uniform(0.45, 0.95) if rng.random() < 0.5 else rng.uniform(0.0, 0.35)
    hsv = np.array([[[rng.uniform(0.0, 360.0), saturation, rng.uniform(0.25, 0.95)]]], dtype=np.float32)
    return 255.0 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0]
