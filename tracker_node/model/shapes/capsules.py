"""Round cones inside of shapes, for telling whether parts of a body have run into each other.

Those made here lie *within* their shape, so that parts which only touch, or overlap a little as flesh does, are not taken to
collide: wholly, except for meshes, where their spheres stick out by up to 4 % of their radius (in the tests) since room is made
for them between samples of the surface. Flat shapes get three side by side, meshes up to five.

A grid is laid over a mesh, and its cells that the surface closes in are found by filling: it does not matter which way faces
look, whether triangles share vertices, or whether there are gaps of less than a cell. About the middle of each such cell goes
the largest ball that the surface leaves room for. Of the round cones from ball to ball that stay within the mesh, one that holds
most cells is taken, and its ends moved as long as that helps; then one that holds most of the others; until what is left is
not worth it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy  # imports its modules when they are first used

from .primitives import (
    END,
    END_RADIUS,
    N_CAPSULE,
    START,
    START_RADIUS,
    Box,
    Ellipsoid,
    Mesh,
    Primitive,
    TruncatedCone,
    count_held,
    is_closed,
    point_gaps,
)

_ROUND = 1.15  # half-axes of a smaller ratio count as equal
_REACH = 0.75  # how far towards the sharp end of an ellipse's axis a circle in it is put, as a fraction of the farthest


def inner_capsules(primitive: Primitive) -> np.ndarray:
    """(n, `N_CAPSULE`) round cones (start, its radius, end, its radius) in the shape's frame, meters."""
    if isinstance(primitive, TruncatedCone):
        return _in_cone(primitive)
    if isinstance(primitive, Ellipsoid):
        return _in_ellipsoid(np.array(primitive.radii))
    if isinstance(primitive, Box):
        return _in_box(0.5 * np.array(primitive.size))
    return capsules_in_mesh(primitive)


def _in_cone(cone: TruncatedCone) -> np.ndarray:
    wide, narrow = max(cone.a, cone.b), min(cone.a, cone.b)
    across = np.array([1.0, 0.0]) if cone.a >= cone.b else np.array([0.0, 1.0])
    middle = 0.5 * (cone.z1 + cone.z2)
    rows = []
    for offset in _offsets(wide, narrow):
        # The largest circle about a point of the ellipse's long axis; a sphere there is cut by the mantle's slope
        radius = narrow * np.sqrt(1.0 - offset**2 / max(wide**2 - narrow**2, 1e-300)) if offset else narrow
        radius /= np.hypot(1.0, cone.k * wide)
        low, high = (cone.z1 + radius) / (1.0 - radius * cone.k), (cone.z2 - radius) / (1.0 + radius * cone.k)
        if low > high:  # flat as a coin
            low = high = middle
        row = np.empty(N_CAPSULE)
        for at, z in ((START, low), (END, high)):
            scale = 1.0 + cone.k * z
            row[at : at + 3] = *(scale * offset * across), z
            row[at + 3] = min(radius * scale, z - cone.z1, cone.z2 - z)
        rows.append(row)
    return np.array(rows)


def _in_ellipsoid(radii: np.ndarray) -> np.ndarray:
    short, middle, long = (int(i) for i in np.argsort(radii))
    S, M, L = radii[short], radii[middle], radii[long]

    def sphere(along: float, aside: float) -> np.ndarray:
        """Center and radius of the largest sphere about a point in the plane of the two longer axes, which touches where the
        shortest axis leads: S^2 (1 - along^2 / (L^2 - S^2) - aside^2 / (M^2 - S^2))."""
        left = 1.0 - (along**2 / (L**2 - S**2) if along else 0.0) - (aside**2 / (M**2 - S**2) if aside else 0.0)
        center = np.zeros(3)
        center[long], center[middle] = along, aside
        return np.append(center, S * np.sqrt(left))

    rows = []
    for aside in _offsets(M, S):
        farthest = (L**2 - S**2) / L
        reach = 0.0 if L < _ROUND * S else farthest * (_REACH if aside == 0.0 else 0.8 * _REACH)
        ends = [sphere(along, aside) for along in (-reach, 0.0, reach)]
        pairs = [(ends[0], ends[1]), (ends[1], ends[2])] if reach else [(ends[1], ends[1])]
        rows += [np.concatenate(pair) for pair in pairs]
    return np.array(rows)


