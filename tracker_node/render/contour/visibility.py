"""What hides a contour sample, and what lies beyond it: lines of sight against the other shapes of a body."""

from __future__ import annotations

import math

from ...compiled.kernels import compiled
from ..shape_arrays import ELLIPSOID, OTHER
from ..solids import MESH, NO_HIT, SORT, solid_hit, to_shape
from .generators import HIDDEN, INNER, NORMAL, OUTER, P
from .picks import IS_CREASE

# Columns of a view, one row per shape: the camera in the frame of the shape; the way from the camera to the middle of its
# bounding sphere (world), its square, the radius; and sine and cosine of the angle that the sphere (a tenth larger) covers
ORIGIN, AWAY, AWAY_SQ, RADIUS, SINE, COSINE = 0, 3, 6, 7, 8, 9
N_VIEW_COLUMNS = 10

_OWN_DEPTH = 1e-4  # of its radius: a part of a mesh that is nearer than that before a point of it does not hide the point
_TOLERANCE_M = 0.003  # a part that comes in less than this before a point of another does not hide it
_MARGIN = 1.1


@compiled
def view_shapes(Ts_world_shape, spheres, center, views):
    """Fill the view of every shape from a camera: what the search for shapes in the way asks for again and again.

    Parameters
    ----------
    Ts_world_shape : (n, 4, 4) world from shape.
    spheres : (n, 4) of `generators.world_spheres`.
    center : (3,) of the camera, world, meters.
    views : (n, `N_VIEW_COLUMNS`), filled.
    """
    for s in range(spheres.shape[0]):
        wx, wy, wz = (center[0] - Ts_world_shape[s, 0, 3], center[1] - Ts_world_shape[s, 1, 3],
                      center[2] - Ts_world_shape[s, 2, 3])  # fmt: skip
        square = 0.0
        for i in range(3):
            views[s, ORIGIN + i] = Ts_world_shape[s, 0, i] * wx + Ts_world_shape[s, 1, i] * wy + Ts_world_shape[s, 2, i] * wz
            views[s, AWAY + i] = spheres[s, i] - center[i]
            square += views[s, AWAY + i] ** 2
        views[s, AWAY_SQ], views[s, RADIUS] = square, spheres[s, 3]
        sine = min(1.0, _MARGIN * spheres[s, 3] / math.sqrt(square))
        views[s, SINE], views[s, COSINE] = sine, math.sqrt(1.0 - sine * sine)


@compiled
def nearby_shapes(views, shape, out):
    """Shapes whose bounding spheres overlap that of ``shape`` as the camera sees them.

    Parameters
    ----------
    views : (n, `N_VIEW_COLUMNS`) of `view_shapes`.
    shape : index of the shape.
    out : (n,) int64, filled with their indices from its start on.

    Returns
    -------
    int : how many there are.
    """
    count = 0
    for other in range(views.shape[0]):
        if other == shape:
            continue
        dot = views[shape, AWAY] * views[other, AWAY] + views[shape, AWAY + 1] * views[other, AWAY + 1]
        dot += views[shape, AWAY + 2] * views[other, AWAY + 2]
        both = views[shape, COSINE] * views[other, COSINE] - views[shape, SINE] * views[other, SINE]
        if dot > both * math.sqrt(views[shape, AWAY_SQ] * views[other, AWAY_SQ]):
            out[count] = other
            count += 1
    return count


