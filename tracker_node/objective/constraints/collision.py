"""Parts that may not pass through each other, other bodies or a floor, as least-squares objectives; distances of round cones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, Neighbor, State, configured
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.primitives import END, END_RADIUS, N_CAPSULE, START, START_RADIUS, nearest_on
from ...render.shape_arrays import MadeOnce
from ..normal_equations import NormalEquations

_LIFTED_M = 0.1  # from so far above the floor on, a body is as likely in the air: the pull to the floor hardly grows
_OTHERS_GIVE_WAY = 2.0  # times as deep may a part get into another body, which is not exactly where it is expected


class CollisionObjective:
    """Cost (depth / sigma)^2 of every pair of parts that have run into each other; none where they have not.

    A part is a shape, seen as the round cones within it (`capsules`). Two parts are left out if they are rigidly joined, if
    no third part is between them along the chain, or if one is and they overlap in the neutral pose (upper arm and trunk, both
    thighs). Others that overlap there (hand and thigh of hanging arms) may do so that far anywhere.

    Parameters
    ----------
    model : the body.
    sigma_m : how deep parts may get into each other, as a standard deviation: flesh gives way, and models are not exact.
    others : the other bodies that stand about at present, which stay where they are expected; a part may get into them twice as
        deep.
    """

    def __init__(self, model: ArticulatedModel, sigma_m: float = 0.02, others: Callable[[], Sequence[Neighbor]] = tuple):
        if not sigma_m > 0.0:
            raise ValueError(f"expected a positive sigma_m, got {sigma_m}")
        self.model, self.sigma_m, self._others = model, sigma_m, others
        self._among: _Among | None = None
        steps = _steps_between(model)
        nothing = (np.zeros((0, N_CAPSULE)),) * len(model.shapes)
        rows = model.capsules if (steps > 1).any() else nothing  # those of a mesh take a moment, and a rigid body needs none
        self._starts = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
        self._capsules = np.concatenate([np.zeros((0, N_CAPSULE)), *rows])
        self._parts = np.repeat(np.arange(len(rows)), np.diff(self._starts))
        self._bounds = np.array([_bounding_sphere(r) for r in rows]).reshape(-1, 4)
        self._world_capsules, self._world_bounds = np.empty_like(self._capsules), np.empty_like(self._bounds)
        pairs = [(i, j) for i in range(len(rows)) for j in range(i) if steps[i, j] > 1 and len(rows[i]) and len(rows[j])]
        self.pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._allowed = np.zeros(len(pairs))
        overlaps = np.maximum(-self.gaps(State.neutral(model)), 0.0)
        watched = (overlaps == 0.0) | (steps[self.pairs[:, 0], self.pairs[:, 1]] > 2)
        self.pairs, self._allowed = self.pairs[watched], overlaps[watched]

    @property
    def pair_names(self) -> tuple[tuple[str, str], ...]:
        """The pairs of parts that are watched."""
        return tuple((self.model.shapes[i].name, self.model.shapes[j].name) for i, j in self.pairs)

    def gaps(self, state: State) -> np.ndarray:
        """(n_pairs,) distance of each pair, meters; negative where they overlap more than allowed, +inf where they are plainly
        far apart."""
        self._place(configured(self.model, state))
        gaps = np.empty(len(self.pairs))
        pair_gaps(self.pairs, self._world_capsules, self._world_bounds, self._starts, gaps)
        return gaps + self._allowed

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; ``count`` is the number of colliding pairs."""
        configuration, chain = configured(self.model, state), self.model.chain
        self._place(configuration)
        H, g = np.zeros((chain.n_dof, chain.n_dof)), np.zeros(chain.n_dof)
        cost, count = add_collisions(
            self.pairs, self._allowed, self._world_capsules, self._world_bounds, self._starts, self.model.shape_links,
            chain.link_moved_by, configuration.twists, self.sigma_m, H, g,
        )  # fmt: skip
        others = self._others()
        if others:
            if self._among is None or self._among.others is not others:
                self._among = _Among(self.model, others)
            more, colliding = self._among.add(configuration, _OTHERS_GIVE_WAY * self.sigma_m, H, g)
            cost, count = cost + more, count + colliding
        return NormalEquations(H, g, cost, count)

    def _place(self, configuration: Configuration) -> None:
        place_capsules(
            self._capsules, self._bounds, self._parts, self.model.shape_links, configuration.Ts_world_link,
            self._world_capsules, self._world_bounds,
        )  # fmt: skip


