"""Distances of surfaces: of spheres and boxes known beforehand, and of the two humans, which must differ."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from tracker_node.experiments.somersault.scene import (
    distance_table,
    point_distances,
    segment_distances,
    surface_ellipsoids,
)
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.humans.segments18 import ellipsoid_human, nurbs_human
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid


def body(*primitives, offset=0.0):
    T = np.eye(4)
    T[0, 3] = offset
    shapes = tuple(Shape(f"part{i}", "base", primitive, T) for i, primitive in enumerate(primitives))
    return ArticulatedModel("body", KinematicChain(("base",), ()), shapes)


def test_concentric_spheres_are_as_far_apart_as_their_radii():
    (row,) = segment_distances(body(Ellipsoid((0.1, 0.1, 0.1))), body(Ellipsoid((0.12, 0.12, 0.12))))
    assert np.allclose([row.mean_mm, row.max_mm, row.back_mean_mm, row.back_max_mm], 20.0, atol=0.2)


def test_a_moved_sphere_is_half_its_way_off_on_average():
    """A point of a sphere at angle t from the motion d is |d cos t| off, to first order: half of d on average, d at most."""
    (row,) = segment_distances(body(Ellipsoid((0.5, 0.5, 0.5))), body(Ellipsoid((0.5, 0.5, 0.5)), offset=0.010))
    assert np.isclose(row.mean_mm, 5.0, atol=0.2)
    assert np.isclose(row.max_mm, 10.0, atol=0.2)


def test_points_against_triangles_agree_with_a_numerical_search():
    rng = np.random.default_rng(0)
    triangles, points = rng.normal(size=(5, 3, 3)), rng.normal(size=(20, 3))
    found = point_distances(points, triangles)
    for point, distance in zip(points, found, strict=True):
        best = np.inf
        for a, b, c in triangles:
            result = minimize(
                lambda w, a=a, b=b, c=c, point=point: np.sum((a + w[0] * (b - a) + w[1] * (c - a) - point) ** 2), [0.3, 0.3],
                bounds=[(0, 1), (0, 1)], constraints={"type": "ineq", "fun": lambda w: 1.0 - w.sum()}, tol=1e-14, method="SLSQP",
            )  # fmt: skip
            best = min(best, float(np.sqrt(result.fun)))
        assert np.isclose(distance, best, atol=1e-5)


def test_the_two_humans_differ_as_a_measured_and_an_ellipsoid_body_do():
    measured, ellipsoids = (replace(model, shapes=model.shapes[:12]) for model in (nurbs_human(24, 0.03), ellipsoid_human()))
    rows = segment_distances(measured, ellipsoids)
    for row in rows:
        assert 2.0 < row.mean_mm < 15.0, row
        assert row.max_mm > 2.0 * row.mean_mm
    assert 5.0 < np.mean([row.mean_mm for row in rows]) < 10.0
    assert rows[4].segment == "left_shoulder" and rows[11].segment == "right_shoulder"
    assert np.isclose(rows[4].mean_mm, rows[11].mean_mm, atol=0.1)


def test_the_ellipsoid_nearest_to_one_is_itself():
    """Wherever it is, from the triangles of its surface alone."""
    given = body(Ellipsoid((0.05, 0.08, 0.2)), offset=0.3)
    (shape,) = surface_ellipsoids(given).shapes
    assert np.allclose(shape.primitive.radii, (0.05, 0.08, 0.2), atol=0.0006)  # the triangles' centers lie within it
    assert np.allclose(shape.T_link_shape, given.shapes[0].T_link_shape, atol=1e-4)


def test_ellipsoids_by_the_surface_are_nearer_to_it_than_those_of_its_moments():
    measured = nurbs_human(24, 0.03)
    nearest, moments = (
        np.mean([row.back_mean_mm for row in segment_distances(ellipsoids, measured)])
        for ellipsoids in (surface_ellipsoids(measured), ellipsoid_human())
    )
    assert nearest < 0.95 * moments
    radii = {shape.name: shape.primitive.radii for shape in surface_ellipsoids(measured).shapes}
    assert radii["left_thigh"] == pytest.approx(radii["right_thigh"], abs=2e-4)


def test_the_table_names_every_segment_and_ends_with_the_whole():
    one = body(Ellipsoid((0.1, 0.1, 0.1)), Ellipsoid((0.2, 0.2, 0.2)))
    lines = distance_table(one, body(Ellipsoid((0.12, 0.12, 0.12)), Ellipsoid((0.21, 0.21, 0.21)))).splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["part0", "part1", "all"]
    assert [float(v) for v in lines[-1].split()[1:]] == pytest.approx([15.0, 20.0, 15.0, 20.0], abs=0.2)


def test_bodies_that_do_not_match_are_refused():
    with pytest.raises(ValueError, match="part1"):
        segment_distances(body(Ellipsoid((0.1, 0.1, 0.1))), body(Ellipsoid((0.1, 0.1, 0.1)), Ellipsoid((0.1, 0.1, 0.1))))
