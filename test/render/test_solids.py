"""Edges and trees of small solids whose edges can be counted by hand."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import icosahedron, tetrahedron
from tracker_node.model.shapes.primitives import Box, Mesh
from tracker_node.render import solids as ce
from tracker_node.render.solids import BORDER, CREASE, OUTLINE, solid_of

SIZE = np.array([0.2, 0.4, 0.6])


def planes(edges):
    """Normals and offsets of both faces."""
    return edges[:, 6:9], edges[:, 9], edges[:, 10:13], edges[:, 13]


def test_the_edges_of_a_box():
    solid = solid_of(Box(tuple(SIZE)))
    assert solid.closed and solid.convex
    assert solid.edges.shape == (12, 15) and solid.triangles.shape == (12, 9)
    start, end = solid.edges[:, 0:3], solid.edges[:, 3:6]
    np.testing.assert_allclose(np.abs(start), np.tile(SIZE / 2.0, (12, 1)))
    np.testing.assert_allclose(np.sort(np.linalg.norm(end - start, axis=1)), np.repeat(SIZE, 4))  # no diagonals
    assert np.all(solid.edges[:, 14] == OUTLINE + CREASE)
    n0, d0, n1, d1 = planes(solid.edges)
    for normals, offsets in ((n0, d0), (n1, d1)):
        np.testing.assert_allclose(np.abs(normals) @ SIZE / 2.0, offsets)  # outward
        np.testing.assert_allclose(np.einsum("ij,ij->i", normals, start), offsets)
        np.testing.assert_allclose(np.einsum("ij,ij->i", normals, end), offsets)
    np.testing.assert_allclose(np.einsum("ij,ij->i", n0, n1), 0.0, atol=1e-12)
    # The first face has the edge in its own direction, so its normal turns to the second one about it
    assert np.all(np.einsum("ij,ij->i", np.cross(n0, n1), end - start) > 0.0)


def test_a_mesh_that_is_inside_out_is_turned():
    right, wrong = tetrahedron(1.0), Mesh(tetrahedron(1.0).vertices, tetrahedron(1.0).faces[:, ::-1])
    for mesh in (right, wrong):
        solid = solid_of(mesh)
        assert solid.closed and solid.convex and len(solid.edges) == 6
        n0, d0, _, d1 = planes(solid.edges)
        np.testing.assert_allclose([d0, d1], 1.0 / np.sqrt(3.0))  # from the middle to a face, outward
        np.testing.assert_allclose(np.einsum("ij,ij->i", n0, solid.edges[:, :3]), d0)
        for a, b, c in (t.reshape(3, 3) for t in solid.triangles):
            assert np.cross(b, c) @ a > 0.0


def test_corners_at_one_place_are_one_and_faces_without_area_none():
    mesh = tetrahedron(1.0)
    apart = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3) + 1e-11, np.arange(12).reshape(4, 3))
    solid = solid_of(apart)
    assert solid.closed and len(solid.edges) == 6
    middle = np.vstack([mesh.vertices, mesh.vertices[:2].mean(axis=0)])
    for extra in ([0, 0, 1], [0, 1, 1], [1, 0, 1], [0, 1, 4]):
        solid = solid_of(Mesh(middle, np.vstack([mesh.faces, [extra]])))
        assert solid.closed and len(solid.triangles) == 4


def fold(angle):
    """Two triangles at the edge from (0, 0, 0) to (0, 1, 0), the second turned down by ``angle``."""
    vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(angle), 0, -np.sin(angle)]])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 3, 1]]))


@pytest.mark.parametrize(
    ("degrees", "manner"), [(0.0, None), (1e-4, None), (1.0, OUTLINE), (29.0, OUTLINE), (31.0, 3), (-29.0, OUTLINE), (-31.0, 3)]
)
def test_how_an_edge_of_an_open_surface_may_be_seen(degrees, manner):
    """Also a hollow one is its outline: nothing closes the surface behind it."""
    solid = solid_of(fold(np.radians(degrees)))
    assert not solid.closed and not solid.convex
    border = solid.edges[solid.edges[:, 14] == BORDER]
    assert len(border) == 4
    np.testing.assert_array_equal(border[:, 6:10], border[:, 10:14])
    np.testing.assert_allclose(np.einsum("ij,ij->i", border[:, 6:9], border[:, :3]), border[:, 9], atol=1e-12)
    np.testing.assert_allclose(np.einsum("ij,ij->i", border[:, 6:9], border[:, 3:6]), border[:, 9], atol=1e-12)
    inner = solid.edges[solid.edges[:, 14] != BORDER]
    assert len(inner) == (0 if manner is None else 1)
    if manner is not None:
        assert inner[0, 14] == manner
        assert sorted(inner[0, [1, 4]]) == [0.0, 1.0]
    lengths = np.linalg.norm(border[:, 3:6] - border[:, :3], axis=1)
    np.testing.assert_allclose(np.sort(lengths), np.sort([1.0, 1.0, 2**0.5, 2**0.5]))


def notched(depth):
    """A square pyramid upside down on a square: its apex at ``depth`` below (a hollow) or above (a roof) the top of a box."""
    vertices = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)] + [[0.0, 0.0, 1.0 + depth]])
    faces = [[0, 2, 1], [1, 2, 3], [0, 1, 4], [1, 5, 4], [1, 3, 5], [3, 7, 5], [3, 2, 7], [2, 6, 7], [2, 0, 6], [0, 4, 6],
             [4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]  # fmt: skip
    return Mesh(vertices, np.array(faces))


def test_hollow_edges_of_a_closed_body_are_no_outline():
    hollow, roof, shallow = (solid_of(notched(depth)) for depth in (-0.8, 0.8, -0.1))
    assert hollow.closed and not hollow.convex and roof.closed and roof.convex and not shallow.convex
    for solid, manner in ((hollow, CREASE), (roof, OUTLINE + CREASE)):
        at_apex = (np.abs(solid.edges[:, :2]).max(axis=1) == 0.0) | (np.abs(solid.edges[:, 3:5]).max(axis=1) == 0.0)
        assert at_apex.sum() == 4 and np.all(solid.edges[at_apex, 14] == manner)
        assert len(solid.edges) == 16 and np.all(solid.edges[~at_apex, 14] == OUTLINE + CREASE)
    assert len(shallow.edges) == 12  # hollow and hardly bent: never seen


def test_sides_shared_by_other_than_two_are_borders():
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0.0]])
    pages = Mesh(vertices, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert (solid_of(pages).edges[:, 14] == BORDER).sum() == 9
    same_way = Mesh(vertices[:4], np.array([[0, 1, 2], [0, 1, 3]]))
    assert (solid_of(same_way).edges[:, 14] == BORDER).sum() == 6


def test_two_bodies_that_are_convex_each():
    one = tetrahedron(1.0)
    both = Mesh(np.vstack([one.vertices, one.vertices + 5.0]), np.vstack([one.faces, one.faces + 4]))
    solid = solid_of(both)
    assert solid.closed and not solid.convex


def test_the_tree_holds_every_triangle_once_within_its_boxes():
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(37, 3, 3)) * 0.1 + rng.normal(size=(37, 1, 3)) * [1.0, 5.0, 1.0]
    triangles, nodes = ce._tree(corners)
    found, seen = [], []

    def visit(number, low, high):
        seen.append(number)
        node = nodes[number]
        assert np.all(node[0:3] >= low) and np.all(node[3:6] <= high)
        first, count = int(node[6]), int(node[7])
        if count == 0:
            return visit(first, node[0:3], node[3:6]) + visit(first + 1, node[0:3], node[3:6])
        assert 0 < count <= 4
        mine = triangles[first : first + count]
        points = np.concatenate([mine[:, :3], mine[:, :3] + mine[:, 3:6], mine[:, :3] + mine[:, 6:9]])
        np.testing.assert_allclose(points.min(axis=0), node[0:3])
        np.testing.assert_allclose(points.max(axis=0), node[3:6])
        found.extend(range(first, first + count))
        return count

    assert visit(0, -np.inf, np.inf) == 37
    assert sorted(found) == list(range(37)) and sorted(seen) == list(range(len(nodes)))
    whole = np.hstack([corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]])
    np.testing.assert_allclose(triangles[np.lexsort(triangles.T)], whole[np.lexsort(whole.T)])
    left, right = nodes[int(nodes[0, 6])], nodes[int(nodes[0, 6]) + 1]
    assert left[1] + left[4] < right[1] + right[4]  # halved along y, the longest side
    few, root = ce._tree(corners[:4])
    assert len(few) == 4 and root.shape == (1, 8) and root[0, 7] == 4.0
    assert len(ce._tree(corners[:5])[1]) == 3


def test_an_icosahedron_has_thirty_edges():
    solid = solid_of(icosahedron(1.0))
    assert len(solid.edges) == 30 and solid.convex


def test_a_mesh_of_many_faces_is_simplified_and_stays_where_it_is():
    """A ball of 81 920 faces: a closed one of 8000, nowhere three thousandths of its radius off, without a crease."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.1)
    solid = solid_of(Mesh(np.asarray(ball.vertices) + np.array([5.0, 0.0, 0.0]), np.asarray(ball.faces)))
    assert solid.closed and len(solid.triangles) == ce._MOST_FACES
    corners = np.vstack([solid.triangles[:, :3], solid.triangles[:, :3] + solid.triangles[:, 3:6]]) - [5.0, 0.0, 0.0]
    np.testing.assert_allclose(np.linalg.norm(corners, axis=1), 0.1, rtol=3e-3)
    assert not (solid.edges[:, 14].astype(int) & CREASE).any()


