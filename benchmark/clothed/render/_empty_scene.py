"""What a camera sees of the empty room: for every pixel the light that each lamp, and all the rest, sends to it."""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from benchmark.clothed.render._room import Room

_SAMPLES = 3  # along each axis of a pixel
_LAMP_RADIUS_M = 0.16
_LAMP_NEAR_M2 = 1.0  # lamps shine downward: nothing beside them is brighter than at this squared distance
_LINEAR = ((np.arange(256) / 255.0) ** 2.2).astype(np.float32)


@dataclass(frozen=True, eq=False)
class EmptyScene:
    """Of one camera; linear RGB.

    Parameters
    ----------
    ambient : (h, w, 3) float32.
    by_lamp : (l, h, w, 3) float32, furniture's shadows included.
    places : (h, w, 3) float32, world point at the middle of every pixel.
    depths : (h, w) float32 meters along z.
    """

    ambient: np.ndarray
    by_lamp: np.ndarray
    places: np.ndarray
    depths: np.ndarray


def draw_empty_scene(room: Room, K: np.ndarray, T_world_cam: np.ndarray, size: tuple[int, int]) -> EmptyScene:
    """Draw the empty room.

    Parameters
    ----------
    room : what there is.
    K : (3, 3) intrinsics.
    T_world_cam : (4, 4) pose of the camera.
    size : width and height, pixels.

    Returns
    -------
    The scene.
    """
    width, height = size
    n = len(room.lights)
    scene = EmptyScene(
        np.zeros((height, width, 3), np.float32), np.zeros((n, height, width, 3), np.float32),
        np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32),
    )  # fmt: skip
    bounds = np.array([[-room.half_sizes[0], -room.half_sizes[1], 0.0], [*room.half_sizes, room.height]])
    angles = np.arange(_SAMPLES**2) * 2.4
    jitter = _LAMP_RADIUS_M * np.sqrt((np.arange(_SAMPLES**2) + 0.5) / _SAMPLES**2)
    offsets = np.stack([jitter * np.cos(angles), jitter * np.sin(angles)], axis=1)
    _cast(
        np.linalg.inv(K), T_world_cam, bounds, room.boxes, room.lights, room.powers, room.ambient, room.textures,
        room.texels_per_m, _LINEAR, offsets, scene.ambient, scene.by_lamp, scene.places, scene.depths,
    )  # fmt: skip
    return scene


@nb.njit(cache=True)
def _enter(box, o, d):
    """Distance along a ray at which it enters a box, and the axis; -1 where it does not."""
    enter, leave, axis = -1e30, 1e30, 0
    for a in range(3):
        inverse = 1.0 / d[a] if d[a] != 0.0 else 1e30
        t0, t1 = (box[0, a] - o[a]) * inverse, (box[1, a] - o[a]) * inverse
        if t0 > t1:
            t0, t1 = t1, t0
        if t0 > enter:
            enter, axis = t0, a
        leave = min(leave, t1)
    if enter < leave and enter > 1e-6:
        return enter, axis
    return -1.0, 0


@nb.njit(cache=True)
def _leave(box, o, d):
    """Distance along a ray at which it leaves a box that it is in, and the axis."""
    best, axis = 1e30, 0
    for a in range(3):
        if d[a] != 0.0:
            t = ((box[1, a] if d[a] > 0.0 else box[0, a]) - o[a]) / d[a]
            if t < best:
                best, axis = t, a
    return best, axis


@nb.njit(cache=True)
def _texture(texture, scale, u, v, linear, color):
    """Bilinear color (3,) at meters (u, v) of a texture."""
    size = texture.shape[0]
    x, y = u * scale - 0.5, v * scale - 0.5
    i, j = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - i, y - j
    i0, i1, j0, j1 = i % size, (i + 1) % size, j % size, (j + 1) % size
    for c in range(3):
        top = (1.0 - fx) * linear[texture[j0, i0, c]] + fx * linear[texture[j0, i1, c]]
        low = (1.0 - fx) * linear[texture[j1, i0, c]] + fx * linear[texture[j1, i1, c]]
        color[c] = (1.0 - fy) * top + fy * low


@nb.njit(cache=True)
def _is_lit(boxes, p, lamp, offset, to_lamp):
    to_lamp[0], to_lamp[1], to_lamp[2] = lamp[0] + offset[0] - p[0], lamp[1] + offset[1] - p[1], lamp[2] - p[2]
    for b in range(len(boxes)):
        t, _ = _enter(boxes[b], p, to_lamp)
        if 1e-4 < t < 1.0:
            return False
    return True


@nb.njit(cache=True)
def _surface(bounds, boxes, o, d):
    """Distance, surface, axis of the normal and its sign where a ray ends."""
    t, axis = _leave(bounds, o, d)
    sign = -1.0 if d[axis] > 0.0 else 1.0
    if axis == 2:
        surface = 0 if d[2] < 0.0 else 1
    else:
        surface = 2 + 2 * axis + (1 if d[axis] > 0.0 else 0)
    for b in range(len(boxes)):
        s, a = _enter(boxes[b], o, d)
        if 0.0 < s < t:
            t, axis, surface, sign = s, a, 6 + b, (-1.0 if d[a] > 0.0 else 1.0)
    return t, surface, axis, sign


@nb.njit(cache=True)
def _cast(
    K_inverse, T, bounds, boxes, lights, powers, ambient, textures, scales, linear, offsets, out_ambient, out_lamps, places,
    depths,
):  # fmt: skip
    rows, columns = depths.shape
    o, d, p, color, to_lamp = T[:3, 3].copy(), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    n = _SAMPLES * _SAMPLES
    for v in range(rows):
        for u in range(columns):
            for s in range(n):
                x = u + (s % _SAMPLES + 0.5) / _SAMPLES - 0.5
                y = v + (s // _SAMPLES + 0.5) / _SAMPLES - 0.5
                cx = K_inverse[0, 0] * x + K_inverse[0, 2]
                cy = K_inverse[1, 1] * y + K_inverse[1, 2]
                for a in range(3):
                    d[a] = T[a, 0] * cx + T[a, 1] * cy + T[a, 2]
                t, surface, axis, sign = _surface(bounds, boxes, o, d)
                for a in range(3):
                    p[a] = o[a] + t * d[a]
                first, second = (1 if axis == 0 else 0), (1 if axis == 2 else 2)
                low = boxes[surface - 6, 0] if surface >= 6 else bounds[0]
                _texture(textures[surface], scales[surface], p[first] - low[first], p[second] - low[second], linear, color)
                corner = 1.0
                for a in range(3):
                    if a != axis and surface < 6:
                        corner *= 1.0 - 0.3 * np.exp(-min(p[a] - bounds[0, a], bounds[1, a] - p[a]) / 0.35)
                if s == n // 2:
                    depths[v, u] = t
                    for a in range(3):
                        places[v, u, a] = p[a]
                for c in range(3):
                    out_ambient[v, u, c] += color[c] * ambient[c] * corner / n
                p[axis] += sign * 1e-3
                for k in range(len(lights)):
                    lit = _is_lit(boxes, p, lights[k], offsets[s], to_lamp)
                    squared = to_lamp[0] ** 2 + to_lamp[1] ** 2 + to_lamp[2] ** 2
                    cosine = sign * to_lamp[axis] / np.sqrt(squared)
                    squared = max(squared, _LAMP_NEAR_M2)
                    if lit and cosine > 0.0:
                        for c in range(3):
                            out_lamps[k, v, u, c] += color[c] * powers[k, c] * cosine / squared / n
