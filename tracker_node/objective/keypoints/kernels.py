"""Detected points of all cameras against the landmarks of a body, each with an unknown offset in its link.

Of a landmark k at p + o in the frame of its link, o of mean m and covariance P, camera c sees z with the covariance S, or, with a
small probability, anything at all in its image:

    cost = min over o of  sum_c -2 log((1 - q) exp(-e S^-1 e / 2) + q r) + (o - m) P^-1 (o - m),    e = projection(T (p + o)) - z

q is the probability of an outlier and r its density, as a fraction of the other's at e = 0. The minimum's derivative by the state
is that at a fixed o. With the information A of all cameras about the point, what they say of the state is worth (A^-1 + P)^-1:
however many there are, the offset stays unknown.
"""

from __future__ import annotations

import math

import numpy as np

from ...camera.model import project_point
from ...compiled.kernels import compiled

U, V, S_UU, S_UV, S_VV, OUTLIER, SCORE, N_COLUMNS = range(8)
"""Of one point in one camera: pixel, inverse covariance (px^-2), odds q r / (1 - q) of an outlier at no distance, score."""
_MOST_ROUNDS = 12
_SETTLED_M = 1e-7


@compiled
def _solve3(A, b, x):
    """x of A x = b, A symmetric and positive definite (3, 3)."""
    a, d, e = A[0, 0], A[0, 1], A[0, 2]
    c, f, g = A[1, 1], A[1, 2], A[2, 2]
    m00, m01, m02 = c * g - f * f, e * f - d * g, d * f - c * e
    m11, m12, m22 = a * g - e * e, d * e - a * f, a * c - d * d
    scale = 1.0 / (a * m00 + d * m01 + e * m02)
    x[0] = scale * (m00 * b[0] + m01 * b[1] + m02 * b[2])
    x[1] = scale * (m01 * b[0] + m11 * b[1] + m12 * b[2])
    x[2] = scale * (m02 * b[0] + m12 * b[1] + m22 * b[2])


@compiled
def places_of(Ts_link, links, positions):
    """Where points are that links carry.

    Parameters
    ----------
    Ts_link : (n_links, 4, 4), to the world.
    links, positions : (n,), and (n, 3) meters in the frames of these links.

    Returns
    -------
    (n, 3) meters, world.
    """
    places = np.empty((links.size, 3))
    for k in range(links.size):
        T, p = Ts_link[links[k]], positions[k]
        for a in range(3):
            places[k, a] = T[a, 0] * p[0] + T[a, 1] * p[1] + T[a, 2] * p[2] + T[a, 3]
    return places


@compiled
def look(point, observed, params, R, t, sharpness, information, pull):
    """One camera's cost of a point in the world, with its information (3, 3) and pull (3,), overwritten.

    Parameters
    ----------
    point : (3,) meters, world.
    observed : (`N_COLUMNS`,); one without information has been seen by nobody.
    params, R, t : the camera's constants.
    sharpness : factor of the information.
    information, pull : sum of squares' second and half first derivative by ``point``.

    Returns
    -------
    cost, weight (probability that it is no outlier), and the squared residual over its variance; -1 where it is not seen.
    """
    information[:], pull[:] = 0.0, 0.0
    if observed[S_UU] <= 0.0:
        return 0.0, -1.0, 0.0
    x = R[0, 0] * point[0] + R[0, 1] * point[1] + R[0, 2] * point[2] + t[0]
    y = R[1, 0] * point[0] + R[1, 1] * point[1] + R[1, 2] * point[2] + t[1]
    z = R[2, 0] * point[0] + R[2, 1] * point[1] + R[2, 2] * point[2] + t[2]
    ok, u, v, u_x, u_y, u_z, v_x, v_y, v_z = project_point(params, x, y, z)
    if not ok:
        return 0.0, -1.0, 0.0
    du, dv = u - observed[U], v - observed[V]
    a, b, c = sharpness * observed[S_UU], sharpness * observed[S_UV], sharpness * observed[S_VV]
    fu, fv = a * du + b * dv, b * du + c * dv
    square = du * fu + dv * fv
    odds, near = sharpness * observed[OUTLIER], math.exp(-0.5 * square)
    weight = near / (near + odds)
    cost = -2.0 * math.log((near + odds) / (1.0 + odds))
    for j in range(3):
        J_u = u_x * R[0, j] + u_y * R[1, j] + u_z * R[2, j]
        J_v = v_x * R[0, j] + v_y * R[1, j] + v_z * R[2, j]
        pull[j] = weight * (J_u * fu + J_v * fv)
        for k in range(3):
            K_u = u_x * R[0, k] + u_y * R[1, k] + u_z * R[2, k]
            K_v = v_x * R[0, k] + v_y * R[1, k] + v_z * R[2, k]
            information[j, k] = weight * (J_u * (a * K_u + b * K_v) + J_v * (b * K_u + c * K_v))
    return cost, weight, square