class FloorObjective:
    """Cost of parts that are in the floor, and of a body whose lowest part is above it.

    (depth / sigma)^2 of every end of a round cone (`capsules`) that is below the floor. The height h of the lowest end above it
    costs (h / sigma)^2 c^2 / (c^2 + h^2) (Geman-McClure): bodies stand somewhere, but may jump.

    Parameters
    ----------
    model : the body.
    height_m : z of the floor in the world, whose z axis points up.
    sigma_m : how exactly both are known, and soles and floors give way, as a standard deviation.
    """

    def __init__(self, model: ArticulatedModel, height_m: float, sigma_m: float):
        if not sigma_m > 0.0:
            raise ValueError(f"expected a positive sigma_m, got {sigma_m}")
        self.model, self._height_m, self._sigma_m = model, height_m, sigma_m
        cones = _cones(model)
        ends = [cones.capsules[:, start : start + 3] for start in (START, END)]
        self._centers = np.concatenate(ends)
        self._radii = np.concatenate([cones.capsules[:, START_RADIUS], cones.capsules[:, END_RADIUS]])
        self._links = np.tile(cones.links[cones.parts], 2)

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; ``count`` is the number of ends in the floor or pulled to it."""
        body = configured(self.model, state)
        T = body.Ts_world_link[self._links]
        lowest = np.einsum("nij,nj->ni", T[:, :3, :3], self._centers) + T[:, :3, 3]
        lowest[:, 2] -= self._radii
        h = lowest[:, 2] - self._height_m
        use = h < 0.0
        if not use.any() and len(h):
            use[h.argmin()] = True
        h = h[use]
        robust = np.where(h > 0.0, _LIFTED_M**2 / (_LIFTED_M**2 + h**2), 1.0)
        rows = robust[:, None] * body.point_jacobian(lowest[use], self._links[use])[:, 2] / self._sigma_m
        cost = float((robust * h**2).sum()) / self._sigma_m**2
        return NormalEquations(rows.T @ rows, rows.T @ (robust * h) / self._sigma_m, cost, len(h))


class _Cones:
    """The round cones of all parts of a body, one part after the other, in the frames of their links."""

    def __init__(self, model: ArticulatedModel):
        rows = model.capsules
        self.count = np.array([len(r) for r in rows], dtype=np.int64)
        self.capsules = np.concatenate([np.zeros((0, N_CAPSULE)), *rows])
        self.bounds = np.array([_bounding_sphere(r) for r in rows]).reshape(-1, 4)
        self.parts = np.repeat(np.arange(len(rows)), self.count)
        self.links = model.shape_links

    def place(self, configuration: Configuration, capsules: np.ndarray, bounds: np.ndarray) -> None:
        """Write them, and the spheres about them, as they are in the world."""
        place_capsules(self.capsules, self.bounds, self.parts, self.links, configuration.Ts_world_link, capsules, bounds)


_cones: Callable[[ArticulatedModel], _Cones] = MadeOnce(_Cones)


class _Among:
    """Every part of a body with every part of others, which do not move."""

    def __init__(self, model: ArticulatedModel, others: Sequence[Neighbor]):
        self.others, self._own = others, _cones(model)
        every = [self._own, *(_cones(other.body.model) for other in others)]
        counts = np.concatenate([each.count for each in every])
        self._starts = np.concatenate([[0], np.cumsum(counts)])
        self._capsules, self._bounds = np.empty((self._starts[-1], N_CAPSULE)), np.empty((len(counts), 4))
        own = part = len(self._own.count)
        for other, cones in zip(others, every[1:], strict=True):
            end, capsules = part + len(cones.count), slice(self._starts[part], self._starts[part + len(cones.count)])
            cones.place(other.body, self._capsules[capsules], self._bounds[part:end])
            part = end
        chain = model.chain
        self._links = np.concatenate([model.shape_links, np.full(len(counts) - own, len(chain.links), model.shape_links.dtype)])
        self._moved_by = np.vstack([chain.link_moved_by, np.zeros((1, chain.n_dof), dtype=chain.link_moved_by.dtype)])
        one, other_part = np.nonzero(np.outer(self._own.count > 0, counts[own:] > 0))
        self._pairs = np.stack([one, own + other_part], axis=1)
        self._allowed = np.zeros(len(one))

    def add(self, configuration: Configuration, sigma_m: float, H: np.ndarray, g: np.ndarray) -> tuple[float, int]:
        """`add_collisions` of the body in a state."""
        own = len(self._own.count)
        self._own.place(configuration, self._capsules[: self._starts[own]], self._bounds[:own])
        return add_collisions(
            self._pairs, self._allowed, self._capsules, self._bounds, self._starts, self._links, self._moved_by,
            configuration.twists, sigma_m, H, g,
        )  # fmt: skip


def _bounding_sphere(capsules: np.ndarray) -> np.ndarray:
    """Center and radius of a sphere about all round cones of a part, (4,)."""
    if not len(capsules):
        return np.zeros(4)
    centers = np.concatenate([capsules[:, START : START + 3], capsules[:, END : END + 3]])
    radii = np.concatenate([capsules[:, START_RADIUS], capsules[:, END_RADIUS]])
    center = 0.5 * (centers.min(axis=0) + centers.max(axis=0))
    return np.append(center, (np.linalg.norm(centers - center, axis=1) + radii).max())


def _steps_between(model: ArticulatedModel) -> np.ndarray:
    """(n_shapes, n_shapes) steps from part to part along the chain: 0 rigidly joined, 1 with only joints (and links without
    parts) between them, 2 with a third part between them ..."""
    chain = model.chain
    rigid = _rigid_groups(chain)
    groups = rigid[model.shape_links]
    full = set(groups.tolist())
    trails: dict[int, list[int]] = {}  # from a group up to the root, without the empty ones
    for group in range(len(chain.links)):
        if rigid[group] == group:
            above = [] if group == 0 else trails[int(rigid[chain.parents[group]])]
            trails[group] = [group, *above] if group in full else above
    n = len(groups)
    steps = np.zeros((n, n), dtype=np.int64)
    for i, j in np.ndindex(n, n):
        one, other = trails[int(groups[i])], trails[int(groups[j])]
        shared = len(set(one) & set(other))
        if groups[i] != groups[j]:  # where nothing is shared they meet in an empty root
            steps[i, j] = len(one) + len(other) - 2 * shared - (0 if shared else 1)
    return steps


def _rigid_groups(chain: KinematicChain) -> np.ndarray:
    """(n_links,) the first link of those that are welded together."""
    groups = np.arange(len(chain.links))
    for link in range(1, len(chain.links)):
        if chain.axis_count[link] == 0:
            groups[link] = groups[chain.parents[link]]
    return groups


@compiled
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _gap_at(one, other, s, t):
    """Distance of the surfaces of two spheres, at ``s`` on one round cone and ``t`` on the other; negative where they overlap."""
    square = 0.0
    for i in range(3):
        d = one[START + i] + s * (one[END + i] - one[START + i]) - other[START + i] - t * (other[END + i] - other[START + i])
        square += d * d
    radius = one[START_RADIUS] + s * (one[END_RADIUS] - one[START_RADIUS])
    return math.sqrt(square) - radius - other[START_RADIUS] - t * (other[END_RADIUS] - other[START_RADIUS])


@compiled
def _crossing(one, other):
    """(s, t) of the least distance of two round cones without ends; (-1, -1) where there is none.

    The line u between the nearest spheres' centers has u . d1 = r1 and u . d2 = -r2 (axes d, growing radii r), which gives u but
    for its side; that is the one on which the axes pass each other.
    """
    d1 = (one[END] - one[START], one[END + 1] - one[START + 1], one[END + 2] - one[START + 2])
    d2 = (other[END] - other[START], other[END + 1] - other[START + 1], other[END + 2] - other[START + 2])
    w = (one[START] - other[START], one[START + 1] - other[START + 1], one[START + 2] - other[START + 2])
    r1, r2 = one[END_RADIUS] - one[START_RADIUS], other[END_RADIUS] - other[START_RADIUS]
    a, b, c = _dot(d1, d1), _dot(d1, d2), _dot(d2, d2)
    det = a * c - b * b
    if det <= 1e-10 * a * c:
        return -1.0, -1.0
    alpha, beta = (c * r1 + b * r2) / det, (-b * r1 - a * r2) / det
    left = 1.0 - alpha * r1 + beta * r2
    if left <= 0.0:
        return -1.0, -1.0
    nx, ny, nz = d1[1] * d2[2] - d1[2] * d2[1], d1[2] * d2[0] - d1[0] * d2[2], d1[0] * d2[1] - d1[1] * d2[0]
    distance = abs(w[0] * nx + w[1] * ny + w[2] * nz) / math.sqrt(det * left)
    e1, e2 = distance * r1 - _dot(w, d1), -distance * r2 - _dot(w, d2)
    return (c * e1 - b * e2) / det, (b * e1 - a * e2) / det


@compiled
def round_cone_gap(one, other):
    """Distance of the surfaces of two round cones.

    The distance of two spheres is convex in their places on the axes, so its minimum lies inside or on one of four edges.

    Parameters
    ----------
    one, other : (.,) capsules, meters.

    Returns
    -------
    Gap in meters (negative: they overlap), and where on each axis, 0..1.
    """
    s, t = _crossing(one, other)
    if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
        return _gap_at(one, other, s, t), s, t
    best, best_s, best_t = np.inf, 0.0, 0.0
    for end in range(2):
        at = END if end else START
        s, t = float(end), nearest_on(other, one[at], one[at + 1], one[at + 2])
        gap = _gap_at(one, other, s, t)
        if gap < best:
            best, best_s, best_t = gap, s, t
        s, t = nearest_on(one, other[at], other[at + 1], other[at + 2]), float(end)
        gap = _gap_at(one, other, s, t)
        if gap < best:
            best, best_s, best_t = gap, s, t
    return best, best_s, best_t


@compiled
def place_capsules(capsules, bounds, capsule_parts, links, Ts_world_link, world_capsules, world_bounds):
    """Round cones and bounding spheres of all parts in the world.

    Parameters
    ----------
    capsules, bounds : (n_capsules, .) and (n_parts, 4) spheres, in the frames of links.
    capsule_parts, links : (n_capsules,) parts, and (n_parts,) links of these.
    Ts_world_link : (n_links, 4, 4).
    world_capsules, world_bounds : as ``capsules`` and ``bounds``, overwritten.
    """
    for i in range(capsules.shape[0]):
        T = Ts_world_link[links[capsule_parts[i]]]
        for at in (START, END):
            for r in range(3):
                world_capsules[i, at + r] = (
                    T[r, 0] * capsules[i, at] + T[r, 1] * capsules[i, at + 1] + T[r, 2] * capsules[i, at + 2] + T[r, 3]
                )
            world_capsules[i, at + 3] = capsules[i, at + 3]
    for i in range(bounds.shape[0]):
        T = Ts_world_link[links[i]]
        for r in range(3):
            world_bounds[i, r] = T[r, 0] * bounds[i, 0] + T[r, 1] * bounds[i, 1] + T[r, 2] * bounds[i, 2] + T[r, 3]
        world_bounds[i, 3] = bounds[i, 3]


@compiled
def deepest(one, other, world_capsules, world_bounds, starts):
    """Least gap of the round cones of two parts.

    Parameters
    ----------
    one, other : parts.
    world_capsules, world_bounds : of `place_capsules`.
    starts : (n_parts + 1,) first capsule of each part.

    Returns
    -------
    Gap in meters, capsule of ``one``, capsule of ``other``, place on each axis; gap +inf where the parts are far apart.
    """
    square = 0.0
    for r in range(3):
        square += (world_bounds[one, r] - world_bounds[other, r]) ** 2
    best, best_i, best_j, best_s, best_t = np.inf, -1, -1, 0.0, 0.0
    if square > (world_bounds[one, 3] + world_bounds[other, 3]) ** 2:
        return best, best_i, best_j, best_s, best_t
    for i in range(starts[one], starts[one + 1]):
        for j in range(starts[other], starts[other + 1]):
            gap, s, t = round_cone_gap(world_capsules[i], world_capsules[j])
            if gap < best:
                best, best_i, best_j, best_s, best_t = gap, i, j, s, t
    return best, best_i, best_j, best_s, best_t


@compiled
def pair_gaps(pairs, world_capsules, world_bounds, starts, out):
    """Gaps of pairs of parts.

    Parameters
    ----------
    pairs : (n_pairs, 2).
    world_capsules, world_bounds, starts : see `deepest`.
    out : (n_pairs,) meters, overwritten.
    """
    for k in range(pairs.shape[0]):
        out[k] = deepest(pairs[k, 0], pairs[k, 1], world_capsules, world_bounds, starts)[0]


@compiled
def _across(one, other, u):
    """A way out where one axis goes through the other: across both, or across one where they are parallel."""
    d = (one[END] - one[START], one[END + 1] - one[START + 1], one[END + 2] - one[START + 2])
    e = (other[END] - other[START], other[END + 1] - other[START + 1], other[END + 2] - other[START + 2])
    u[0], u[1], u[2] = d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]
    if _dot(u, u) > 1e-12 * _dot(d, d) * _dot(e, e):
        return
    least = 0
    for r in range(3):
        if abs(d[r]) < abs(d[least]):
            least = r
    first, second = (least + 1) % 3, (least + 2) % 3
    u[least], u[first], u[second] = 0.0, d[second], -d[first]
    if _dot(u, u) == 0.0:  # two balls
        u[least] = 1.0


@compiled
def add_collisions(pairs, allowed, world_capsules, world_bounds, starts, links, link_moved_by, twists, sigma_m, H, g):
    """Add (depth / sigma)^2 of every pair that overlaps by more than is allowed, the depth being the excess, to normal equations.

    The depth changes as the two centers approach each other along the line between them: where on the axes they are is the
    minimum's own choice, and does not matter to first order.

    Parameters
    ----------
    pairs, allowed : (n_pairs, 2), and (n_pairs,) meters of overlap that cost nothing.
    world_capsules, world_bounds, starts : see `deepest`.
    links : (n_parts,).
    link_moved_by, twists : (n_links, n_dof) mask, and (n_dof, 6), of the body in its state.
    sigma_m : standard deviation of a depth.
    H, g : (n_dof, n_dof) and (n_dof,), added to.

    Returns
    -------
    Cost, and number of colliding pairs.
    """
    n_dof = g.size
    row = np.empty(n_dof)
    u, p, q = np.empty(3), np.empty(3), np.empty(3)
    cost, count = 0.0, 0
    for k in range(pairs.shape[0]):
        one, other = pairs[k, 0], pairs[k, 1]
        gap, i, j, s, t = deepest(one, other, world_capsules, world_bounds, starts)
        depth = -gap - allowed[k]
        if depth <= 0.0:
            continue
        a, b = world_capsules[i], world_capsules[j]
        for r in range(3):
            p[r] = a[START + r] + s * (a[END + r] - a[START + r])
            q[r] = b[START + r] + t * (b[END + r] - b[START + r])
            u[r] = p[r] - q[r]
        if _dot(u, u) < 1e-18:
            _across(a, b, u)
        length = math.sqrt(_dot(u, u))
        residual = depth / sigma_m
        for dof in range(n_dof):
            row[dof] = 0.0
            moves_one, moves_other = link_moved_by[links[one], dof], link_moved_by[links[other], dof]
            if moves_one == moves_other:
                continue
            x, sign = (p, -1.0) if moves_one else (q, 1.0)
            w = twists[dof]
            vx = w[0] + w[4] * x[2] - w[5] * x[1]
            vy = w[1] + w[5] * x[0] - w[3] * x[2]
            vz = w[2] + w[3] * x[1] - w[4] * x[0]
            row[dof] = sign * (u[0] * vx + u[1] * vy + u[2] * vz) / (length * sigma_m)
        for c in range(n_dof):
            if row[c] != 0.0:
                g[c] += row[c] * residual
                for d in range(n_dof):
                    H[c, d] += row[c] * row[d]
        cost += residual * residual
        count += 1
    return cost, count