def _in_box(half: np.ndarray) -> np.ndarray:
    short, middle, long = (int(i) for i in np.argsort(half))
    radius = half[short]
    aside = half[middle] - radius
    rows = []
    for offset in [0.0] if half[middle] < _ROUND * radius else [-aside, 0.0, aside]:
        row = np.zeros(N_CAPSULE)
        for at, sign in ((START, -1.0), (END, 1.0)):
            row[at + long], row[at + middle], row[at + 3] = sign * (half[long] - radius), offset, radius
        rows.append(row)
    return np.array(rows)


def _offsets(wide: float, narrow: float) -> list[float]:
    """Where on the long axis of an ellipse circles are put."""
    if wide < _ROUND * narrow:
        return [0.0]
    aside = _REACH * (wide**2 - narrow**2) / wide
    return [-aside, 0.0, aside]


_CELLS = 3000  # of the grid
_FEWEST_ACROSS, _MOST_ALONG = 5, 41  # cells; odd, so that one row of them lies in the middle
_SPACING = 0.6  # of samples of the surface, in cells: a point half a cell from all of them would let the filling leak
_FINE = 0.4  # of those that distances are taken to, in the least side of a cell
_MOST_SAMPLES = 100_000  # of these, beside four of each triangle; where there are more, they are taken farther apart
_FLAT = 1e-3  # a mesh whose box is thinner than this fraction of its length holds nothing
_SHELL = 0.1  # an open mesh of which less is closed in is taken for the shell of what it goes around
_APART = 0.4  # balls that are closer to a larger one, in its radii, are left out
_SMALLEST = 0.2  # and those that are so much smaller than the largest
_BALLS = 150  # at most; where there are more, they are taken farther apart
_MOST = 5  # round cones of one mesh
_WORTH = 0.05  # a further one must hold so much of what the first one does
_TURNS = 4  # of looking for the other end
_MOVES, _STEP = 10, 0.5  # of the ends; the first by this fraction of their radius
_WAYS = np.vstack([np.eye(3), -np.eye(3)])
_LEAST_ROOM = 0.98  # fraction of its radius that the surface must leave a round cone everywhere


@dataclass(frozen=True, eq=False)
class _Room:
    """What the surface leaves: samples of it, and the box about them (which counts where samples are far apart, in a wire)."""

    surface: scipy.spatial.cKDTree
    low: np.ndarray
    high: np.ndarray

    def radii(self, centers: np.ndarray) -> np.ndarray:
        """(n,) of the largest balls about points (n, 3) within."""
        to_box = np.minimum(centers - self.low, self.high - centers).min(axis=1)
        return np.minimum(self.surface.query(centers)[0], to_box)

    def holds(self, cone: np.ndarray) -> bool:
        """Whether there is room for a round cone from one end to the other, asked every half of its least radius."""
        one, other = cone[START : START + 4], cone[END : END + 4]
        steps = 2 + int(min(np.linalg.norm(other[:3] - one[:3]) / (0.5 * min(one[3], other[3])), 200.0))
        fractions = np.linspace(0.0, 1.0, steps)[:, None]
        balls = (1.0 - fractions) * one + fractions * other
        return bool((self.radii(balls[:, :3]) >= _LEAST_ROOM * balls[:, 3]).all())


def capsules_in_mesh(mesh: Mesh) -> np.ndarray:
    """(n, `N_CAPSULE`) round cones within a mesh, in its frame, meters; at most five.

    None for a mesh without volume, or with walls too thin for the grid. Cavities count as solid, and so does what an open mesh
    goes around (a tube, a bowl); the hole of a ring does not.
    """
    corners = mesh.vertices[mesh.faces]
    if not len(corners):
        return np.zeros((0, N_CAPSULE))
    middle = corners.reshape(-1, 3).mean(axis=0)
    axes = _axes(corners - middle)
    corners = (corners - middle) @ axes.T
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    if not (high - low).min() > _FLAT * (high - low).max():
        return np.zeros((0, N_CAPSULE))
    rows = _cover(*_cells(corners, low, high, is_closed(mesh)))
    for at in (START, END):
        rows[:, at : at + 3] = rows[:, at : at + 3] @ axes + middle
    return rows


