"""Round cones within meshes, against the solid angle of all triangles and the distances of all vertices."""

import numpy as np
import pytest
import trimesh

from helpers.bodies.mesh_solids import ball, box, cone, is_inside, joined, outer_vertices, rod
from tracker_node.geometry import so3
from tracker_node.model.humans.segments18 import nurbs_human
from tracker_node.model.shapes.capsules import capsules_in_mesh
from tracker_node.model.shapes.primitives import END, END_RADIUS, N_CAPSULE, START, START_RADIUS, Mesh, point_gaps


def turned(mesh: Mesh, rotation, shift=(0.0, 0.0, 0.0)) -> Mesh:
    return Mesh(mesh.vertices @ so3.exp(rotation).T + shift, mesh.faces)


def robot_link() -> Mesh:
    """A tube with a motor across either end, the parts running through each other."""
    motors = rod(0.06, (0.0, -0.08, 0.0), (0.0, 0.08, 0.0)), rod(0.05, (0.4, -0.02, 0.0), (0.4, 0.12, 0.0))
    return joined(*motors, rod(0.04, (0.0, 0.0, 0.0), (0.4, 0.0, 0.0)))


BEAM = joined(box((0.5, 0.08, 0.06)))
# Its grid's cells are stretched, and its triangles as long as it is
SLENDER = joined(trimesh.creation.revolve([[0.0, 0.0], [0.02, 0.0], [0.008, 1.5], [0.0, 1.5]], sections=5))
BODY = {shape.name: shape.primitive for shape in nurbs_human(24, 0.03).shapes}
# name: mesh, and the least share of its volume that must be within round cones
MESHES = {
    "ball": (joined(ball((0.1, 0.1, 0.1))), 0.9),
    "egg": (joined(ball((0.06, 0.08, 0.2))), 0.6),
    "cone": (joined(cone(0.09, 0.05, 0.4)), 0.75),
    "slender": (turned(SLENDER, (0.4, -0.7, 0.5)), 0.6),
    "beam": (BEAM, 0.6),
    "oblique beam": (turned(BEAM, (0.4, -0.7, 0.5), (3.0, -2.0, 1.0)), 0.6),
    "elbow": (joined(box((0.4, 0.08, 0.08), (0.2, 0.0, 0.0)), box((0.08, 0.08, 0.3), (0.36, 0.0, 0.15))), 0.5),
    "link": (robot_link(), 0.55),
    "thigh": (BODY["left_thigh"], 0.7),
    "pelvis": (BODY["pelvis"], 0.6),
    "head": (BODY["head"], 0.7),
    "foot": (BODY["right_foot"], 0.6),
}  # fmt: skip


def gaps(capsules: np.ndarray, points: np.ndarray) -> np.ndarray:
    result = np.empty(len(points))
    point_gaps(capsules, points, result)
    return result


def on_axes(capsules: np.ndarray, n: int = 15) -> tuple[np.ndarray, np.ndarray]:
    """Centers and radii of spheres all along round cones."""
    share = np.linspace(0.0, 1.0, n)[:, None, None]
    balls = (1.0 - share) * capsules[:, START : START + 4] + share * capsules[:, END : END + 4]
    return balls[..., :3].reshape(-1, 3), balls[..., 3].ravel()


@pytest.mark.parametrize("name", MESHES)
def test_they_lie_within_the_mesh(name):
    """Their axes are inside, and no vertex is deeper within them than a sixtieth of the mesh's size."""
    mesh, _ = MESHES[name]
    capsules = capsules_in_mesh(mesh)
    assert 1 <= len(capsules) <= 5 and (capsules[:, [START_RADIUS, END_RADIUS]] > 0.0).all()
    assert is_inside(mesh, on_axes(capsules)[0]).all()
    assert gaps(capsules, outer_vertices(mesh)).min() > -np.linalg.norm(np.ptp(mesh.vertices, axis=0)) / 60.0


