"""The edges of boxes and triangle meshes, and their faces in a tree, packed for the contour kernels.

The outline of a body with flat faces is made of edges between a face that is turned to the camera and one that is not
(silhouette); edges between two faces that are both seen are its creases. Which of them a camera sees is decided on the fly
(`contour.picks`); what does not depend on the camera is made here, once per shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    """Edges and tree of a box or mesh. Vertices at the same place (to a nanometre) count as one, faces without area as none."""
    mesh = box_mesh(primitive) if isinstance(primitive, Box) else primitive
    vertices, faces = _welded(mesh)
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    areas = np.linalg.norm(normals, axis=1)
    faces, normals = faces[areas > 0.0], normals[areas > 0.0] / areas[areas > 0.0, None]
    pairs, borders = _sides(faces)
    closed = len(borders) == 0 and len(faces) > 0
    if closed and np.einsum("ij,ij->", vertices[faces[:, 0]], normals * areas[areas > 0.0, None]) < 0.0:
        faces, normals = faces[:, ::-1], -normals  # the faces were inside out
        pairs, borders = _sides(faces)
    offsets = np.einsum("ij,ij->i", vertices[faces[:, 0]], normals)
    edges, locally_convex = _edges(vertices, faces, normals, offsets, pairs, borders, closed)
    triangles, nodes = _tree(vertices[faces])
    return Solid(edges, triangles, nodes, closed, closed and locally_convex and _is_convex(vertices, normals, offsets))


def _welded(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    vertices, index = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces].astype(np.int64).reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices, faces[whole]


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