def _axes(corners: np.ndarray) -> np.ndarray:
    """Directions (3, 3) of the grid, as rows: the mesh's own, or its principal ones if their box is plainly smaller."""
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not areas.sum() > 0.0:
        return np.eye(3)
    sums, weights = corners.sum(axis=1), areas / areas.sum()
    mean = weights @ sums / 3.0
    second = np.einsum("f,fci,fcj->ij", weights, corners, corners) + np.einsum("f,fi,fj->ij", weights, sums, sums)
    principal = np.linalg.eigh(second / 12.0 - np.outer(mean, mean))[1].T
    own_box, box = (np.prod(np.ptp(corners.reshape(-1, 3) @ axes.T, axis=0)) for axes in (np.eye(3), principal))
    return principal if box < 0.9 * own_box else np.eye(3)


def _cells(corners: np.ndarray, low: np.ndarray, high: np.ndarray, closed: bool) -> tuple[np.ndarray, _Room]:
    """Middles (n, 3) of the cells within, and the room that they have."""
    size = high - low
    counts = np.round(size / np.cbrt(size.prod() / _CELLS)).astype(int) // 2 * 2 + 1
    counts = np.clip(counts, _FEWEST_ACROSS, _MOST_ALONG)
    cell = size / counts
    surface = np.zeros(counts, dtype=bool)
    surface[_cells_of(_samples((corners - low) / cell, _SPACING), counts)] = True
    filled = scipy.ndimage.binary_fill_holes(surface) if closed else _filled(surface)
    deep = scipy.ndimage.binary_erosion(filled, np.ones((3, 3, 3)))
    centers = low + (np.argwhere((filled & ~surface) | deep) + 0.5) * cell
    return centers, _Room(_tree(corners, deep, low, cell), low, high)


def _cells_of(points: np.ndarray, counts: npt.ArrayLike) -> tuple[np.ndarray, ...]:
    return tuple(np.clip(points.astype(int), 0, np.subtract(counts, 1)).T)


def _tree(corners: np.ndarray, deep: np.ndarray, low: np.ndarray, cell: np.ndarray) -> scipy.spatial.cKDTree:
    """Samples for distances, those of walls in ``deep`` cells, within the mesh, left out.

    A distance to samples is a little longer than that to the surface; they are so close together that this is little even where
    the mesh is only as wide as the narrow side of a stretched cell.
    """
    spacing = _FINE * float(cell.min())
    while (_parts(corners, spacing) + 1).prod(axis=1).sum() > _MOST_SAMPLES + 4 * len(corners):
        spacing *= 1.25
    samples = _samples(corners, spacing)
    return scipy.spatial.cKDTree(samples[~deep[_cells_of((samples - low) / cell, deep.shape)]])


def _samples(corners: np.ndarray, spacing: float) -> np.ndarray:
    """Points (n, 3) of triangles (m, 3, 3), at most so far apart along their sides; of smaller ones, the middle."""
    tips = (_sides(corners).argmin(axis=1)[:, None] + np.arange(3)) % 3  # slivers are cut from their tip on
    corners = np.take_along_axis(corners, tips[:, :, None], axis=1)
    kinds, kind = np.unique(_parts(corners, spacing), axis=0, return_inverse=True)
    points = [np.einsum("wc,mcx->mwx", _weights(*n), corners[kind.ravel() == i]).reshape(-1, 3) for i, n in enumerate(kinds)]
    return np.concatenate(points)


def _parts(corners: np.ndarray, spacing: float) -> np.ndarray:
    """(m, 2) into how many parts triangles are cut, along and across."""
    sides = _sides(corners)
    return np.ceil(np.stack([sides.max(axis=1), sides.min(axis=1)], axis=1) / spacing).astype(int)


def _sides(corners: np.ndarray) -> np.ndarray:
    """(m, 3) lengths, each of the side opposite a corner."""
    return np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2)


def _weights(along: int, across: int) -> np.ndarray:
    """Barycentric coordinates (n, 3) of points in a triangle that is cut so often; one that is not cut is its middle."""
    if along <= 1:
        return np.full((1, 3), 1.0 / 3.0)
    s, t = np.meshgrid(np.linspace(0.0, 1.0, along + 1), np.linspace(0.0, 1.0, max(across, 1) + 1))
    return np.stack([1.0 - s, s * (1.0 - t), s * t], axis=-1).reshape(-1, 3)


