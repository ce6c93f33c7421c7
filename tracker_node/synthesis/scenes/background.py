"""Images of a cluttered room to stand behind a body: wall, floor, furniture, patterns; seeded."""

from __future__ import annotations

import cv2
import numpy as np

from ...camera.rig import Camera

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