def distances(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Of points from the nearest triangle."""
    triangles = mesh.vertices[mesh.faces]
    nearest = (trimesh.triangles.closest_point(triangles, np.broadcast_to(point, (len(triangles), 3))) for point in points)
    return np.array([np.linalg.norm(on - point, axis=1).min() for on, point in zip(nearest, points, strict=True)])


@pytest.mark.parametrize("name", ["ball", "egg", "cone", "slender", "oblique beam", "thigh", "foot"])
def test_their_spheres_hardly_stick_out(name):
    """By a 25th of their radius at most, wherever the triangles have their vertices."""
    centers, radii = on_axes(capsules_in_mesh(MESHES[name][0]))
    assert (radii <= 1.04 * distances(MESHES[name][0], centers)).all()


@pytest.mark.parametrize("name", MESHES)
def test_they_fill_the_mesh(name):
    """By volume, counted with random points."""
    mesh, share = MESHES[name]
    points = np.random.default_rng(0).uniform(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), (1500, 3))
    points = points[is_inside(mesh, points)]
    assert (gaps(capsules_in_mesh(mesh), points) < 0.0).mean() > share


def test_the_inside_of_an_elbow_stays_free():
    """A convex hull would fill it."""
    capsules = capsules_in_mesh(MESHES["elbow"][0])
    free = np.array([[x, 0.0, z] for x in (0.05, 0.15, 0.25) for z in (0.1, 0.2, 0.28)])
    assert gaps(capsules, free).min() > 0.03
    assert gaps(capsules, np.array([[0.05, 0.0, 0.0], [0.36, 0.0, 0.27]])).max() < 0.0


def test_it_is_the_distance_that_vertices_have():
    """Of a point beyond the mesh: as far from the round cones as from the nearest vertex, or a little farther."""
    rng = np.random.default_rng(3)
    for name in ("cone", "thigh", "link"):
        mesh, _ = MESHES[name]
        middle, size = mesh.vertices.mean(axis=0), np.linalg.norm(np.ptp(mesh.vertices, axis=0))
        directions = rng.normal(size=(200, 3))
        points = middle + 0.8 * size * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        nearest = np.array([np.linalg.norm(mesh.vertices - point, axis=1).min() for point in points])
        more = gaps(capsules_in_mesh(mesh), points) - nearest
        assert more.min() > -size / 40.0
        assert np.median(more) < size / 20.0


def test_triangles_need_not_be_in_order():
    """Loose triangles, faces that look inward, and an open end change little or nothing."""
    mesh = MESHES["cone"][0]
    inside = np.array([[0.0, 0.0, z] for z in (0.1, 0.2, 0.3)])
    expected = capsules_in_mesh(mesh)
    loose = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    inward = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    for same in (loose, inward):
        np.testing.assert_allclose(gaps(capsules_in_mesh(same), inside), gaps(expected, inside), atol=2e-3)
    sides = ~(mesh.vertices[mesh.faces][:, :, 2] > 0.4 - 1e-9).all(axis=1)
    tube = capsules_in_mesh(Mesh(mesh.vertices, mesh.faces[sides]))
    np.testing.assert_allclose(gaps(tube, inside), gaps(expected, inside), atol=0.01)


def test_thin_walls_around_a_cavity_count_as_solid():
    outer, inner = trimesh.creation.icosphere(3, 0.1), trimesh.creation.icosphere(3, 0.097)
    inner.invert()
    (row, *_) = capsules_in_mesh(joined(outer, inner))
    assert max(row[START_RADIUS], row[END_RADIUS]) > 0.085


def test_the_hole_of_a_ring_stays_free():
    made = trimesh.creation.torus(0.2, 0.03)
    capsules = capsules_in_mesh(Mesh(made.vertices, made.faces))
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 9), np.linspace(-0.1, 0.1, 9))
    assert gaps(capsules, np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])).min() > 0.0
    assert (gaps(capsules, np.array([[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [-0.2, 0.0, 0.0], [0.0, -0.2, 0.0]])) < 0.0).any()


def test_they_go_with_the_mesh():
    rotation, shift = (0.3, 1.0, -0.4), np.array([1.0, 2.0, 3.0])
    mesh = MESHES["beam"][0]
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (200, 3))
    moved = gaps(capsules_in_mesh(turned(mesh, rotation, shift)), points @ so3.exp(rotation).T + shift)
    np.testing.assert_allclose(moved, gaps(capsules_in_mesh(mesh), points), atol=0.02)


def test_a_second_time_they_are_the_same():
    mesh = MESHES["link"][0]
    np.testing.assert_array_equal(capsules_in_mesh(mesh), capsules_in_mesh(Mesh(mesh.vertices, mesh.faces)))


SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.mark.parametrize("vertices, faces", [
    (np.zeros((0, 3)), np.zeros((0, 3))), (SQUARE, np.zeros((0, 3))), (SQUARE, [[0, 1, 2], [0, 2, 3]]), (SQUARE, [[0, 0, 0]]),
    (SQUARE, [[0, 1, 1]]), (np.zeros((3, 3)), [[0, 1, 2]]), (SQUARE @ so3.exp([0.3, 0.4, 0.5]).T, [[0, 1, 2], [0, 2, 3]]),
], ids=["empty", "no faces", "flat", "point", "line", "one place", "flat and oblique"])  # fmt: skip
def test_what_has_no_volume_has_none(vertices, faces):
    assert capsules_in_mesh(Mesh(vertices, faces)).shape == (0, N_CAPSULE)


@pytest.mark.parametrize("size", [(1.0, 0.008, 0.008), (0.5, 0.3, 0.002), (1e-4, 1e-4, 3e-4), (900.0, 300.0, 300.0)])
def test_wires_plates_and_odd_units(size):
    """However thin: the radius is half of the thickness, and the length that of the mesh."""
    mesh = joined(trimesh.creation.box(size))
    capsules = capsules_in_mesh(mesh)
    centers, radii = on_axes(capsules)
    assert radii.max() == pytest.approx(0.5 * min(size), rel=0.02)
    assert (np.abs(centers) + radii[:, None] <= 0.5 * np.array(size) * 1.001).all()
    assert np.ptp(centers[:, int(np.argmax(size))]) > 0.6 * max(size)
