"""Contour samples that are fixed to the body: on edges of boxes and meshes, and on the rims of cones' end caps.

They are drawn in two steps. A *pick* says where on which edge or rim a sample lies and what it is, as a camera sees the body
now; the sample itself (position, normal) is made from the pick, also for a body that has moved a little since. So a cost over
the same picks stays comparable while an optimizer moves the body.

Such a sample does not slide, its sliding direction is zero. For edges that is exact. On a mesh of a smooth body the contour does
slide from edge to edge, but along the line of sight, which leaves its image where it is to first order: the derivative of the
displacement across the contour is exact as well.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.kernels import compiled
from ..solids import (
    BORDER,
    CAPS,
    CREASE,
    END,
    FIRST_EDGE,
    MANNER,
    N_EDGES,
    NORMAL_0,
    NORMAL_1,
    OFFSET_0,
    OFFSET_1,
    OUTLINE,
    START,
    to_shape,
)

# Columns of a pick: edge of the table (a cap: 0 or 1, at z1 or z2), place along it (fraction; a cap: angle), side of the normal,
# whether it is a crease
SOURCE, PLACE, SIDE, IS_CREASE = range(4)
N_PICK_COLUMNS = 4

_LEAST_ON_RIM = 8  # samples all around


@compiled
def pick_edges(surfaces, shape, T, center, most, picks):
    """Spread picks evenly, as the camera sees them, over the edges of a solid that it may see.

    Parameters
    ----------
    surfaces : `ShapeArrays.surfaces`.
    shape : index of the shape.
    T : (4, 4) world from shape.
    center : (3,) of the camera, world, meters.
    most : how many picks to make.
    picks : (``most`` or more, `N_PICK_COLUMNS`), filled.

    Returns
    -------
    int : ``most``, or 0 where no edge may be seen.
    """
    ranges, edges = surfaces[0], surfaces[1]
    first, n = ranges[shape, FIRST_EDGE], ranges[shape, N_EDGES]
    ox, oy, oz, _, _, _ = to_shape(T, center, 0.0, 0.0, 0.0)
    found, lengths = np.empty(n, dtype=np.int32), np.empty(n)
    count, total = 0, 0.0
    for i in range(first, first + n):
        edge = edges[i]
        manner = int(edge[MANNER])
        if manner != BORDER:
            seen_0 = edge[NORMAL_0] * ox + edge[NORMAL_0 + 1] * oy + edge[NORMAL_0 + 2] * oz > edge[OFFSET_0]
            seen_1 = edge[NORMAL_1] * ox + edge[NORMAL_1 + 1] * oy + edge[NORMAL_1 + 2] * oz > edge[OFFSET_1]
            if seen_0 != seen_1:
                if manner & OUTLINE == 0:
                    continue
            elif not seen_0 or manner & CREASE == 0:
                continue
        ex, ey, ez = edge[END] - edge[START], edge[END + 1] - edge[START + 1], edge[END + 2] - edge[START + 2]
        sx, sy, sz = (ox - 0.5 * (edge[START] + edge[END]), oy - 0.5 * (edge[START + 1] + edge[END + 1]),
                      oz - 0.5 * (edge[START + 2] + edge[END + 2]))  # fmt: skip
        cx, cy, cz = ey * sz - ez * sy, ez * sx - ex * sz, ex * sy - ey * sx
        found[count] = i
        lengths[count] = math.sqrt(cx * cx + cy * cy + cz * cz) / (sx * sx + sy * sy + sz * sz)
        total += lengths[count]
        count += 1
    if count == 0 or total == 0.0:
        return 0
    step, passed, at = total / most, 0.0, 0
    for j in range(most):
        target = (j + 0.5) * step
        while at < count - 1 and passed + lengths[at] < target:
            passed += lengths[at]
            at += 1
        edge, pick = edges[found[at]], picks[j]
        seen_0 = edge[NORMAL_0] * ox + edge[NORMAL_0 + 1] * oy + edge[NORMAL_0 + 2] * oz > edge[OFFSET_0]
        seen_1 = edge[NORMAL_1] * ox + edge[NORMAL_1 + 1] * oy + edge[NORMAL_1 + 2] * oz > edge[OFFSET_1]
        pick[SOURCE], pick[PLACE] = found[at], min(max((target - passed) / lengths[at], 0.0), 1.0)
        pick[SIDE] = 1.0 if seen_0 else -1.0
        pick[IS_CREASE] = 1.0 if seen_0 == seen_1 and int(edge[MANNER]) != BORDER else 0.0
    return most


@compiled
def pick_caps(dims, T, center, n_samples, picks):
    """Picks on the rims of a cone's caps, as far apart as those of its lines.

    Parameters
    ----------
    dims : (5,) a, b, k, z1, z2 of the cone, as of `ShapeArrays`.
    T : (4, 4) world from shape.
    center : (3,) of the camera, world, meters.
    n_samples : samples of one generator line; a rim has at most as many.
    picks : (2 * n_samples or more, `N_PICK_COLUMNS`), filled from its first row on.

    Returns
    -------
    int : how many picks are made.
    """
    a, b, k, z1, z2 = dims[0], dims[1], dims[2], dims[3], dims[4]
    ox, oy, oz, _, _, _ = to_shape(T, center, 0.0, 0.0, 0.0)
    constant = a * b * (1.0 + k * oz)
    count = 0
    for cap in range(2):
        z = z1 if cap == 0 else z2
        disc = oz < z1 if cap == 0 else oz > z2
        around = math.pi * (a + b) * (1.0 + k * z)
        n = int(min(float(n_samples), max(float(_LEAST_ON_RIM), around * n_samples / (z2 - z1))))
        for j in range(n):
            angle = 2.0 * math.pi * (j + 0.5) / n
            side = constant - b * ox * math.cos(angle) - a * oy * math.sin(angle) < 0.0
            if not disc and not side:
                continue
            pick = picks[count]
            pick[SOURCE], pick[PLACE], pick[SIDE] = cap, angle, 1.0 if oz > z else -1.0
            pick[IS_CREASE] = 1.0 if disc and side else 0.0
            count += 1
    return count


@compiled
def _finish(T, ox, oy, oz, px, py, pz, tx, ty, tz, side, row):
    """Row of a sample at p with tangent t, both in the frame of the shape: normal across tangent and line of sight."""
    sx, sy, sz = ox - px, oy - py, oz - pz
    nx, ny, nz = side * (ty * sz - tz * sy), side * (tz * sx - tx * sz), side * (tx * sy - ty * sx)
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    for i in range(3):
        row[i] = T[i, 0] * px + T[i, 1] * py + T[i, 2] * pz + T[i, 3]
        normal = T[i, 0] * nx + T[i, 1] * ny + T[i, 2] * nz
        row[3 + i], row[6 + i], row[9 + i] = normal, 0.0, normal


@compiled
def edge_rows(surfaces, T, center, picks, n, out):
    """Contour samples (see `generators`) of the picks of a box or mesh.

    Parameters
    ----------
    surfaces : `ShapeArrays.surfaces`.
    T : (4, 4) world from shape.
    center : (3,) of the camera, world, meters.
    picks : (., `N_PICK_COLUMNS`) of `pick_edges`.
    n : how many of them are used.
    out : (., `generators.N_COLUMNS`), whose first ``n`` rows are filled.
    """
    edges = surfaces[1]
    ox, oy, oz, _, _, _ = to_shape(T, center, 0.0, 0.0, 0.0)
    for j in range(n):
        edge, part = edges[int(picks[j, SOURCE])], picks[j, PLACE]
        tx, ty, tz = edge[END] - edge[START], edge[END + 1] - edge[START + 1], edge[END + 2] - edge[START + 2]
        _finish(T, ox, oy, oz, edge[START] + part * tx, edge[START + 1] + part * ty, edge[START + 2] + part * tz, tx, ty, tz,
                picks[j, SIDE], out[j])  # fmt: skip


@compiled
def cap_rows(dims, T, center, picks, n, out):
    """Contour samples (see `generators`) of the picks of a cone.

    Parameters
    ----------
    dims : (5,) a, b, k, z1, z2 of the cone.
    T : (4, 4) world from shape.
    center : (3,) of the camera, world, meters.
    picks : (., `N_PICK_COLUMNS`) of `pick_caps`.
    n : how many of them are used.
    out : (., `generators.N_COLUMNS`), whose first ``n`` rows are filled.
    """
    ox, oy, oz, _, _, _ = to_shape(T, center, 0.0, 0.0, 0.0)
    for j in range(n):
        z = dims[3] if picks[j, SOURCE] == 0.0 else dims[4]
        scale = 1.0 + dims[2] * z
        a, b, c, s = scale * dims[0], scale * dims[1], math.cos(picks[j, PLACE]), math.sin(picks[j, PLACE])
        _finish(T, ox, oy, oz, a * c, b * s, z, -a * s, b * c, 0.0, picks[j, SIDE], out[j])


@compiled
def has_caps(surfaces, shape):
    """Whether the rims of a shape's end caps are contours.

    Parameters
    ----------
    surfaces : `ShapeArrays.surfaces`.
    shape : index of the shape.

    Returns
    -------
    bool : False for all shapes but cones.
    """
    return surfaces[0][shape, CAPS] != 0
