"""The room of the synthetic scenes: floor, walls and furniture with procedural textures.

Images of a cluttered room to stand behind a body: wall, floor, furniture, patterns; seeded.
"""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from ...camera.rig import Camera
from .rasterizer import TexturedMesh

HALF_SIZE = 5.4  # meters from the middle to each wall
HEIGHT = 3.2


def meshes(seed: int) -> list[TexturedMesh]:
    """All meshes of the room, meters, Z up, floor at z = 0."""
    rng = np.random.default_rng([seed, 7])
    s, h = HALF_SIZE, HEIGHT
    corners = [(-s, -s), (s, -s), (s, s), (-s, s)]
    result = [quad([(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], _planks(rng))]
    result.append(quad([(-s, s, h), (s, s, h), (s, -s, h), (-s, -s, h)], _plaster(rng, (236, 234, 228), 128)))
    tints = [(206, 200, 186), (190, 200, 204), (214, 206, 196), (196, 202, 190)]
    for i in range(4):
        (xa, ya), (xb, yb) = corners[i], corners[(i + 1) % 4]
        result.append(quad([(xb, yb, 0), (xa, ya, 0), (xa, ya, h), (xb, yb, h)], _wall(rng, tints[i], i)))
    for center, size, tint in _FURNITURE:
        result.extend(_box(np.array(center), np.array(size), _wood(rng, tint)))
    return result


# (x, y) of the middle on the floor, (width, depth, height), tint: cupboards, shelves, a bench, boxes.
_FURNITURE = (
    ((5.0, 1.6, 0.0), (0.6, 1.4, 1.9), (150, 110, 76)),
    ((5.0, -2.4, 0.0), (0.6, 2.0, 0.8), (206, 196, 176)),
    ((-5.0, -0.8, 0.0), (0.7, 1.8, 0.75), (96, 74, 58)),
    ((-5.0, 2.9, 0.0), (0.5, 1.0, 2.1), (170, 160, 150)),
    ((1.2, 5.0, 0.0), (1.6, 0.6, 1.1), (128, 96, 70)),
    ((-2.6, 5.0, 0.0), (0.9, 0.7, 0.9), (92, 108, 122)),
    ((-1.4, -5.0, 0.0), (2.0, 0.5, 1.5), (184, 168, 140)),
    ((2.6, -5.0, 0.0), (0.8, 0.6, 0.55), (120, 60, 54)),
)


def quad(corners, texture: np.ndarray) -> TexturedMesh:
    """A rectangle with a texture.

    Parameters
    ----------
    corners : four points (3,), meters, from the lower left one on, counterclockwise.
    texture : (h, w, 3) uint8 RGB.

    Returns
    -------
    Two triangles.
    """
    uv = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    return TexturedMesh(np.array(corners, dtype=float), np.array([[0, 1, 2], [0, 2, 3]]), uv, texture)


def _box(base: np.ndarray, size: np.ndarray, texture: np.ndarray) -> list[TexturedMesh]:
    x0, y0 = base[:2] - size[:2] / 2
    x1, y1, z0, z1 = x0 + size[0], y0 + size[1], base[2], base[2] + size[2]
    sides = [
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
        [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
        [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
    ]
    return [quad(side, texture) for side in sides]


def _cloud(rng: np.random.Generator, size: int, scale: int) -> np.ndarray:
    """Smooth noise (size, size), zero mean, about unit deviation."""
    coarse = rng.standard_normal((max(2, size // scale), max(2, size // scale))).astype(np.float32)
    fine = cv2.resize(coarse, (size, size), interpolation=cv2.INTER_CUBIC)
    return (fine - fine.mean()) / max(float(fine.std()), 1e-6)


def _grain(rng: np.random.Generator, size: int, along_u: float, along_v: float) -> np.ndarray:
    """Noise (size, size) drawn out along one direction, unit deviation."""
    noise = rng.standard_normal((size, size)).astype(np.float32)
    drawn = np.asarray(cv2.GaussianBlur(noise, (0, 0), sigmaX=along_u, sigmaY=along_v))
    return drawn / float(drawn.std())


def _to_texture(image: np.ndarray) -> np.ndarray:
    return np.clip(image, 0, 255).astype(np.uint8)


def _planks(rng: np.random.Generator) -> np.ndarray:
    """Wooden floor: staggered planks of slightly different tones, grain along them, dark joints."""
    size = 1024
    image = np.empty((size, size, 3), dtype=np.float32)
    grain = _grain(rng, size, 24.0, 0.8)
    edges = np.linspace(0, size, 37).astype(int)
    for top, bottom in pairwise(edges):
        cuts = np.unique(np.concatenate([[0], np.sort(rng.integers(60, size - 60, 3)), [size]]))
        for left, right in pairwise(cuts):
            tone = np.array([166.0, 130.0, 92.0]) * rng.uniform(0.88, 1.08)
            image[top:bottom, left:right] = tone
            image[top:bottom, left : left + 1] *= 0.7
        image[top : top + 1] *= 0.72
    return _to_texture(image + 5.0 * grain[:, :, None])


def _plaster(rng: np.random.Generator, tint: tuple[int, int, int], size: int = 1024) -> np.ndarray:
    image = np.empty((size, size, 3), dtype=np.float32)
    image[:] = tint
    image += (4.0 * _cloud(rng, size, size // 8) + 2.0 * rng.standard_normal((size, size)).astype(np.float32))[:, :, None]
    return _to_texture(image)


def _wall(rng: np.random.Generator, tint: tuple[int, int, int], index: int) -> np.ndarray:
    """Plaster with a skirting board, a window or a door, and pictures. Row 0 of the texture is the top of the wall."""
    size = 1024
    image = _plaster(rng, tint, size)
    across = size / (2 * HALF_SIZE)  # texels per meter
    up = size / HEIGHT

    def fill(x: float, z: float, width: float, height: float, color) -> None:
        left, right = int((x + HALF_SIZE) * across), int((x + width + HALF_SIZE) * across)
        image[int(size - (z + height) * up) : int(size - z * up), left:right] = color

    fill(-HALF_SIZE, 0.0, 2 * HALF_SIZE, 0.11, (120, 104, 88))
    if index % 2 == 0:
        for x in (-3.4, 0.6):
            fill(x, 0.95, 1.7, 1.5, (240, 240, 236))
            fill(x + 0.07, 1.02, 0.75, 1.36, (176, 200, 222))
            fill(x + 0.88, 1.02, 0.75, 1.36, (168, 194, 220))
    else:
        fill(2.0, 0.0, 1.0, 2.1, (112, 84, 62))
        fill(2.08, 0.05, 0.84, 1.98, (140, 106, 78))
    for x in rng.uniform(-4.6, 3.4, 3):
        width, height = rng.uniform(0.35, 0.8, 2)
        z = rng.uniform(1.2, 1.7)
        fill(x, z, width, height, (54, 46, 40))
        fill(x + 0.04, z + 0.05, width - 0.08, height - 0.1, rng.integers(60, 220, 3))
    return image


def _wood(rng: np.random.Generator, tint: tuple[int, int, int]) -> np.ndarray:
    """Furniture: grain upright, doors or drawers marked by dark lines."""
    size = 256
    image = np.empty((size, size, 3), dtype=np.float32)
    image[:] = tint
    image += 5.0 * _grain(rng, size, 0.8, 20.0)[:, :, None]
    for position in np.linspace(0, size - 2, int(rng.integers(2, 5)) + 1).astype(int):
        image[:, position : position + 2] *= 0.6
    for position in np.linspace(0, size - 2, int(rng.integers(1, 4)) + 1).astype(int):
        image[position : position + 2] *= 0.6
    return _to_texture(image)


# Hue (degrees), saturation and value (0..1) of things: woods, walls, grays, blues, greens, reds; beige is the nearest to yellow
_PALETTE = (
    (30.0, 0.35, 0.55), (25.0, 0.45, 0.35), (45.0, 0.25, 0.75), (50.0, 0.32, 0.66), (40.0, 0.15, 0.85),
    (0.0, 0.0, 0.25), (0.0, 0.0, 0.5), (0.0, 0.0, 0.75), (210.0, 0.4, 0.45), (220.0, 0.55, 0.3), (200.0, 0.2, 0.7),
    (130.0, 0.35, 0.35), (160.0, 0.25, 0.55), (5.0, 0.55, 0.4), (350.0, 0.3, 0.6),
)  # fmt: skip
_N_THINGS = 26
_YELLOW = (38.0, 72.0)  # hues, degrees...
_MOST_SATURATED = 0.4  # ...that nothing has with more saturation than this


def cluttered_background(camera: Camera, seed: int) -> np.ndarray:
    """Image of a cluttered room.

    Parameters
    ----------
    camera : gives the size; every name has another image.
    seed : every seed has another image.

    Returns
    -------
    (h, w, 3) uint8 BGR.
    """
    width, height = camera.model.width, camera.model.height
    rng = np.random.default_rng([seed, *camera.name.encode()])
    image: np.ndarray = np.empty((height, width, 3), dtype=np.float32)
    horizon = int(height * rng.uniform(0.55, 0.75))
    image[:horizon] = _shaded(rng, horizon, width, (45.0, 0.12, 0.7))
    image[horizon:] = _shaded(rng, height - horizon, width, (30.0, 0.3, 0.45))
    for _ in range(_N_THINGS):
        _add_thing(image, rng)
    image = cv2.GaussianBlur(image, (0, 0), width / 900.0)
    return _less_yellow(np.clip(np.rint(image), 0, 255).astype(np.uint8))


def _shaded(rng: np.random.Generator, height: int, width: int, hsv: tuple[float, float, float]) -> np.ndarray:
    """A surface (height, width, 3), BGR float32, of one color in uneven light and with a fine grain."""
    pixel = np.array([[[hsv[0], hsv[1], hsv[2]]]], dtype=np.float32)
    color = 255.0 * cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0]
    slope = rng.uniform(-0.25, 0.25, 2)
    y, x = np.mgrid[-0.5 : 0.5 : complex(0, height), -0.5 : 0.5 : complex(0, width)].astype(np.float32)
    coarse = rng.normal(0.0, 0.03, (3 + height // 24, 3 + width // 24)).astype(np.float32)
    light = 1.0 + slope[0] * y + slope[1] * x + cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    light += rng.normal(0.0, 0.015, (height, width)).astype(np.float32)
    return (color * light[:, :, None]).astype(np.float32)


def _add_thing(image: np.ndarray, rng: np.random.Generator) -> None:
    """Paint a cupboard, a shelf of books, a poster, a curtain..., upright or a little turned, somewhere."""
    height, width = image.shape[:2]
    h, w = (max(8, int(side * rng.uniform(0.06, 0.38))) for side in (height, width))
    hue, saturation, value = _PALETTE[rng.integers(len(_PALETTE))]
    thing = _shaded(rng, h, w, (hue, saturation, value * rng.uniform(0.8, 1.15)))
    pattern = rng.integers(5)
    if pattern == 0:  # planks, books
        edges = np.sort(rng.integers(0, w, max(2, w // 12)))
        shades = rng.uniform(0.6, 1.25, (len(edges) + 1, 1)) * rng.uniform(0.85, 1.1, (len(edges) + 1, 3))
        thing *= shades[np.searchsorted(edges, np.arange(w))].astype(np.float32)
    elif pattern == 1:  # checks
        cell = int(rng.integers(6, 20))
        rows, columns = np.indices((h, w)) // cell
        thing *= np.where((rows + columns) % 2, 1.0, 0.72)[:, :, None].astype(np.float32)
    elif pattern == 2:  # folds
        thing *= (1.0 + 0.25 * np.sin(np.arange(w) * rng.uniform(0.1, 0.5))).astype(np.float32)[:, None]
    if rng.random() < 0.6:  # a frame
        cv2.rectangle(thing, (0, 0), (w - 1, h - 1), (0.55 * thing.mean(axis=(0, 1))).tolist(), max(1, w // 30))
    center = (rng.uniform(0, width), rng.uniform(0, height))
    turn = float(rng.normal(0.0, 4.0)) if rng.random() < 0.7 else float(rng.uniform(-40.0, 40.0))
    matrix = cv2.getRotationMatrix2D((0.5 * w, 0.5 * h), turn, 1.0)
    matrix[:, 2] += np.subtract(center, (0.5 * w, 0.5 * h))
    cv2.warpAffine(thing, matrix, (width, height), dst=image, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)


def _less_yellow(image: np.ndarray) -> np.ndarray:
    """Grain and light may have made a beige into a yellow: bound the saturation of such hues."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    yellow = (hsv[:, :, 0] >= _YELLOW[0] / 2) & (hsv[:, :, 0] <= _YELLOW[1] / 2)
    hsv[:, :, 1] = np.where(yellow, np.minimum(hsv[:, :, 1], int(255 * _MOST_SATURATED)), hsv[:, :, 1])
    return cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)
