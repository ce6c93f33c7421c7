"""Lofted solids: geomdl evaluates the same surface from the same control points, and simple solids have their volumes."""

import numpy as np
import pytest
from geomdl import NURBS
from hypothesis import given, settings
from hypothesis import strategies as st

from tracker_node.model.humans.segments18 import SEGMENTS, body_lofts
from tracker_node.model.shapes.nurbs import DEGREE, Loft, Section, loft_mesh, loft_surface, stadium_points

CYLINDER = Loft((Section(-0.2, 0.05, 0.05), Section(0.1, 0.05, 0.05)), (0.05, 0.05))
BENT = Loft((Section(0.0, 0.05, 0.08), Section(0.1, 0.09, 0.04, 0.02, -0.01), Section(0.15, 0.03, 0.03)), (0.02, 0.03))


def volume_of(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def geomdl_surface(surface):
    """The same rational surface, all weights one, in the words of geomdl."""
    other = NURBS.Surface(normalize_kv=False)
    other.degree_u = other.degree_v = DEGREE
    n, m, _ = surface.control.shape
    other.ctrlpts_size_u, other.ctrlpts_size_v = n, m
    other.ctrlptsw = np.concatenate([surface.control, np.ones((n, m, 1))], axis=2).reshape(-1, 4).tolist()
    other.knotvector_u = surface.knots_along.tolist()
    other.knotvector_v = surface.knots_around.tolist()
    return other


@pytest.mark.parametrize("loft", [CYLINDER, BENT, body_lofts()["head"][0], body_lofts()["left_foot"][0]], ids=range(4))
def test_geomdl_finds_the_same_points_and_derivatives(loft):
    surface = loft_surface(loft)
    oracle = geomdl_surface(surface)
    u, v = np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 7)[:-1]
    points, along, around = surface.evaluate(u, v), surface.evaluate(u, v, du=1), surface.evaluate(u, v, dv=1)
    for i in range(len(u)):
        for j in range(len(v)):
            expected = oracle.derivatives(float(u[i]), float(v[j]), order=1)
            assert np.allclose(points[i, j], expected[0][0], rtol=0, atol=1e-9)
            assert np.allclose(along[i, j], expected[1][0], rtol=0, atol=1e-8)
            assert np.allclose(around[i, j], expected[0][1], rtol=0, atol=1e-8)


@given(st.floats(0.05, 0.2), st.floats(0.05, 0.2))
@settings(max_examples=40)
def test_stadium_points_lie_on_the_stadium_at_equal_distances(half_x, half_y):
    points = stadium_points(half_x, half_y, 400)
    radius, flat = min(half_x, half_y), abs(half_x - half_y)
    spine = np.clip(points * ([1, 0] if half_x > half_y else [0, 1]), -flat, flat)  # nearest point of the middle line
    assert np.allclose(np.linalg.norm(points - spine, axis=1), radius, atol=1e-12)
    steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
    assert np.isclose(steps.sum(), 2.0 * np.pi * radius + 4.0 * flat, rtol=1e-3)
    assert steps.max() / steps.min() < 1.01
    assert np.allclose(points[[0, 100, 200, 300]], [[half_x, 0], [0, half_y], [-half_x, 0], [0, -half_y]], atol=1e-12)
    assert points[1, 1] > 0.0  # counter-clockwise


def test_the_surface_goes_through_its_sections():
    surface = loft_surface(BENT)
    u = np.linspace(0.0, 1.0, 4001)
    line = surface.evaluate(u, np.array([0.0, 0.25, 0.5, 0.75]))
    for section in BENT.sections:
        i = np.argmin(np.abs(line[:, 0, 2] - section.z))
        expected = [
            section.x + section.half_x,
            section.y + section.half_y,
            section.x - section.half_x,
            section.y - section.half_y,
        ]
        assert np.allclose([line[i, 0, 0], line[i, 1, 1], line[i, 2, 0], line[i, 3, 1]], expected, atol=1e-4)


def test_a_cylinder_with_round_ends_has_its_volume_and_its_normals():
    mesh = loft_mesh(CYLINDER, 128, 0.005)
    assert np.isclose(volume_of(mesh), np.pi * 0.05**2 * 0.3 + 4.0 / 3.0 * np.pi * 0.05**3, rtol=5e-3)
    axis = np.clip(mesh.vertices[:, 2], -0.2, 0.1)[:, None] * [0.0, 0.0, 1.0]
    outward = (mesh.vertices - axis) / 0.05
    lengths = np.linalg.norm(outward, axis=1)
    assert np.allclose(lengths, 1.0, atol=0.015)  # where dome and side meet the curvature jumps, which a spline's cannot
    assert (np.sum(mesh.normals * outward, axis=1) / lengths).min() > np.cos(np.deg2rad(6.0))


@pytest.mark.parametrize("name", SEGMENTS[:11])
def test_segments_are_closed_and_their_normals_point_outward(name):
    mesh = loft_mesh(body_lofts()[name][0])
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)  # each directed edge once ...
    assert {tuple(e) for e in edges.tolist()} == {(b, a) for a, b in edges.tolist()}  # ... and back once: closed
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
    assert np.einsum("ij,ikj->ik", flat, mesh.normals[mesh.faces]).min() > 0.8
    assert volume_of(mesh) > 0.0


@pytest.mark.parametrize("make", [
    lambda: Section(0.0, 0.0, 0.1),
    lambda: Loft((Section(0.0, 0.1, 0.1),), (0.1, 0.1)),
    lambda: Loft((Section(0.1, 0.1, 0.1), Section(0.0, 0.1, 0.1)), (0.1, 0.1)),
    lambda: Loft((Section(0.0, 0.1, 0.1), Section(0.1, 0.1, 0.1)), (0.0, 0.1)),
])  # fmt: skip
def test_what_is_no_solid_is_refused(make):
    with pytest.raises(ValueError, match="expected"):
        make()
