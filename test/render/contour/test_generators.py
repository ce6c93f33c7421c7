"""Contour generators: on the surface, tangent to the line of sight, and moving as their analytic velocity says."""

import numpy as np
import pytest

from helpers.bodies.contours import contour_points
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone
from tracker_node.render.contour import generators as contour
from tracker_node.render.contour.visibility import ray_interval
from tracker_node.render.shape_arrays import ShapeArrays

CONE = TruncatedCone(0.08, 0.05, -0.6, -0.1, 0.3)
ELLIPSOID = Ellipsoid((0.05, 0.12, 0.2))


def arrays_of(primitive):
    return ShapeArrays.from_model(ArticulatedModel("m", KinematicChain(("a",), ()), (Shape("s", "a", primitive),)), caps=False)


def random_pose(rng):
    return se3.from_rotation_translation(so3.exp(rng.normal(size=3)), rng.normal(size=3) * 0.5)


def surface_value(primitive, points):
    """Zero on the surface: the implicit equation, written independently of the kernels."""
    if isinstance(primitive, Ellipsoid):
        return np.sum((points / np.array(primitive.radii)) ** 2, axis=1) - 1
    width = 1 + primitive.k * points[:, 2]
    return (points[:, 0] / primitive.a) ** 2 + (points[:, 1] / primitive.b) ** 2 - width**2


def surface_gradient(primitive, points, step=1e-6):
    columns = [
        (surface_value(primitive, points + d) - surface_value(primitive, points - d)) / (2 * step) for d in np.eye(3) * step
    ]
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("primitive", [CONE, ELLIPSOID])
@pytest.mark.parametrize("seed", range(20))
def test_generator_lies_on_the_surface_and_is_tangent_to_sight(primitive, seed):
    rng = np.random.default_rng(seed)
    T, center = random_pose(rng), rng.normal(size=3) * 3 + np.array([0, 0, 4.0])
    rows = contour_points(arrays_of(primitive), T[None], 0, center, 10)
    assert len(rows) == 20
    local = se3.apply(se3.inverse(T), rows[:, :3])
    assert np.abs(surface_value(primitive, local)).max() < 1e-9
    gradient = surface_gradient(primitive, local) @ T[:3, :3].T
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    sight = rows[:, :3] - center
    assert np.abs(np.sum(gradient * sight, axis=1)).max() < 1e-8
    assert np.abs(gradient - rows[:, contour.NORMAL : contour.NORMAL + 3]).max() < 1e-8


@pytest.mark.parametrize("primitive", [CONE, ELLIPSOID])
@pytest.mark.parametrize("seed", range(20))
def test_velocity_matches_finite_differences(primitive, seed):
    """Cone: each generator point's own velocity. Ellipsoid: the points' labels turn about the sight line, so the part of
    the velocity across the contour is compared."""
    rng = np.random.default_rng(seed)
    T, center = random_pose(rng), rng.normal(size=3) * 3 + np.array([0, 0, 4.0])
    twist, step = rng.normal(size=6), 1e-6
    arrays = arrays_of(primitive)

    def moved(sign):
        return contour_points(arrays, (se3.exp(sign * step * twist) @ T)[None], 0, center, 8)[:, :3]

    rows = contour_points(arrays, T[None], 0, center, 8)
    p, d, m = rows[:, :3], rows[:, contour.SLIDE : contour.SLIDE + 3], rows[:, contour.M : contour.M + 3]
    at_center = twist[:3] + np.cross(twist[3:], center)
    analytic = twist[:3] + np.cross(twist[3:], p) + d * (m @ at_center)[:, None]
    numeric = (moved(1) - moved(-1)) / (2 * step)
    if primitive is CONE:
        assert np.abs(analytic - numeric).max() < 1e-7 * max(1, np.abs(numeric).max())
    else:
        tangent = np.roll(p, -1, axis=0) - np.roll(p, 1, axis=0)
        # exact tangent of the planar conic: across the normal and the plane's normal direction
        local = se3.apply(se3.inverse(T), p) / np.array(ELLIPSOID.radii)
        eye = (T[:3, :3].T @ (center - T[:3, 3])) / np.array(ELLIPSOID.radii)
        tangent = (np.cross(eye, local) * np.array(ELLIPSOID.radii)) @ T[:3, :3].T
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        difference = analytic - numeric
        along = np.sum(difference * tangent, axis=1)[:, None] * tangent
        assert np.abs(difference - along).max() < 1e-6 * max(1, np.abs(numeric).max())


def test_no_contour_from_inside():
    for primitive in (CONE, ELLIPSOID):
        assert len(contour_points(arrays_of(primitive), np.eye(4)[None], 0, np.zeros(3), 5)) == 0


@pytest.mark.parametrize("primitive", [CONE, TruncatedCone(0.05, 0.05, 5.0, 0.0, 0.1), ELLIPSOID])
def test_ray_interval_against_marching(primitive):
    rng = np.random.default_rng(3)
    arrays = arrays_of(primitive)
    hits = 0
    for _ in range(300):
        T, center = random_pose(rng), rng.normal(size=3) * 2
        target = T[:3, 3] + rng.normal(size=3) * 0.12
        direction = target - center
        hit, t_in, t_out = ray_interval(arrays.packed, 0, T, center, *direction)
        t = np.linspace(-0.5, 2.0, 5001)
        local = se3.apply(se3.inverse(T), center + t[:, None] * direction)
        inside = surface_value(primitive, local) < 0
        if isinstance(primitive, TruncatedCone):
            inside &= (local[:, 2] > primitive.z1) & (local[:, 2] < primitive.z2)
        if inside.sum() > 1:
            hits += 1
            assert hit
            assert abs(t_in - t[inside][0]) < 1.1e-3 and abs(t_out - t[inside][-1]) < 1.1e-3
        elif not inside.any() and hit:
            assert t_out - t_in < 1.1e-3 or t_in > 1.99 or t_out < -0.49
    assert hits > 25
