"""Boxes and triangle meshes for kernels: their edges, their faces in a tree, and where rays meet them.

The outline of a body with flat faces is made of edges between a face that is turned to the camera and one that is not
(silhouette); edges between two faces that are both seen are its creases. Which of them a camera sees is decided on the fly
(`contour.picks`); what does not depend on the camera is made here, once per shape. A tree of bounding boxes finds the triangle
that a ray meets.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np

from ..compiled.kernels import compiled
from ..model.shapes.primitives import Box, Mesh

# Columns of an edge: its ends, the planes n.x = d of the faces on both sides, how it may be seen
START, END, NORMAL_0, OFFSET_0, NORMAL_1, OFFSET_1, MANNER = 0, 3, 6, 9, 10, 13, 14
N_EDGE_COLUMNS = 15
# Of ``MANNER``: may be an outline where one face is seen, a crease where both are; is the border of an open surface
OUTLINE, CREASE, BORDER = 1, 2, 4
# Columns of a node of the tree: its box, and the first of two children, or of so many triangles
LOW, HIGH, FIRST, COUNT = 0, 3, 6, 7
N_NODE_COLUMNS = 8
N_TRIANGLE_COLUMNS = 9  # a corner, and the edges to the other two

_FEW_FACES = 3000  # of a mesh whose pixels are marked, to a pixel or so
_SIMPLIFYING = Lock()  # the library that simplifies has its mesh in global variables, and lets other threads run meanwhile
_MOST_FACES = 8000  # of a mesh whose contours are drawn; of more, so many are left, which stay far within a pixel of them
_FLAT_RAD = 1e-5  # faces that make less of an angle are one face
_CREASE_RAD = np.radians(30.0)
_LEAF = 4  # triangles
_BOX_FACES = np.array(
    [[1, 3, 2], [0, 1, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Solid:
    """One box or mesh, in the frame of its shape.

    Attributes
    ----------
    edges : (n, `N_EDGE_COLUMNS`); edges between faces in one plane are left out.
    triangles : (m, `N_TRIANGLE_COLUMNS`), in the order of the tree.
    nodes : (k, `N_NODE_COLUMNS`), the first is the root.
    closed, convex : whether it encloses a volume, and whether it cannot hide itself.
    """

    edges: np.ndarray
    triangles: np.ndarray
    nodes: np.ndarray
    closed: bool
    convex: bool


def box_mesh(box: Box) -> Mesh:
    """The twelve triangles of a box."""
    half = 0.5 * np.asarray(box.size)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    return Mesh(corners, _BOX_FACES)


def solid_of(primitive: Box | Mesh) -> Solid:
    """Edges and tree of a box or mesh.

    Vertices at the same place (to a nanometer) count as one, faces without area as none. Meshes of many faces are simplified by
    quadric errors (Garland & Heckbert 1997): scanned ones have edges by the hundred thousand, none longer than a pixel.
    """
    mesh = box_mesh(primitive) if isinstance(primitive, Box) else primitive
    given = _welded(mesh)
    vertices, faces = _simplified(*given)
    normals, areas = _normals(vertices, faces)
    faces, normals = faces[areas > 0.0], normals[areas > 0.0]
    pairs, borders = _sides(faces)
    closed = len(borders) == 0 and len(faces) > 0
    if closed and np.einsum("ij,ij->", vertices[faces[:, 0]], normals * areas[areas > 0.0, None]) < 0.0:
        faces, normals = faces[:, ::-1], -normals  # the faces were inside out
        pairs, borders = _sides(faces)
    offsets = np.einsum("ij,ij->i", vertices[faces[:, 0]], normals)
    edges, locally_convex = _edges(vertices, faces, normals, offsets, pairs, borders, closed)
    if faces.shape != given[1].shape:
        edges = _with_creases_of(given, edges)
    triangles, nodes = _tree(vertices[faces])
    return Solid(edges, triangles, nodes, closed, closed and locally_convex and _is_convex(vertices, normals, offsets))


def light_mesh(mesh: Mesh) -> Mesh:
    """The same surface without colors, with few vertices and faces; a small mesh as it is.

    Files give every face corners of its own, so that colors and normals may end at its edges.
    """
    if len(mesh.faces) <= _FEW_FACES:
        return mesh
    vertices, faces = _simplified(*_welded(mesh), _FEW_FACES)
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], index.reshape(faces.shape))


def _welded(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    vertices, index = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces].astype(np.int64).reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices, faces[whole]


def _normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (n, 3), zero where a face has no area, and twice the areas (n,)."""
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    areas = np.linalg.norm(normals, axis=1)
    return normals / np.where(areas > 0.0, areas, 1.0)[:, None], areas