def _filled(surface: np.ndarray) -> np.ndarray:
    """Cells of an open surface and those that they close in; if these are few, those that have it on both sides along two of
    the axes."""
    solid = scipy.ndimage.binary_fill_holes(surface)
    shell = surface | (np.sum([_between(surface, axis) for axis in range(3)], axis=0) >= 2)
    return solid if (solid & ~surface).sum() > _SHELL * (shell & ~surface).sum() else shell


def _between(surface: np.ndarray, axis: int) -> np.ndarray:
    before = np.logical_or.accumulate(surface, axis)
    behind = np.flip(np.logical_or.accumulate(np.flip(surface, axis), axis), axis)
    return before & behind


def _cover(centers: np.ndarray, room: _Room) -> np.ndarray:
    """Round cones (n, `N_CAPSULE`) that hold most of ``centers`` together."""
    radii = room.radii(centers)
    balls = np.column_stack([centers, radii])[_chosen(centers, radii)]
    rows, left, least = np.zeros((0, N_CAPSULE)), centers, 1.0
    while len(rows) < _MOST and len(left):
        row, held = _grown(*_best(balls, left, room), left, room)
        if held < least:
            break
        gaps = np.empty(len(left))
        point_gaps(row[None], left, gaps)
        rows, left, least = np.vstack([rows, row]), left[gaps >= 0.0], max(least, _WORTH * held)
    return rows


def _chosen(centers: np.ndarray, radii: np.ndarray, apart: float = _APART) -> list[int]:
    """Balls to build from: the largest first, and none near one that was taken."""
    chosen: list[int] = []
    free = radii > _SMALLEST * radii.max(initial=0.0)
    for i in np.argsort(-radii, kind="stable"):
        if free[i]:
            chosen.append(int(i))
            free &= ((centers - centers[i]) ** 2).sum(axis=1) > (apart * radii[i]) ** 2
        if len(chosen) > _BALLS:
            return _chosen(centers, radii, 1.5 * apart)
    return chosen


def _best(balls: np.ndarray, points: np.ndarray, room: _Room) -> tuple[np.ndarray, int]:
    """The round cone found to hold most of ``points``, and how many: the best ball, the best other end for it, the best other
    end for that ..."""
    cones = np.hstack([balls, balls])
    counts = _counts(cones, points)
    end = int(counts.argmax())
    best, most = cones[end], int(counts[end])
    for _ in range(_TURNS):
        cones = np.hstack([np.broadcast_to(balls[end], balls.shape), balls])
        counts = _counts(cones, points)
        order = np.argsort(-counts, kind="stable")
        other = next((int(i) for i in order if counts[i] <= most or room.holds(cones[i])), end)
        if counts[other] <= most:
            break
        best, most, end = cones[other], int(counts[other]), other
    return best, most


def _grown(row: np.ndarray, held: int, points: np.ndarray, room: _Room) -> tuple[np.ndarray, int]:
    """A round cone with its ends moved as long as it holds more points, or as many and is larger; and how many."""
    step, size = _STEP, float(_volumes(row[None])[0])
    for _ in range(_MOVES):
        before = size, held
        for at in (START, END):
            trials = np.tile(row, (len(_WAYS), 1))
            trials[:, at : at + 3] += step * row[at + 3] * _WAYS
            trials[:, at + 3] = room.radii(trials[:, at : at + 3])
            counts, sizes = _counts(trials, points), _volumes(trials)
            best = int(np.lexsort((sizes, counts))[-1])
            if (counts[best], sizes[best]) > (held, size) and room.holds(trials[best]):
                row, held, size = trials[best], int(counts[best]), float(sizes[best])
        step *= 0.5 if (size, held) == before else 1.0
    return row, held


def _volumes(cones: np.ndarray) -> np.ndarray:
    """(n,), of the frustum between the ends and half a ball at either; a fair measure unless one end swallows the other."""
    one, other = cones[:, START_RADIUS], cones[:, END_RADIUS]
    length = np.linalg.norm(cones[:, END : END + 3] - cones[:, START : START + 3], axis=1)
    return np.pi / 3.0 * (length * (one**2 + one * other + other**2) + 2.0 * (one**3 + other**3))


def _counts(cones: np.ndarray, points: np.ndarray) -> np.ndarray:
    counts = np.empty(len(cones), dtype=np.int64)
    count_held(cones, points, counts)
    return counts