@compiled
def interval(kind, dims, s, ox, oy, oz, ux, uy, uz):
    """Where a ray is inside a cone or ellipsoid, all in the frame of the shape.

    Parameters
    ----------
    kind : `CONE` or `ELLIPSOID`.
    dims : (n, 5) of `ShapeArrays`.
    s : index of the shape.
    ox, oy, oz : origin of the ray, meters.
    ux, uy, uz : its direction, of any length.

    Returns
    -------
    hit : whether it is inside anywhere on the whole line.
    t_in, t_out : there, in lengths of the direction from the origin.
    """
    if kind == ELLIPSOID:
        ax, ay, az = 1.0 / dims[s, 0], 1.0 / dims[s, 1], 1.0 / dims[s, 2]
        ox, oy, oz = ox * ax, oy * ay, oz * az
        ux, uy, uz = ux * ax, uy * ay, uz * az
        qa = ux * ux + uy * uy + uz * uz
        qb = ox * ux + oy * uy + oz * uz
        qc = ox * ox + oy * oy + oz * oz - 1.0
        disc = qb * qb - qa * qc
        if disc <= 0.0:
            return False, 0.0, 0.0
        root = math.sqrt(disc)
        return True, (-qb - root) / qa, (-qb + root) / qa
    k, z1, z2 = dims[s, 2], dims[s, 3], dims[s, 4]
    # (x/a)^2 + (y/b)^2 <= (1 + k z)^2
    ax, ay = 1.0 / dims[s, 0], 1.0 / dims[s, 1]
    px, py, vx, vy = ox * ax, oy * ay, ux * ax, uy * ay
    w, wd = 1.0 + k * oz, k * uz
    qa = vx * vx + vy * vy - wd * wd
    qb = px * vx + py * vy - w * wd
    qc = px * px + py * py - w * w
    disc = qb * qb - qa * qc
    if qa > 1e-14 and disc <= 0.0:
        return False, 0.0, 0.0
    # Slab z1..z2
    if abs(uz) < 1e-12:
        if oz < z1 or oz > z2:
            return False, 0.0, 0.0
        t_in, t_out = -1e30, 1e30
    else:
        t_in, t_out = (z1 - oz) / uz, (z2 - oz) / uz
        if t_in > t_out:
            t_in, t_out = t_out, t_in
    if abs(qa) < 1e-14:
        if abs(qb) < 1e-14:
            return (qc < 0.0) and (t_in < t_out), t_in, t_out
        t = -0.5 * qc / qb
        if qb > 0.0:
            t_out = min(t_out, t)
        else:
            t_in = max(t_in, t)
        return t_in < t_out, t_in, t_out
    if qa > 0.0:
        root = math.sqrt(disc)
        t_in, t_out = max(t_in, (-qb - root) / qa), min(t_out, (-qb + root) / qa)
        return t_in < t_out, t_in, t_out
    # The ray is steeper than the cone: inside the double cone outside the two roots; keep the nappe of the slab
    if disc <= 0.0:
        return t_in < t_out, t_in, t_out
    root = math.sqrt(disc)
    lo, hi = (-qb + root) / qa, (-qb - root) / qa
    middle = 0.5 * (t_in + t_out)
    if middle < 0.5 * (lo + hi):
        t_out = min(t_out, lo)
    else:
        t_in = max(t_in, hi)
    return t_in < t_out, t_in, t_out


@compiled
def ray_interval(shapes, s, T, center, dx, dy, dz):
    """Where a ray of the world is inside a shape of any kind.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    s : index of the shape.
    T : (4, 4) world from shape.
    center : (3,) origin of the ray, world, meters.
    dx, dy, dz : its direction, of any length.

    Returns
    -------
    hit, t_in, t_out : as of `interval`; of a box or mesh the first point after the camera, and no end (`NO_HIT`).
    """
    if shapes[0][s] == OTHER:
        t = solid_hit(shapes[3], s, T, center, dx, dy, dz, NO_HIT, False)
        return t < NO_HIT, t, NO_HIT
    ox, oy, oz, ux, uy, uz = to_shape(T, center, dx, dy, dz)
    return interval(shapes[0][s], shapes[1], s, ox, oy, oz, ux, uy, uz)