def _simplified(vertices: np.ndarray, faces: np.ndarray, most: int = _MOST_FACES) -> tuple[np.ndarray, np.ndarray]:
    """A mesh of at most so many faces, or the given one where that would open it."""
    if len(faces) <= most:
        return vertices, faces
    import fast_simplification  # few models need it

    middle = vertices.mean(axis=0)  # it computes in float32
    with _SIMPLIFYING:
        points, left = fast_simplification.simplify(vertices - middle, faces, target_count=most)
    points, left = np.asarray(points, dtype=np.float64) + middle, np.asarray(left, dtype=np.int64)
    left = left[_normals(points, left)[1] > 0.0]
    if len(_sides(left)[1]) and not len(_sides(faces)[1]):
        return vertices, faces
    return points, left


def _with_creases_of(given: tuple[np.ndarray, np.ndarray], edges: np.ndarray) -> np.ndarray:
    """The edges of a simplified mesh that are creases only where the mesh it is made of has some: facets of a tube are none."""
    from scipy.spatial import cKDTree  # slow to import

    vertices, faces = given
    normals, _ = _normals(vertices, faces)
    pairs, _ = _sides(faces)
    sharp = np.einsum("ij,ij->i", normals[pairs[:, 0] // 3], normals[pairs[:, 1] // 3]) < np.cos(_CREASE_RAD)
    starts, ends = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    corners = np.unique(np.concatenate([starts[pairs[sharp, 0]], ends[pairs[sharp, 0]]]))
    creases = (edges[:, MANNER].astype(int) & CREASE) > 0
    if len(corners) and creases.any():
        tree = cKDTree(vertices[corners])
        for end in (START, END):
            away, _ = tree.query(edges[creases, end : end + 3])
            lengths = np.linalg.norm(edges[creases, END : END + 3] - edges[creases, START : START + 3], axis=1)
            near = np.zeros(len(edges), dtype=np.bool_)
            near[creases] = away <= 0.5 * lengths
            edges[creases & ~near, MANNER] -= CREASE
            creases &= near
    elif creases.any():
        edges[creases, MANNER] -= CREASE
    return edges[edges[:, MANNER] > 0]


def _sides(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sides (face, corner) -> those that two faces share, once each way, (n, 2) indices; and all others, (m,)."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((start, high, low))
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    first = np.flatnonzero(new)
    sizes = np.diff(np.append(first, len(order)))
    pair = first[sizes == 2]
    pair = pair[start[order[pair]] != start[order[pair + 1]]]
    pairs = np.stack([order[pair], order[pair + 1]], axis=1)
    single = np.ones(len(order), dtype=bool)
    single[pairs.reshape(-1)] = False
    return pairs, np.flatnonzero(single)


def _edges(vertices, faces, normals, offsets, pairs, borders, closed) -> tuple[np.ndarray, bool]:
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    face_0, face_1 = pairs[:, 0] // 3, pairs[:, 1] // 3
    n_0, n_1 = normals[face_0], normals[face_1]
    angle = np.arctan2(np.linalg.norm(np.cross(n_0, n_1), axis=1), np.einsum("ij,ij->i", n_0, n_1))
    apex = vertices[faces.reshape(-1)[pairs[:, 1] // 3 * 3 + (pairs[:, 1] + 2) % 3]]
    convex = np.einsum("ij,ij->i", n_0, apex) <= offsets[face_0]
    # A hollow edge of a closed surface with one face turned away is behind the surface
    manner = OUTLINE * (convex | (not closed)) + CREASE * (angle > _CREASE_RAD)
    used = (angle > _FLAT_RAD) & (manner > 0)
    inner = np.hstack([
        vertices[start[pairs[:, 0]]], vertices[end[pairs[:, 0]]], n_0, offsets[face_0, None], n_1, offsets[face_1, None],
        manner[:, None],
    ])[used]  # fmt: skip
    face = borders // 3
    outer = np.hstack([
        vertices[start[borders]], vertices[end[borders]], normals[face], offsets[face, None], normals[face], offsets[face, None],
        np.full((len(borders), 1), BORDER),
    ])  # fmt: skip
    return np.vstack([inner, outer]).astype(np.float64), bool(np.all(convex | (angle < _FLAT_RAD)))


def _is_convex(vertices: np.ndarray, normals: np.ndarray, offsets: np.ndarray) -> bool:
    """Whether every vertex is behind every face."""
    slack = 1e-6 * float(np.ptp(vertices, axis=0).max())
    return all(
        bool((vertices @ normals[i : i + 256].T <= offsets[i : i + 256] + slack).all()) for i in range(0, len(normals), 256)
    )


def _tree(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (m, 3, 3) sorted, and the nodes of a tree of their bounding boxes, halved at the median of the longest side."""
    low, high, middle = corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)
    order = np.arange(len(corners))
    nodes = [np.zeros(N_NODE_COLUMNS)]
    waiting = [(0, 0, len(order))]
    while waiting:
        node, begin, end = waiting.pop()
        mine, row = order[begin:end], nodes[node]
        row[LOW : LOW + 3] = low[mine].min(axis=0, initial=np.inf)
        row[HIGH : HIGH + 3] = high[mine].max(axis=0, initial=-np.inf)
        if end - begin <= _LEAF:
            row[FIRST], row[COUNT] = begin, end - begin
            continue
        axis = int(np.argmax(np.ptp(middle[mine], axis=0)))
        half = (end - begin) // 2
        order[begin:end] = mine[np.argpartition(middle[mine, axis], half)]
        row[FIRST] = len(nodes)
        waiting += [(len(nodes), begin, begin + half), (len(nodes) + 1, begin + half, end)]
        nodes += [np.zeros(N_NODE_COLUMNS), np.zeros(N_NODE_COLUMNS)]
    sorted_corners = corners[order]
    origin = sorted_corners[:, 0]
    triangles = np.hstack([origin, sorted_corners[:, 1] - origin, sorted_corners[:, 2] - origin])
    return triangles.reshape(-1, N_TRIANGLE_COLUMNS), np.array(nodes)


# Columns of ``ranges``, one row per shape: its edges, the root of its tree, what sort of solid it is, whether its caps count
FIRST_EDGE, N_EDGES, ROOT, SORT, CAPS = range(5)
N_RANGE_COLUMNS = 5
NO_SOLID, BOX_SOLID, CONVEX_MESH, MESH = range(4)

NO_HIT = 1e30
_STACK = 64


@compiled
def to_shape(T, center, dx, dy, dz):
    """A ray of the world in the frame of a shape.

    Parameters
    ----------
    T : (4, 4) world from shape.
    center : (3,) origin of the ray, world, meters.
    dx, dy, dz : its direction in the world, of any length.

    Returns
    -------
    (6,) origin and direction.
    """
    wx, wy, wz = center[0] - T[0, 3], center[1] - T[1, 3], center[2] - T[2, 3]
    return (
        T[0, 0] * wx + T[1, 0] * wy + T[2, 0] * wz,
        T[0, 1] * wx + T[1, 1] * wy + T[2, 1] * wz,
        T[0, 2] * wx + T[1, 2] * wy + T[2, 2] * wz,
        T[0, 0] * dx + T[1, 0] * dy + T[2, 0] * dz,
        T[0, 1] * dx + T[1, 1] * dy + T[2, 1] * dz,
        T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz,
    )  # fmt: skip


@compiled
def slab_interval(node, ray, t_min, t_max):
    """The part of a ray that is in a box.

    Parameters
    ----------
    node : of the tree, with the box in columns `LOW` and `HIGH`.
    ray : (6,) origin and direction, of `to_shape`.
    t_min, t_max : the part of the ray that counts.

    Returns
    -------
    t_in, t_out : within [t_min, t_max]; t_in > t_out where there is none.
    """
    for axis in range(3):
        origin, speed = ray[axis], ray[axis + 3]
        low, high = node[LOW + axis], node[HIGH + axis]
        if abs(speed) < 1e-12:
            if origin < low or origin > high:
                return 1.0, 0.0
            continue
        a, b = (low - origin) / speed, (high - origin) / speed
        if a > b:
            a, b = b, a
        t_min, t_max = max(t_min, a), min(t_max, b)
        if t_min > t_max:
            return 1.0, 0.0
    return t_min, t_max


@compiled
def triangle_hit(triangle, ray):
    """Where a ray meets a triangle, from either side (Moeller & Trumbore 1997).

    Parameters
    ----------
    triangle : (`N_TRIANGLE_COLUMNS`,).
    ray : (6,) origin and direction.

    Returns
    -------
    t on the ray's whole line, or `NO_HIT`.
    """
    ex, ey, ez = triangle[3], triangle[4], triangle[5]
    fx, fy, fz = triangle[6], triangle[7], triangle[8]
    px, py, pz = ray[4] * fz - ray[5] * fy, ray[5] * fx - ray[3] * fz, ray[3] * fy - ray[4] * fx
    determinant = ex * px + ey * py + ez * pz
    if determinant == 0.0:
        return NO_HIT
    sx, sy, sz = ray[0] - triangle[0], ray[1] - triangle[1], ray[2] - triangle[2]
    u = (sx * px + sy * py + sz * pz) / determinant
    if u < 0.0 or u > 1.0:
        return NO_HIT
    qx, qy, qz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
    v = (ray[3] * qx + ray[4] * qy + ray[5] * qz) / determinant
    if v < 0.0 or u + v > 1.0:
        return NO_HIT
    return (fx * qx + fy * qy + fz * qz) / determinant


@compiled
def mesh_hit(nodes, triangles, root, ray, t_max, any_hit):
    """Where a ray first meets a mesh.

    Parameters
    ----------
    nodes, triangles : of `Solid`.
    root : index of the mesh's first node.
    ray : (6,) origin and direction, in the frame of the shape.
    t_max : only what is nearer counts.
    any_hit : the first point that is found will do.

    Returns
    -------
    Least t in (0, t_max), or `NO_HIT`.
    """
    stack = np.empty(_STACK, dtype=np.int64)
    stack[0], top, best = root, 1, NO_HIT
    while top > 0:
        top -= 1
        node = nodes[stack[top]]
        t_in, t_out = slab_interval(node, ray, 0.0, min(t_max, best))
        if t_in > t_out:
            continue
        first, count = int(node[FIRST]), int(node[COUNT])
        if count == 0:
            stack[top], stack[top + 1] = first, first + 1
            top += 2
            continue
        for i in range(first, first + count):
            t = triangle_hit(triangles[i], ray)
            if 0.0 < t < t_max and t < best:
                if any_hit:
                    return t
                best = t
    return best


@compiled
def solid_hit(surfaces, shape, T, center, dx, dy, dz, t_max, any_hit):
    """Where a ray of the world first is in a box or meets a mesh.

    Parameters
    ----------
    surfaces : `ShapeArrays.surfaces`.
    shape : index of the shape.
    T : (4, 4) world from shape.
    center : (3,) origin of the ray, world, meters.
    dx, dy, dz : its direction, of any length.
    t_max : only what is nearer counts.
    any_hit : of a mesh, the first point that is found will do.

    Returns
    -------
    Least t in [0, t_max), or `NO_HIT`; always that for other kinds of shapes.
    """
    ranges, _, nodes, triangles = surfaces
    sort, root = ranges[shape, SORT], ranges[shape, ROOT]
    if sort == NO_SOLID:
        return NO_HIT
    ray = to_shape(T, center, dx, dy, dz)
    if sort == BOX_SOLID:
        t_in, t_out = slab_interval(nodes[root], ray, 0.0, t_max)
        return t_in if t_in < t_out else NO_HIT
    return mesh_hit(nodes, triangles, root, ray, t_max, any_hit)