@compiled
def compare_points(observed, cameras, T, position, mean, prior, sharpness, offset, information, pull, weights, squares):
    """A landmark in all cameras, at the offset that suits them best.

    Parameters
    ----------
    observed : (n_cameras, `N_COLUMNS`).
    cameras : params (n_cameras, n), R (n_cameras, 3, 3), t (n_cameras, 3).
    T : (4, 4) of its link in the world.
    position, mean, prior : (3,), (3,), (3, 3): place in the link, its offset's mean and inverse covariance.
    sharpness : factor of what the cameras say.
    offset : (3,) overwritten with the best.
    information, pull : (n_cameras, 3, 3) and (n_cameras, 3) in world axes, there.
    weights, squares : (n_cameras,) see `look`.

    Returns
    -------
    The cost.
    """
    params, R, t = cameras
    n = observed.shape[0]
    point, A, b, step, turned = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    offset[:] = mean
    cost = 0.0
    for _ in range(_MOST_ROUNDS):
        for j in range(3):
            point[j] = T[j, 3]
            for k in range(3):
                point[j] += T[j, k] * (position[k] + offset[k])
        cost, total, total_pull = 0.0, np.zeros((3, 3)), np.zeros(3)
        for c in range(n):
            own, weights[c], squares[c] = look(point, observed[c], params[c], R[c], t[c], sharpness, information[c], pull[c])
            cost += own
            total += information[c]
            total_pull += pull[c]
        # In the axes of the link, with the offset's own prior
        for j in range(3):
            b[j] = 0.0
            for k in range(3):
                b[j] += T[k, j] * total_pull[k] + prior[j, k] * (offset[k] - mean[k])
                turned[k] = total[k, 0] * T[0, j] + total[k, 1] * T[1, j] + total[k, 2] * T[2, j]
            for k in range(3):
                A[k, j] = prior[k, j] + T[0, k] * turned[0] + T[1, k] * turned[1] + T[2, k] * turned[2]
        for j in range(3):
            for k in range(3):
                cost += (offset[j] - mean[j]) * prior[j, k] * (offset[k] - mean[k])
        _solve3(A, b, step)
        if step[0] * step[0] + step[1] * step[1] + step[2] * step[2] < _SETTLED_M * _SETTLED_M:
            break
        offset -= step
    return cost


@compiled
def known_through_offset(information, T, prior, result):
    """What is known of a point whose offset is not: (A^-1 + P)^-1.

    Parameters
    ----------
    information : A (3, 3), of the cameras about the point, world.
    T : (4, 4) of its link in the world.
    prior : P^-1 (3, 3), inverse covariance of the offset in the axes of the link.
    result : (3, 3) world, overwritten.
    """
    R = np.ascontiguousarray(T[:3, :3])
    P = R @ np.ascontiguousarray(prior) @ R.T
    total, column, half = information + P, np.empty(3), np.empty((3, 3))
    for j in range(3):  # A (A + P^-1)^-1 P^-1, in which nothing cancels
        _solve3(total, P[:, j].copy(), column)
        for k in range(3):
            half[k, j] = information[k, 0] * column[0] + information[k, 1] * column[1] + information[k, 2] * column[2]
    for j in range(3):
        for k in range(3):
            result[j, k] = 0.5 * (half[j, k] + half[k, j])


@compiled
def add_twist(A, b, point, normal, gradient):
    """Add what is known of a point to the equations of its link's spatial twist.

    Parameters
    ----------
    A, b : (3, 3) information and (3,) pull about the point, world.
    point : (3,) meters, world.
    normal, gradient : (6, 6) and (6,) of the twist (v, omega) at the world's origin, added to.
    """
    G = np.zeros((3, 6))
    G[0, 0], G[1, 1], G[2, 2] = 1.0, 1.0, 1.0
    G[0, 4], G[0, 5] = point[2], -point[1]
    G[1, 3], G[1, 5] = -point[2], point[0]
    G[2, 3], G[2, 4] = point[1], -point[0]
    AG = A @ G
    for i in range(6):
        for k in range(3):
            gradient[i] += G[k, i] * b[k]
        for j in range(6):
            for k in range(3):
                normal[i, j] += G[k, i] * AG[k, j]