@compiled
def classify_samples(shapes, views, shape, Ts, nearby, n_nearby, center, rows, count, picks, n_picks, outwards, classes, beyonds):
    """Decide which contour samples of a shape are seen, and what lies beyond them.

    `HIDDEN`: another part (or another side of the same) is in front of the point, or encloses it; also where ``outwards`` is
    negative. `OUTER`: just outside the contour the line of sight meets no part: the point belongs to the outline of the whole
    body. `INNER`: it meets one. A crease is inner, with its own shape beyond.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    views : of `view_shapes`.
    shape : index of the shape.
    Ts : (n_shapes, 4, 4) world from shape.
    nearby, n_nearby : of `nearby_shapes`.
    center : (3,) of the camera, world, meters.
    rows, count : (., `N_COLUMNS`) contour samples, and how many of them are used.
    picks, n_picks : the first ``n_picks`` samples are of these picks.
    outwards : (.,) meters along the normal to where it is decided what lies beyond.
    classes : (.,) filled with the class of each sample.
    beyonds : (.,) filled with the index of the shape that is nearest beyond it, -1 where there is none.
    """
    kinds, dims, surfaces = shapes[0], shapes[1], shapes[3]
    may_hide_itself = kinds[shape] == OTHER and surfaces[0][shape, SORT] == MESH
    for i in range(count):
        outward, crease = outwards[i], i < n_picks and picks[i, IS_CREASE] != 0.0
        classes[i], beyonds[i] = HIDDEN, -1
        if outward < 0.0:
            continue
        dx, dy, dz = rows[i, P] - center[0], rows[i, P + 1] - center[1], rows[i, P + 2] - center[2]
        nx, ny, nz = outward * rows[i, NORMAL], outward * rows[i, NORMAL + 1], outward * rows[i, NORMAL + 2]
        length_sq = dx * dx + dy * dy + dz * dz
        length = math.sqrt(length_sq)
        tolerance = _TOLERANCE_M / length
        hidden, beyond, nearest = False, -1, NO_HIT
        if may_hide_itself:
            own = 1.0 - _OWN_DEPTH * views[shape, RADIUS] / length
            hidden = solid_hit(surfaces, shape, Ts[shape], center, dx, dy, dz, own, True) < own
            if not crease and not hidden:
                nearest = solid_hit(surfaces, shape, Ts[shape], center, dx + nx, dy + ny, dz + nz, NO_HIT, False)
                beyond = shape if nearest < NO_HIT else -1
        for j in range(n_nearby):
            if hidden:
                break
            s = nearby[j]
            dot = views[s, AWAY] * dx + views[s, AWAY + 1] * dy + views[s, AWAY + 2] * dz
            radius = views[s, RADIUS] + 2.0 * outward
            if (views[s, AWAY_SQ] - radius * radius) * length_sq >= dot * dot:
                continue
            if kinds[s] == OTHER:
                hidden = solid_hit(surfaces, s, Ts[s], center, dx, dy, dz, 1.0 - tolerance, True) < NO_HIT
                if not hidden and not crease:
                    t_in = solid_hit(surfaces, s, Ts[s], center, dx + nx, dy + ny, dz + nz, NO_HIT, False)
                    if t_in < nearest:
                        beyond, nearest = s, t_in
                continue
            ox, oy, oz = views[s, ORIGIN], views[s, ORIGIN + 1], views[s, ORIGIN + 2]
            ux = Ts[s, 0, 0] * dx + Ts[s, 1, 0] * dy + Ts[s, 2, 0] * dz
            uy = Ts[s, 0, 1] * dx + Ts[s, 1, 1] * dy + Ts[s, 2, 1] * dz
            uz = Ts[s, 0, 2] * dx + Ts[s, 1, 2] * dy + Ts[s, 2, 2] * dz
            hit, t_in, t_out = interval(kinds[s], dims, s, ox, oy, oz, ux, uy, uz)
            hidden = hit and t_out > tolerance and t_in < 1.0 - tolerance
            if hidden or crease:
                continue
            ux += Ts[s, 0, 0] * nx + Ts[s, 1, 0] * ny + Ts[s, 2, 0] * nz
            uy += Ts[s, 0, 1] * nx + Ts[s, 1, 1] * ny + Ts[s, 2, 1] * nz
            uz += Ts[s, 0, 2] * nx + Ts[s, 1, 2] * ny + Ts[s, 2, 2] * nz
            hit, t_in, t_out = interval(kinds[s], dims, s, ox, oy, oz, ux, uy, uz)
            if hit and t_out > 0.0 and t_in < nearest:
                beyond, nearest = s, t_in
        if not hidden:
            beyonds[i] = shape if crease else beyond
            classes[i] = OUTER if beyonds[i] < 0 else INNER
