"""Textures of rooms: plaster, bricks, wallpaper, planks, tiles, carpet, posters, furniture. All are (t, t, 3) uint8 sRGB."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

from benchmark.clothed.render._noise import noise_image

TEXELS = 1024
_SHAPE = (TEXELS, TEXELS)


def draw_wall_color(rng: np.random.Generator) -> np.ndarray:
    """(3,) sRGB between 0 and 1: pale or grayish."""
    return np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.02, 0.3), rng.uniform(0.45, 0.88)))


def draw_floor_color(rng: np.random.Generator) -> np.ndarray:
    """(3,) sRGB between 0 and 1: wood, stone or carpet."""
    if rng.random() < 0.6:
        return np.array(colorsys.hsv_to_rgb(rng.uniform(0.05, 0.11), rng.uniform(0.2, 0.55), rng.uniform(0.3, 0.7)))
    return np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.03, 0.35), rng.uniform(0.25, 0.7)))


def _colored(color: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """A color (3,) times a factor (h, w) or (h, w, 3)."""
    factor = factor if factor.ndim == 3 else factor[..., None]
    return np.clip(color * factor * 255.0, 0.0, 255.0).astype(np.uint8)


def wall_texture(color: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Plaster, striped wallpaper or bricks.

    Parameters
    ----------
    color : (3,) sRGB between 0 and 1.
    rng : decides kind and pattern.

    Returns
    -------
    The texture.
    """
    factor = 1.0 + 0.05 * noise_image(_SHAPE, 160.0, rng) + 0.04 * noise_image(_SHAPE, 9.0, rng)
    kind = rng.random()
    u, v = np.arange(TEXELS), np.arange(TEXELS)[:, None]
    if kind < 0.2:
        width = int(rng.integers(12, 40))
        factor *= 1.0 - rng.uniform(0.05, 0.2) * ((u // width) % 2)
    elif kind < 0.38:
        tall, wide = 9, 27
        row = v // tall
        joint = (v % tall == 0) | ((u + (row % 2) * wide // 2) % wide == 0)
        tone = rng.uniform(0.85, 1.1, (TEXELS // tall + 2, TEXELS // wide + 3))
        factor *= np.where(joint, 1.15, tone[row, (u + (row % 2) * wide // 2) // wide])
    return _colored(color, factor)


def ceiling_texture(color: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Plaster.

    Parameters
    ----------
    color : (3,) sRGB between 0 and 1.
    rng : decides the pattern.

    Returns
    -------
    The texture.
    """
    return _colored(color, 1.0 + 0.03 * noise_image(_SHAPE, 120.0, rng) + 0.02 * noise_image(_SHAPE, 8.0, rng))


def floor_texture(color: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Planks, tiles or carpet.

    Parameters
    ----------
    color : (3,) sRGB between 0 and 1.
    rng : decides kind and pattern.

    Returns
    -------
    The texture.
    """
    u, v = np.arange(TEXELS), np.arange(TEXELS)[:, None]
    kind = rng.random()
    if kind < 0.5:
        width, length = int(rng.integers(12, 26)), int(rng.integers(120, 300))
        row = v // width
        along = u + (row * 97) % length
        tone = rng.uniform(0.72, 1.18, (TEXELS // width + 1, TEXELS // length + 3))[row, along // length]
        grain = cv2.resize(noise_image((TEXELS, 64), 5.0, rng), _SHAPE, interpolation=cv2.INTER_CUBIC)
        factor = tone * (1.0 + 0.1 * grain) * np.where((v % width == 0) | (along % length == 0), 0.6, 1.0)
    elif kind < 0.75:
        size = int(rng.integers(30, 70))
        tone = rng.uniform(0.92, 1.06, (TEXELS // size + 1,) * 2)[v // size, u // size]
        factor = tone * (1.0 + 0.06 * noise_image(_SHAPE, 40.0, rng))
        factor *= np.where((u % size < 2) | (v % size < 2), 0.75, 1.0)
    else:
        factor = 1.0 + 0.12 * noise_image(_SHAPE, 6.0, rng) + 0.08 * noise_image(_SHAPE, 220.0, rng)
    if rng.random() < 0.35:
        factor = factor[..., None] * _rug(rng)
    return _colored(color, factor)


def _rug(rng: np.random.Generator) -> np.ndarray:
    """(t, t, 3) factor of a carpet somewhere in the middle: another color and a border."""
    result = np.ones((*_SHAPE, 3))
    middle, half = rng.uniform(0.4, 0.6, 2) * TEXELS, rng.uniform(80.0, 200.0, 2)
    (u0, v0), (u1, v1) = (middle - half).astype(int), (middle + half).astype(int)
    result[v0:v1, u0:u1] = rng.uniform(0.6, 1.25, 3)
    result[v0 + 10 : v1 - 10, u0 + 10 : u1 - 10] = rng.uniform(0.6, 1.25, 3)
    return result


def add_posters(texture: np.ndarray, texels_per_m: float, height: float, rng: np.random.Generator) -> np.ndarray:
    """Posters, a window or a door on a wall.

    Parameters
    ----------
    texture : of the wall; changed.
    texels_per_m : of it.
    height : of the room, meters.
    rng : decides what and where.

    Returns
    -------
    The texture.
    """
    for _ in range(int(rng.integers(1, 5))):
        wide, tall = rng.uniform(0.4, 1.5), rng.uniform(0.4, 1.0)
        u = int(rng.uniform(0.05, 0.8) * TEXELS)
        v = int(rng.uniform(0.9, max(1.0, height - tall - 0.2)) * texels_per_m)
        w, h = int(wide * texels_per_m), int(tall * texels_per_m)
        area = texture[v : v + h, u : u + w]
        if area.size:
            area[:] = _poster(area.shape[:2], rng)
    return texture


def _poster(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    poster = np.empty((*shape, 3), dtype=np.uint8)
    poster[:] = rng.integers(20, 235, 3)
    for _ in range(int(rng.integers(3, 14))):
        at = (int(rng.integers(shape[1])), int(rng.integers(shape[0])))
        color = tuple(int(c) for c in rng.integers(10, 245, 3))
        if rng.random() < 0.5:
            cv2.circle(poster, at, int(rng.integers(3, max(5, min(shape) // 3))), color, -1)
        else:
            cv2.rectangle(poster, at, (int(rng.integers(shape[1])), int(rng.integers(shape[0]))), color, -1)
    frame = max(1, min(shape) // 25)
    cv2.rectangle(poster, (0, 0), (shape[1] - 1, shape[0] - 1), tuple(int(c) for c in rng.integers(10, 90, 3)), frame)
    return poster


def box_texture(rng: np.random.Generator) -> np.ndarray:
    """Furniture: plain, wood, or shelves full of books; v from the floor upward."""
    color = np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.05, 0.7), rng.uniform(0.2, 0.8)))
    kind = rng.random()
    texture = _colored(color, 1.0 + 0.06 * noise_image(_SHAPE, 60.0, rng))
    if kind < 0.35:
        grain = cv2.resize(noise_image((TEXELS, 64), 8.0, rng), _SHAPE, interpolation=cv2.INTER_CUBIC)
        texture = _colored(np.array([0.5, 0.36, 0.24]) * rng.uniform(0.5, 1.5), 1.0 + 0.18 * grain)
    elif kind < 0.6:
        _add_books(texture, rng)
    return texture


def _add_books(texture: np.ndarray, rng: np.random.Generator) -> None:
    shelf = int(rng.integers(110, 190))
    for v in range(12, TEXELS, shelf):
        u = 10
        while u < TEXELS - 10:
            w, h = int(rng.integers(10, 32)), int(shelf * rng.uniform(0.55, 0.85))
            texture[v : v + h, u : u + w - 2] = rng.integers(25, 225, 3)
            u += w
