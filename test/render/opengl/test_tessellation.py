"""Triangles of the primitives against their equations."""

import math

import numpy as np
import pytest

from helpers.cameras.render_scenes import tetrahedron
from tracker_node.model.shapes.primitives import BOX_FACES, Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.render.opengl.tessellation import MESH_CELLS, tessellate

RED = (255, 0, 0)
CONES = [
    TruncatedCone(0.2, 0.1, -0.8, -0.2, 0.9),
    TruncatedCone(0.05, 0.3, 0.0, 0.0, 0.4),
    TruncatedCone(0.1, 0.1, 2.0, -0.4, 0.3),
]


def enclosed_volume(patches):
    """Volume by the divergence theorem; positive if the triangles are counter-clockwise from outside."""
    return sum(np.linalg.det(patch.vertices[patch.faces]).sum() / 6.0 for patch in patches)


def assert_normals_face_out(patch):
    corners = patch.vertices[patch.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(flat, axis=1, keepdims=True)
    flat, solid = flat / np.maximum(area, 1e-20), area[:, 0] > 1e-12
    assert np.allclose(np.linalg.norm(patch.normals, axis=1), 1.0)
    assert (np.einsum("mi,mki->mk", flat, patch.normals[patch.faces])[solid] > 0.95).all()


def test_ellipsoids_keep_volume_surface_and_normals():
    radii = np.array([0.1, 0.25, 0.4])
    (patch,) = tessellate(Ellipsoid(tuple(radii)), RED)
    assert enclosed_volume([patch]) == pytest.approx(4.0 / 3.0 * math.pi * radii.prod(), rel=1e-9)
    assert np.allclose(((patch.vertices / radii) ** 2).sum(axis=1), 1.0, atol=2e-3)
    gradient = patch.vertices / radii**2
    assert np.allclose(patch.normals, gradient / np.linalg.norm(gradient, axis=1, keepdims=True))
    assert (patch.colors == (1.0, 0.0, 0.0)).all()
    assert_normals_face_out(patch)


@pytest.mark.parametrize("cone", CONES)
def test_cones_keep_volume_surface_and_normals(cone):
    (patch,) = tessellate(cone, RED)
    z = np.linspace(cone.z1, cone.z2, 20_001)
    area = math.pi * cone.a * cone.b * (1.0 + cone.k * z) ** 2
    assert enclosed_volume([patch]) == pytest.approx(np.trapezoid(area, z), rel=1e-6)
    x, y, z = patch.vertices.T
    side = np.abs(patch.normals[:, 2]) < 0.99
    form = (x / cone.a) ** 2 + (y / cone.b) ** 2 - (1.0 + cone.k * z) ** 2
    assert np.abs(form[side] / (1.0 + cone.k * z[side]) ** 2).max() < 2e-3
    gradient = np.column_stack([x / cone.a**2, y / cone.b**2, -cone.k * (1.0 + cone.k * z)])[side]
    assert np.allclose(patch.normals[side], gradient / np.linalg.norm(gradient, axis=1, keepdims=True), atol=2e-3)
    caps = patch.vertices[~side]
    assert set(np.round(caps[:, 2], 12)) == {cone.z1, cone.z2}
    assert_normals_face_out(patch)


def test_every_face_of_a_box_is_where_and_as_its_name_says():
    size = np.array([0.3, 0.2, 0.5])
    colors = np.arange(18).reshape(6, 3)
    pictures = tuple(np.full((2, 3, 3), i, np.uint8) if i != 4 else None for i in range(6))
    patches = tessellate(Box(tuple(size), colors, pictures), RED)
    assert enclosed_volume(patches) == pytest.approx(size.prod())
    for i, (name, patch) in enumerate(zip(BOX_FACES, patches, strict=True)):
        axis, sign = "xyz".index(name[1]), float(name[0] + "1")
        assert np.allclose(patch.vertices[:, axis], 0.5 * sign * size[axis])
        assert np.allclose(patch.normals, sign * np.eye(3)[axis])
        assert np.allclose(patch.colors, colors[i] / 255.0)
        assert_normals_face_out(patch)
        assert patch.texture is pictures[i] or (patch.texture == pictures[i]).all()


@pytest.mark.parametrize(
    ("face", "upper_right"),
    # Standing before the face with z (for the last two: y) upward, this is the corner above to the right
    [("+x", (1, 1, 1)), ("-x", (-1, -1, 1)), ("+y", (-1, 1, 1)), ("-y", (1, -1, 1)), ("+z", (1, 1, 1)), ("-z", (-1, 1, -1))],
)
def test_pictures_are_upright_on_a_box(face, upper_right):
    size, pictures = np.array([0.3, 0.2, 0.5]), (np.zeros((2, 2, 3), np.uint8),) * 6
    patch = tessellate(Box(tuple(size), None, pictures), RED)[BOX_FACES.index(face)]
    at = np.flatnonzero((patch.uv == (1.0, 1.0)).all(axis=1))
    assert len(at) == 1
    assert np.allclose(patch.vertices[at[0]], 0.5 * size * upper_right)


def test_meshes_are_divided_without_a_change():
    rng = np.random.default_rng(2)
    plain = tetrahedron(0.3)
    matrix = rng.normal(size=(3, 2))
    mesh = Mesh(plain.vertices, plain.faces, uv=(plain.vertices @ matrix)[plain.faces], texture=np.zeros((4, 4, 3), np.uint8))
    (patch,) = tessellate(mesh, RED)
    corners = patch.vertices[patch.faces]
    diagonal = np.linalg.norm(np.ptp(plain.vertices, axis=0))
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= diagonal / MESH_CELLS * (1 + 1e-6)
    assert enclosed_volume([patch]) == pytest.approx(np.linalg.det(plain.vertices[plain.faces]).sum() / 6.0, rel=1e-5)
    assert np.allclose(patch.uv, patch.vertices @ matrix, atol=1e-6)
    assert patch.two_sided
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.allclose(patch.normals[patch.faces], flat[:, None], atol=1e-4)  # shaded flat


def test_colors_of_corners_go_before_those_of_faces_and_both_before_the_shapes():
    plain = tetrahedron(0.3)
    of_faces, of_corners = np.arange(12).reshape(4, 3) * 20, np.arange(12).reshape(4, 3) * 10
    (patch,) = tessellate(Mesh(plain.vertices, plain.faces, face_colors_rgb=of_faces), RED)
    drawn = np.round(255 * patch.colors[patch.faces]).astype(int)
    assert (drawn == drawn[:, :1]).all()
    assert {tuple(c) for c in drawn[:, 0]} == {tuple(c) for c in of_faces}
    (patch,) = tessellate(Mesh(plain.vertices, plain.faces, face_colors_rgb=of_faces, vertex_colors_rgb=of_corners), RED)
    for vertex, color in zip(plain.vertices, of_corners, strict=True):
        at = np.linalg.norm(patch.vertices - vertex, axis=1) < 1e-6
        assert at.any() and np.allclose(patch.colors[at], color / 255.0, atol=1e-6)