def test_a_simplified_mesh_has_creases_where_it_had_them():
    """A lens of two bowed sides: around its rim alone, though its facets have become coarser."""
    import trimesh

    ball = trimesh.creation.uv_sphere(radius=1.0, count=[81, 160])
    x, y, z = np.asarray(ball.vertices).T
    height = np.sqrt(2.25 - x**2 - y**2) - np.sqrt(1.25)
    lens = Mesh(0.1 * np.column_stack([x, y, np.where(np.abs(z) < 1e-6, 0.0, np.sign(z) * height)]), np.asarray(ball.faces))
    solid = solid_of(lens)
    assert solid.closed and len(lens.faces) > ce._MOST_FACES >= len(solid.triangles)
    creases = solid.edges[(solid.edges[:, 14].astype(int) & CREASE) > 0]
    assert len(creases) > 20
    np.testing.assert_allclose(np.linalg.norm(0.5 * (creases[:, :2] + creases[:, 3:5]), axis=1), 0.1, rtol=0.02)


def test_a_closed_mesh_that_cannot_be_simplified_without_holes_stays_as_it_is():
    """The flat sides of a box of 12 288 faces fall apart."""
    import trimesh

    box = trimesh.creation.box((0.2, 0.4, 0.6))
    for _ in range(5):
        box = box.subdivide()
    solid = solid_of(Mesh(np.asarray(box.vertices), np.asarray(box.faces)))
    assert solid.closed and len(solid.triangles) == 12288
