"""Contour residuals of one camera, linearized: distances of predicted contour samples in the evidence maps.

Each sample gives one residual r (pixels), read from distance maps by bilinear interpolation, with the analytic
derivative (Knossow et al., eqs 7-11, corrected for a spatial twist)

    r_D_twist = h^T (A + B),   h = (map gradient) J_I R_cam_world,

accumulated per link as 6x6 normal matrices, because all samples of a link share its kinematic Jacobian.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import compiled
from ..render.contour.generators import HIDDEN, N_COLUMNS, OUTER, SAMPLES, SLIDE, M, P, draw_contour
from ..render.contour.samples import JACOBIAN, N_PIXEL_COLUMNS, NU, NV, U, V, project_samples
from ..render.contour.visibility import N_VIEW_COLUMNS, classify_samples, nearby_shapes, view_shapes

# Indices of the option array
ROBUST_SCALE, SLIDING, DISTANCES, OUTWARD_PX, INNER_WEIGHT, ALIGNMENT, BOUNDARY_WEIGHT, BOUNDARY_SCALE, REACH = range(9)
N_OPTIONS = 9
# What a sample reads: values of the option DISTANCES
KINDS = ("split", "sum", "silhouette", "edges")
SPLIT, SUM, SILHOUETTE, EDGES = range(len(KINDS))
# Indices of the statistics array
COST, SQUARES, COUNT, WEIGHT, N_CANDIDATES, N_UNEXPLAINED = range(6)
N_STATISTICS = 6
N_SAMPLE_COLUMNS = 11  # of an outline sample: u, v, nu, nv, link, twist row (6)
_BLOCK = 64  # outline samples that are compared together


@compiled
def bilinear(image, u, v):
    """A float32 map between its pixels.

    Parameters
    ----------
    image : (h, w); NaN is not inside it.
    u, v : column and row, in its own pixels.

    Returns
    -------
    Whether it is inside, value, derivative by u, derivative by v.
    """
    x, y = math.floor(u), math.floor(v)
    i, j = int(y), int(x)
    if i < 0 or j < 0 or i + 1 >= image.shape[0] or j + 1 >= image.shape[1]:
        return False, 0.0, 0.0, 0.0
    a, b = u - x, v - y
    f00, f01 = np.float64(image[i, j]), np.float64(image[i, j + 1])
    f10, f11 = np.float64(image[i + 1, j]), np.float64(image[i + 1, j + 1])
    top, bottom = f00 + a * (f01 - f00), f10 + a * (f11 - f10)
    value = top + b * (bottom - top)
    return value == value, value, (1 - b) * (f01 - f00) + b * (f11 - f10), bottom - top


@compiled
def _read_maps(silhouette, edges, u, v, nu, nv, outer, options):
    """Residual of a sample: (usable, r, r_u, r_v, weight).

    The paper's sum takes the distance outside the silhouette plus the distance to the nearest edge for every sample; `SILHOUETTE`
    and `EDGES` take one of the two. The split form reads the *signed* silhouette distance for samples of the body's outline
    (its sign says which way to go from far off), and the edges for contours within the body; a boundary that does not lie
    across the sample's normal (nu, nv) is another part's, and is not used.
    """
    ok, value, gu, gv = bilinear(silhouette, u, v)
    if not ok:
        return False, 0.0, 0.0, 0.0, 0.0
    kind = int(options[DISTANCES])
    if kind != SPLIT:
        ok, edge, eu, ev = bilinear(edges, u, v)
        if value <= 0.0 or kind == EDGES:
            value, gu, gv = 0.0, 0.0, 0.0
        if kind == SILHOUETTE:
            edge, eu, ev = 0.0, 0.0, 0.0
        return ok, value + edge, gu + eu, gv + ev, 1.0
    weight = 1.0
    if not outer:
        weight = options[INNER_WEIGHT]
        if weight <= 0.0:
            return False, 0.0, 0.0, 0.0, 0.0
        ok, value, gu, gv = bilinear(edges, u, v)
        if not ok:
            return False, 0.0, 0.0, 0.0, 0.0
    slope = math.sqrt(gu * gu + gv * gv)
    if slope < 0.2:  # beyond the truncation, or on a ridge between two boundaries
        return False, 0.0, 0.0, 0.0, 0.0
    along = (gu * nu + gv * nv) / slope
    if not outer:
        along = abs(along)
    if along < options[ALIGNMENT]:
        return False, 0.0, 0.0, 0.0, 0.0
    return True, value, gu, gv, weight


@compiled
def read_samples(silhouette, edges, samples, outer, options):
    """Residuals of samples, as in `linearize_camera`.

    Parameters
    ----------
    silhouette, edges : distances (h, w).
    samples : (n, 4) u, v in their pixels, and the normal nu, nv.
    outer : (n,) mask, of the body's outline.
    options : (`N_OPTIONS`,).

    Returns
    -------
    (n, 5) 1 where there is one, else 0; residual; its derivatives by u and v; weight.
    """
    found = np.empty((len(samples), 5))
    for j in range(len(samples)):
        u, v, nu, nv = samples[j]
        found[j, 0], found[j, 1], found[j, 2], found[j, 3], found[j, 4] = _read_maps(
            silhouette, edges, u, v, nu, nv, outer[j], options
        )
    return found


@compiled
def _twist_row(row, R, center, jacobian, gu, gv, sliding, g):
    """Fill ``g`` (6,) with the derivative by the twist of gu * u + gv * v of a contour sample."""
    hx = gu * jacobian[0] + gv * jacobian[3]
    hy = gu * jacobian[1] + gv * jacobian[4]
    hz = gu * jacobian[2] + gv * jacobian[5]
    h0 = R[0, 0] * hx + R[1, 0] * hy + R[2, 0] * hz
    h1 = R[0, 1] * hx + R[1, 1] * hy + R[2, 1] * hz
    h2 = R[0, 2] * hx + R[1, 2] * hy + R[2, 2] * hz
    g[0], g[1], g[2] = h0, h1, h2
    g[3] = row[P + 1] * h2 - row[P + 2] * h1
    g[4] = row[P + 2] * h0 - row[P] * h2
    g[5] = row[P] * h1 - row[P + 1] * h0
    if sliding:
        slide = h0 * row[SLIDE] + h1 * row[SLIDE + 1] + h2 * row[SLIDE + 2]
        m0, m1, m2 = slide * row[M], slide * row[M + 1], slide * row[M + 2]
        g[0] += m0
        g[1] += m1
        g[2] += m2
        g[3] += center[1] * m2 - center[2] * m1
        g[4] += center[2] * m0 - center[0] * m2
        g[5] += center[0] * m1 - center[1] * m0


@compiled
def _add(g, r, weight, scale_sq, normal, gradient, stats):
    """Add one residual with the Geman-McClure kernel: cost s^2 r^2 / (s^2 + r^2), weight (s^2 / (s^2 + r^2))^2."""
    ratio = scale_sq / (scale_sq + r * r)
    w = weight * ratio * ratio
    for a in range(6):
        wa = w * g[a]
        gradient[a] += wa * r
        for b in range(a, 6):
            normal[a, b] += wa * g[b]
    stats[COST] += weight * ratio * r * r
    return w


@compiled
def columns_of(samples, n_samples):
    """Places and normals of samples as float32 columns, filled up to whole blocks with samples that are never nearest.

    Parameters
    ----------
    samples, n_samples : (., `N_SAMPLE_COLUMNS`), and how many rows count.

    Returns
    -------
    (4, n) u, v, nu, nv.
    """
    n_blocks = (n_samples + _BLOCK - 1) // _BLOCK
    columns = np.full((4, n_blocks * _BLOCK), np.float32(1e9))
    for j in range(n_samples):
        for c in range(4):
            columns[c, j] = samples[j, c]
    return columns


@compiled
def nearest_sample(us, vs, nus, nvs, point, alignment, reach_sq, squares):
    """The first sample nearest to a point whose normal is aligned with the point's own.

    Squared distances are kept as the bits of their float32, which order alike: only integers have a vectorized minimum.

    Parameters
    ----------
    us, vs, nus, nvs : (n,) of `columns_of`.
    point : (u, v, nu, nv).
    alignment : least cosine between the normals.
    reach_sq : squared distance, pixels^2, beyond which nothing is near.
    squares : (n,) int32, overwritten.

    Returns
    -------
    Its index; -1 where none is within reach.
    """
    u, v, nu, nv = point[0], point[1], point[2], point[3]
    least, far = np.float32(alignment), np.int32(0x7F000000)
    for j in range(np.uint64(us.size)):
        du, dv = us[j] - u, vs[j] - v
        square = np.float32(du * du + dv * dv).view(np.int32)
        squares[j] = square if nus[j] * nu + nvs[j] * nv > least else far
    best, block = np.float32(reach_sq).view(np.int32), -1
    for start in range(0, us.size, _BLOCK):
        part = squares[start : start + _BLOCK]
        lowest = far
        for k in range(np.uint64(_BLOCK)):
            lowest = part[k] if part[k] < lowest else lowest
        if lowest < best:
            best, block = lowest, start
    if block < 0:
        return -1
    for j in range(block, block + _BLOCK):
        if squares[j] == best:
            return j
    return -1


@compiled
def _attract_to_boundary(boundary, samples, n_samples, options, normal, gradient, stats):
    """Residuals of the other direction: each boundary point of the silhouette attracts the nearest outline sample.

    ``boundary`` (n, 4) float32: u, v and outward normal on the crop. ``samples`` rows: u, v, nu, nv, link, twist row of the
    normal displacement (6). Point to line: r = n . (sample - point).
    """
    reach_sq, scale_sq = np.float32(options[REACH] ** 2), options[BOUNDARY_SCALE] ** 2
    columns = columns_of(samples, n_samples)
    us, vs, nus, nvs = columns[0], columns[1], columns[2], columns[3]
    squares = np.empty(columns.shape[1], dtype=np.int32)
    for i in range(boundary.shape[0]):
        nearest = nearest_sample(us, vs, nus, nvs, boundary[i], options[ALIGNMENT], reach_sq, squares)
        if nearest < 0:
            stats[N_UNEXPLAINED] += 1.0
            continue
        row = samples[nearest]
        r = row[2] * (row[0] - boundary[i, 0]) + row[3] * (row[1] - boundary[i, 1])
        link = int(row[4])
        _add(row[5:11], r, options[BOUNDARY_WEIGHT], scale_sq, normal[link], gradient[link], stats)


@compiled
def linearize_camera(shapes, Ts, spheres, camera, maps, options, n_samples, refresh, work):
    """Add one camera's contour residuals to per-link normal matrices.

    Parameters
    ----------
    shapes : `ShapeArrays.packed`.
    Ts, spheres : (n_shapes, 4, 4) to the world, and (n_shapes, 4) bounding spheres there.
    camera : (params, R_cam_world, t_cam_world, center).
    maps : (silhouette, edges, origin, boundary).
    options : (`N_OPTIONS`,).
    n_samples : on a generator line.
    refresh : whether ``flags`` (n_shapes, `SAMPLES` * n_samples), each sample's class, and the picks of `draw_contour` are
        decided anew; else they are used as they are.
    work : (flags, picks, n_picks, samples, normal, gradient, stats); ``normal`` (n_links, 6, 6), ``gradient`` (n_links, 6) and
        ``stats`` (`N_STATISTICS`,) are overwritten.
    """
    links = shapes[2]
    params, R, t, center = camera
    silhouette, edges, origin, boundary = maps
    flags, picks, n_picks, samples, normal, gradient, stats = work
    normal[:] = 0.0
    gradient[:] = 0.0
    stats[:] = 0.0
    most, g = SAMPLES * n_samples, np.empty(6)
    rows, pixels = np.empty((most, N_COLUMNS)), np.empty((most, N_PIXEL_COLUMNS))
    outwards, beyonds, nearby = np.empty(most), np.empty(most, dtype=np.int64), np.empty(links.size, dtype=np.int64)
    sliding, scale_sq, pulls = options[SLIDING] > 0.5, options[ROBUST_SCALE] ** 2, options[BOUNDARY_WEIGHT] > 0.0
    n_outline = np.int64(0)  # as 0, its value would be part of a type
    views = np.empty((links.size if refresh else 0, N_VIEW_COLUMNS))
    if refresh:
        flags[:] = HIDDEN
        view_shapes(Ts, spheres, center, views)
    for shape in range(links.size):
        count = draw_contour(shapes, shape, Ts[shape], center, n_samples, refresh, picks[shape], n_picks, rows)
        n_nearby = nearby_shapes(views, shape, nearby) if refresh and count > 0 else 0
        link = links[shape]
        project_samples(params, R, t, rows, count, options[OUTWARD_PX], pixels, outwards)
        if refresh:
            classify_samples(
                shapes, views, shape, Ts, nearby, n_nearby, center, rows, count, picks[shape], n_picks[shape], outwards,
                flags[shape], beyonds,
            )  # fmt: skip
        for j in range(count):
            if outwards[j] < 0.0 or flags[shape, j] == HIDDEN:
                continue
            row, jacobian = rows[j], pixels[j, JACOBIAN:]
            u, v, nu, nv = pixels[j, U], pixels[j, V], pixels[j, NU], pixels[j, NV]
            stats[N_CANDIDATES] += 1.0
            outer = flags[shape, j] == OUTER
            if outer and pulls:
                sample = samples[n_outline]
                sample[0], sample[1], sample[2], sample[3], sample[4] = u - origin[0], v - origin[1], nu, nv, link
                _twist_row(row, R, center, jacobian, nu, nv, sliding, sample[5:11])
                n_outline += 1
            ok, r, gu, gv, weight = _read_maps(silhouette, edges, u - origin[0], v - origin[1], nu, nv, outer, options)
            if not ok:
                continue
            _twist_row(row, R, center, jacobian, gu, gv, sliding, g)
            w = _add(g, r, weight, scale_sq, normal[link], gradient[link], stats)
            stats[SQUARES] += w * r * r
            stats[WEIGHT] += w
            stats[COUNT] += 1.0
    if pulls:
        _attract_to_boundary(boundary, samples, n_outline, options, normal, gradient, stats)
    for link in range(normal.shape[0]):
        for a in range(6):
            for b in range(a):
                normal[link, a, b] = normal[link, b, a]


@compiled
def sum_of_cameras(normal, gradient, cameras):
    """Normal matrices of links, summed over some cameras.

    Parameters
    ----------
    normal, gradient : (n_cameras, n_links, 6, 6) and (n_cameras, n_links, 6).
    cameras : (n,) indices of them.

    Returns
    -------
    (n_links, 6, 6) and (n_links, 6).
    """
    total, pull = np.zeros(normal.shape[1:]), np.zeros(gradient.shape[1:])
    for i in cameras:
        for link in range(normal.shape[1]):
            for a in range(6):
                pull[link, a] += gradient[i, link, a]
                for b in range(6):
                    total[link, a, b] += normal[i, link, a, b]
    return total, pull


@compiled
def assemble(link_normal, link_gradient, moved_by, twists, H, g):
    """Add J^T N J and J^T g of all links, J the twists of the degrees of freedom that move the link.

    Parameters
    ----------
    link_normal, link_gradient : N (n_links, 6, 6) and g (n_links, 6), about twists (v, omega) at the world's origin.
    moved_by, twists : (n_links, n_dof) mask, and (n_dof, 6).
    H, g : (n_dof, n_dof) symmetric, and (n_dof,), added to.
    """
    n = twists.shape[0]
    product = np.empty((n, 6))
    for link in range(link_normal.shape[0]):
        trace = 0.0
        for a in range(6):
            trace += link_normal[link, a, a]
        if trace == 0.0:
            continue
        for i in range(n):
            if not moved_by[link, i]:
                continue
            value = 0.0
            for a in range(6):
                value += twists[i, a] * link_gradient[link, a]
                total = 0.0
                for b in range(6):
                    total += link_normal[link, a, b] * twists[i, b]
                product[i, a] = total
            g[i] += value
        for i in range(n):
            if not moved_by[link, i]:
                continue
            for j in range(i, n):
                if moved_by[link, j]:
                    total = 0.0
                    for a in range(6):
                        total += twists[i, a] * product[j, a]
                    H[i, j] += total
    for i in range(n):
        for j in range(i):
            H[i, j] = H[j, i]