@compiled
def sum_points(observed, cameras, Ts, links, positions, means, priors, sharpness, sums, by_point):
    """All landmarks, summed by link.

    Parameters
    ----------
    observed : (n_points, n_cameras, `N_COLUMNS`).
    cameras : see `compare_points`.
    Ts : (n_links, 4, 4).
    links, positions, means, priors : (n_points,), (n_points, 3), (n_points, 3), (n_points, 3, 3).
    sharpness : factor of what the cameras say.
    sums : normal (n_links, 6, 6) and gradient (n_links, 6) of all cameras, and normal (n_cameras, n_links, 6, 6) and gradient
        (n_cameras, n_links, 6) of each at the best offsets; added to.
    by_point : offsets (n_points, 3), information (n_points, 3, 3) in the axes of the link, weights and squares
        (n_points, n_cameras); overwritten.

    Returns
    -------
    The cost, and the number of points in cameras.
    """
    normal, gradient, camera_normal, camera_gradient = sums
    offsets, informations, weights, squares = by_point
    n_cameras = observed.shape[1]
    information, pull = np.empty((n_cameras, 3, 3)), np.empty((n_cameras, 3))
    known, point = np.empty((3, 3)), np.empty(3)
    cost, count = 0.0, 0
    for k in range(observed.shape[0]):
        T = Ts[links[k]]
        cost += compare_points(
            observed[k], cameras, T, positions[k], means[k], priors[k], sharpness, offsets[k], information, pull, weights[k],
            squares[k],
        )  # fmt: skip
        total, total_pull = np.zeros((3, 3)), np.zeros(3)
        for j in range(3):
            point[j] = T[j, 3]
            for m in range(3):
                point[j] += T[j, m] * (positions[k, m] + offsets[k, m])
        for c in range(n_cameras):
            if weights[k, c] >= 0.0:
                count += 1
                total += information[c]
                total_pull += pull[c]
                add_twist(information[c], pull[c], point, camera_normal[c, links[k]], camera_gradient[c, links[k]])
        R = np.ascontiguousarray(T[:3, :3])
        informations[k] = R.T @ total @ R
        known_through_offset(total, T, priors[k], known)
        add_twist(known, total_pull, point, normal[links[k]], gradient[links[k]])
    return cost, count


_WILD = 0.05  # density of a guess that is anything, in that of one that is right
_FARTHEST = 400.0  # of squares, beyond which a guess is wrong however far it is off


@compiled
def add_depths(
    bones, shares, depths, sigmas, distances, distance_sigmas, centers, rays, weight, sharpness, places, links, moved_by, twists,
    H, g,
):  # fmt: skip
    """Add guesses of how far a body and the ends of its bones are along the rays of cameras to normal equations.

    Parameters
    ----------
    bones, shares, depths, sigmas, distances, distance_sigmas, centers, rays, weight : of `GuessedDepths`.
    sharpness : factor of the squares.
    places, links : (n_points, 3) meters, world, and (n_points,) the links that carry the points.
    moved_by, twists : (n_links, n_dof) mask, and (n_dof, 6).
    H, g : (n_dof, n_dof) and (n_dof,), added to.

    Returns
    -------
    float : their cost.
    """
    (n_bones, n_points), n, cost, odds = bones.shape, twists.shape[0], 0.0, sharpness * _WILD
    along, lead, S, pull, pushed = np.empty(3), np.empty((3, n)), np.empty((3, 3)), np.empty(3), np.empty(3)
    for bone in range(n_bones + 1):  # the last is the middle of the points, from the camera
        along[:], lead[:], S[:], pull[:] = 0.0, 0.0, 0.0, 0.0
        for k in range(n_points):
            factor = bones[bone, k] if bone < n_bones else 1.0 / n_points
            if factor == 0.0:
                continue
            x, y, z = places[k, 0], places[k, 1], places[k, 2]
            along[0], along[1], along[2] = along[0] + factor * x, along[1] + factor * y, along[2] + factor * z
            for i in range(n):
                if moved_by[links[k], i]:
                    t = twists[i]
                    lead[0, i] += factor * (t[0] + t[4] * z - t[5] * y)
                    lead[1, i] += factor * (t[1] + t[5] * x - t[3] * z)
                    lead[2, i] += factor * (t[2] + t[3] * y - t[4] * x)
        for c in range(len(rays)):
            e = 0.0
            for a in range(3):
                e += rays[c, a] * (along[a] if bone < n_bones else along[a] - centers[c, a])
            scale = shares[bone] / sigmas[bone] if bone < n_bones else 1.0 / distance_sigmas[c]
            e = scale * e - (depths[c, bone] / sigmas[bone] if bone < n_bones else distances[c] * scale)
            if not np.isfinite(e):
                continue
            near = math.exp(-0.5 * sharpness * min(e * e, _FARTHEST))
            w = sharpness * weight * near / (near + odds)
            cost -= 2.0 * weight * math.log((near + odds) / (1.0 + odds))
            for a in range(3):
                pull[a] += w * scale * e * rays[c, a]
                for b in range(3):
                    S[a, b] += w * scale * scale * rays[c, a] * rays[c, b]
        for i in range(n):
            for a in range(3):
                pushed[a] = S[a, 0] * lead[0, i] + S[a, 1] * lead[1, i] + S[a, 2] * lead[2, i]
                g[i] += pull[a] * lead[a, i]
            for j in range(n):
                H[i, j] += pushed[0] * lead[0, j] + pushed[1] * lead[1, j] + pushed[2] * lead[2, j]
    return cost
