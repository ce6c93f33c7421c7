"""A room without people: walls, floor, furniture, lights, and their textures.

The room is a box about the world's origin, z up, the floor at 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmark.clothed.render._textures import (
    TEXELS,
    add_posters,
    box_texture,
    ceiling_texture,
    draw_floor_color,
    draw_wall_color,
    floor_texture,
    wall_texture,
)

FLOOR, CEILING, FIRST_WALL, FIRST_BOX = 0, 1, 2, 6
_CLEAR_M = 0.45  # between furniture and people, and before a camera


@dataclass(frozen=True, eq=False)
class Room:
    """Geometry, light and textures.

    Parameters
    ----------
    half_sizes : (2,) meters, along x and y.
    height : meters.
    boxes : (k, 2, 3) lower and upper corners of the furniture.
    lights : (l, 3) places of the lamps.
    powers : (l, 3) linear RGB: irradiance at one meter.
    ambient : (3,) linear RGB.
    textures : (6 + k, t, t, 3) uint8 sRGB: floor, ceiling, walls at -x, +x, -y, +y, boxes.
    texels_per_m : (6 + k,).
    wall_color, floor_color : (3,) sRGB between 0 and 1.
    """

    half_sizes: np.ndarray
    height: float
    boxes: np.ndarray
    lights: np.ndarray
    powers: np.ndarray
    ambient: np.ndarray
    textures: np.ndarray
    texels_per_m: np.ndarray
    wall_color: np.ndarray
    floor_color: np.ndarray


def draw_size(rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """Half-sizes (2,) and height of a room, meters."""
    return rng.uniform(4.3, 5.4, 2), float(rng.uniform(2.7, 3.3))


def draw_room(
    size: tuple[np.ndarray, float],
    boxes: list[np.ndarray],
    lines: np.ndarray,
    rng: np.random.Generator,
) -> Room:
    """A furnished room.

    Parameters
    ----------
    size : half-sizes and height.
    boxes : furniture that has to be there, (2, 3) each.
    lines : (n, 2, 3) from cameras to people: other furniture does not stand in them.
    rng : decides the rest.

    Returns
    -------
    The room.
    """
    half, height = size
    furniture = [*boxes, *_along_walls(half, lines, rng, int(rng.integers(4, 8)))]
    wall, second, floor = draw_wall_color(rng), draw_wall_color(rng), draw_floor_color(rng)
    walls = [wall if rng.random() < 0.6 else second for _ in range(4)]
    spans = (2.0 * max(half), 2.0 * max(half), *(2.0 * half[1 - i // 2] for i in range(4)))
    textures = [floor_texture(floor, rng), ceiling_texture(np.clip(wall + 0.12, 0.0, 0.95), rng)]
    for color, span in zip(walls, spans[2:], strict=True):
        textures.append(add_posters(wall_texture(color, rng), TEXELS / span, height, rng))
    textures += [box_texture(rng) for _ in furniture]
    scales = [TEXELS / span for span in spans] + [TEXELS / max(1.0, float((b[1] - b[0]).max())) for b in furniture]
    lights, powers, ambient = _draw_lights(half, height, rng)
    return Room(
        half, height, np.array(furniture).reshape(-1, 2, 3), lights, powers, ambient,
        np.stack(textures), np.array(scales), wall, floor,
    )  # fmt: skip


def _draw_lights(half, height, rng):
    n = int(rng.integers(2, 4))
    angles = rng.uniform(0.0, 2.0 * np.pi) + np.arange(n) * 2.0 * np.pi / n + rng.uniform(-0.4, 0.4, n)
    out = rng.uniform(0.35, 0.7, n)
    places = np.stack([half[0] * out * np.cos(angles), half[1] * out * np.sin(angles), np.full(n, height - 0.12)], axis=1)
    warmth = rng.uniform(-0.08, 0.1, (n, 1)) * np.array([1.0, 0.0, -1.0])
    strengths = rng.uniform(0.5, 1.5, n)
    powers = (strengths / strengths.sum())[:, None] * 12.0 * (1.0 + warmth)
    return places, powers, rng.uniform(0.2, 0.4) * np.array([0.97, 1.0, 1.04])


def _along_walls(half, lines, rng, n: int) -> list[np.ndarray]:
    """Boxes along the walls, clear of each other and of the lines."""
    found: list[np.ndarray] = []
    for _ in range(60):
        if len(found) == n:
            break
        length, depth = rng.uniform(0.4, 2.0), rng.uniform(0.3, 0.75)
        tall = rng.uniform(0.4, 1.1) if rng.random() < 0.65 else rng.uniform(1.4, 2.1)
        axis, sign = int(rng.integers(2)), rng.choice([-1.0, 1.0])
        middle = np.zeros(2)
        middle[axis] = sign * (half[axis] - 0.5 * depth)
        middle[1 - axis] = rng.uniform(-1.0, 1.0) * (half[1 - axis] - 0.5 * length)
        extent = np.array([depth, length]) if axis == 0 else np.array([length, depth])
        box = np.array([[*(middle - 0.5 * extent), 0.0], [*(middle + 0.5 * extent), tall]])
        if not any(_touch(box, other) for other in found) and not is_crossed(box, lines):
            found.append(box)
    return found


def _touch(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.all((a[0] < b[1]) & (b[0] < a[1])))


def is_crossed(box: np.ndarray, lines: np.ndarray, clear: float = _CLEAR_M) -> bool:
    """Whether lines come near a box.

    Parameters
    ----------
    box : (2, 3) corners.
    lines : (n, 2, 3) ends.
    clear : meters about the box that count as its own.

    Returns
    -------
    True where one does.
    """
    start, way = lines[:, 0], lines[:, 1] - lines[:, 0]
    way = np.where(np.abs(way) < 1e-9, 1e-9, way)
    first, second = ((box[i] + (-clear if i == 0 else clear) - start) / way for i in range(2))
    enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    return bool(np.any((enter < leave) & (leave > 0.0) & (enter < 1.0)))
