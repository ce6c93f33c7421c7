"""The loops over pixels that shade people, and the room where they cast shadows."""

from __future__ import annotations

import numba as nb
import numpy as np

from benchmark.clothed.render._noise import noise_at
from benchmark.clothed.render._shadows import reaching

SAMPLES = 2  # along each axis of a pixel


@nb.njit(cache=True)
def darken(ambient, by_lamp, places, views, maps, occupied, feet, image):
    """The empty scene with people's shadows, and darker floor about their feet.

    Parameters
    ----------
    ambient, by_lamp, places : of the empty scene.
    views, maps, occupied : of the shadow maps.
    feet : (f, 3) meters.
    image : (h, w, 3) float32 linear RGB; written.
    """
    rows, columns = ambient.shape[:2]
    for v in range(rows):
        for u in range(columns):
            x, y, z = places[v, u, 0], places[v, u, 1], places[v, u, 2]
            contact = 1.0
            if z < 0.01:
                for f in range(len(feet)):
                    squared = (x - feet[f, 0]) ** 2 + (y - feet[f, 1]) ** 2
                    if squared < 0.2:
                        contact *= 1.0 - 0.5 * np.exp(-squared / 0.018) * np.exp(-max(feet[f, 2] - 0.06, 0.0) / 0.1)
            for c in range(3):
                image[v, u, c] = ambient[v, u, c] * contact
            for k in range(len(by_lamp)):
                lit = reaching(views[k], maps[k], occupied[k], x, y, z, 2, 2)
                for c in range(3):
                    image[v, u, c] += lit * by_lamp[k, v, u, c]


@nb.njit(cache=True)
def _region(garments):
    """Number of the garment (4,) that is on top at a point."""
    if garments[3] > 0.0:
        return 3
    if garments[2] > 0.0:
        return 2
    if garments[0] > 0.0:
        return 0
    if garments[1] > 0.0:
        return 1
    return 4


@nb.njit(cache=True)
def _is_second(pattern, width, x, y, z):
    """Whether a point of the rest pose lies in the second color of a pattern."""
    across = int(np.floor((y + 0.3 * x) / width)) % 3 == 0
    along = int(np.floor(z / width)) % 2 == 0
    if pattern == 1:
        return across
    if pattern == 2:
        return along
    if pattern == 3:
        return across != along
    return False


@nb.njit(cache=True)
def shade(
    image, depths, inverse_depth, face, projected, faces, person_of_face, vertices, normals, rest, garments, tints, colors,
    second, patterns, pattern_m, lights, powers, ambient, views, maps, occupied, table,
):  # fmt: skip
    """Shade people over an image.

    Parameters
    ----------
    image : (h, w, 3) float32 linear RGB of a window; changed where people are.
    depths : (h, w) of the empty scene, meters.
    inverse_depth, face : of `nearest`, `SAMPLES` times as high and wide.
    projected : (n, 3) vertices in pixels of these.
    faces, person_of_face, rest, garments, tints, colors, second, patterns, pattern_m : of the crowd.
    vertices, normals : (n, 3) world.
    lights, powers, ambient : of the room.
    views, maps, occupied : of the shadow maps.
    table : of the noise.
    """
    rows, columns = depths.shape
    p, n, r, g, t, light = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(4), np.zeros(3), np.zeros(3)
    w, total = np.zeros(3), np.zeros(3)
    count = SAMPLES * SAMPLES
    for v in range(rows):
        for u in range(columns):
            covered = 0
            total[:] = 0.0
            for s in range(count):
                vs, us = v * SAMPLES + s // SAMPLES, u * SAMPLES + s % SAMPLES
                f = face[vs, us]
                if f < 0 or inverse_depth[vs, us] * depths[v, u] < 1.0:
                    continue
                covered += 1
                _weights(projected, faces[f], us, vs, w)
                p[:], n[:], r[:], g[:], t[:] = 0.0, 0.0, 0.0, 0.0, 0.0
                for k in range(3):
                    i = faces[f, k]
                    for a in range(3):
                        p[a] += w[k] * vertices[i, a]
                        n[a] += w[k] * normals[i, a]
                        r[a] += w[k] * rest[i, a]
                        t[a] += w[k] * tints[i, a]
                    for a in range(4):
                        g[a] += w[k] * garments[i, a]
                who, region = person_of_face[f], _region(g)
                tone = _fabric(region, r, n, table)
                base = colors[who, region]
                if _is_second(patterns[who, region], pattern_m[who, region], r[0], r[1], r[2]):
                    base = second[who, region]
                _light(p, n, lights, powers, ambient, views, maps, occupied, light)
                for c in range(3):
                    total[c] += base[c] * tone * light[c] * (t[c] if region == 4 else 1.0)
            if covered:
                for c in range(3):
                    image[v, u, c] = (total[c] + (count - covered) * image[v, u, c]) / count


@nb.njit(cache=True)
def _weights(projected, face, u, v, w):
    """Weights (3,) of a triangle's vertices at a pixel, right in perspective."""
    a, b, c = face[0], face[1], face[2]
    ua, va, ub, vb, uc, vc = (
        projected[a, 0], projected[a, 1], projected[b, 0], projected[b, 1], projected[c, 0], projected[c, 1]
    )  # fmt: skip
    area = (ub - ua) * (vc - va) - (vb - va) * (uc - ua)
    w[0] = ((ub - u) * (vc - v) - (vb - v) * (uc - u)) / area / projected[a, 2]
    w[1] = ((uc - u) * (va - v) - (vc - v) * (ua - u)) / area / projected[b, 2]
    w[2] = ((ua - u) * (vb - v) - (va - v) * (ub - u)) / area / projected[c, 2]
    total = w[0] + w[1] + w[2]
    for k in range(3):
        w[k] /= total


@nb.njit(cache=True)
def _fabric(region, r, n, table):
    """Brightness of a fabric at a point of the rest pose; turns the normal (3,) by small folds."""
    if region == 4:
        return 1.0 + 0.04 * noise_at(table, r[0] * 60.0, r[1] * 60.0, r[2] * 60.0)
    if region == 3:
        return 1.0 + 0.3 * noise_at(table, r[0] * 150.0, r[1] * 150.0, r[2] * 40.0)
    size = 0.3 if region < 2 else 0.08
    for a in range(3):
        n[a] += size * noise_at(table, r[0] * 34.0 + 9.0 * a, r[1] * 34.0, r[2] * 22.0 + 5.0 * a)
    return 1.0 + 0.06 * noise_at(table, r[0] * 200.0, r[1] * 200.0, r[2] * 200.0)


@nb.njit(cache=True)
def _light(p, n, lights, powers, ambient, views, maps, occupied, light):
    """Linear RGB (3,) that falls on a point with a normal."""
    length = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2) + 1e-12
    up = 0.7 + 0.3 * n[2] / length
    for c in range(3):
        light[c] = ambient[c] * up
    for k in range(len(lights)):
        x, y, z = lights[k, 0] - p[0], lights[k, 1] - p[1], lights[k, 2] - p[2]
        squared = x * x + y * y + z * z
        cosine = (n[0] * x + n[1] * y + n[2] * z) / (length * np.sqrt(squared))
        if cosine > 0.0:
            lit = cosine / max(squared, 1.0) * reaching(views[k], maps[k], occupied[k], p[0], p[1], p[2], 1, 2)
            for c in range(3):
                light[c] += powers[k, c] * lit
