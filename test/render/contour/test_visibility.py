"""Lines of sight against cones and ellipsoids, point by point; which shapes are near; what hides a sample and lies beyond."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import single_shape
from tracker_node.geometry import se3
from tracker_node.model.shapes.primitives import Box, TruncatedCone
from tracker_node.render.contour.visibility import N_VIEW_COLUMNS, interval, nearby_shapes, ray_interval, view_shapes
from tracker_node.render.shape_arrays import CONE, ELLIPSOID, ShapeArrays
from tracker_node.render.solids import NO_HIT

# Row 1 is asked for, so that the other one would give another answer
CONES = [(0.5, 0.3, 0.4, -0.8, 1.0), (0.5, 0.3, -0.7, -0.5, 1.2), (0.4, 0.4, 0.0, 0.0, 1.0), (0.1, 0.1, 8.0, 0.0, 1.0)]
T = np.linspace(-12.0, 12.0, 48001)


def inside(kind, dims, points):
    x, y, z = points.T
    if kind == ELLIPSOID:
        return (x / dims[0]) ** 2 + (y / dims[1]) ** 2 + (z / dims[2]) ** 2 < 1.0
    a, b, k, z1, z2 = dims
    return ((x / a) ** 2 + (y / b) ** 2 < (1.0 + k * z) ** 2) & (z > z1) & (z < z2)


def rays(seed):
    rng = np.random.default_rng(seed)
    origin, target = rng.normal(size=3) * 2.0, rng.uniform(-0.5, 0.8, 3)
    way = (target - origin) / np.linalg.norm(target - origin)
    flat, upright = way * [1.0, 1.0, 0.0], np.array([0.0, 0.0, 1.0 - 2.0 * (seed % 2)])
    level = np.array([*origin[:2], target[2]])
    yield from (
        (origin, way),
        (level, flat),
        (target * [0.5, 0.3, 1.0], upright),
        (target, way),
        (origin, upright),
        (origin, flat),
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("shape", [*CONES, (0.5, 0.8, 0.3, 0.0, 0.0)])
def test_the_part_of_a_ray_that_is_inside(shape, seed):
    kind = ELLIPSOID if shape[3] == shape[4] else CONE
    dims = np.array([[9.0, 9.0, 0.01, -9.0, 9.0], shape])
    for origin, way in rays(seed):
        held = T[inside(kind, shape, origin + T[:, None] * way)]
        hit, t_in, t_out = interval(kind, dims, 1, *origin, *way)
        if len(held) > 4:
            assert hit and (t_in, t_out) == pytest.approx((held[0], held[-1]), abs=1.1e-3)
        elif len(held) == 0:
            assert not hit or t_out - t_in < 5e-3


def test_a_ray_along_a_side_of_a_cone():
    """It is as steep as the cone: the quadratic becomes a line. The cone is x^2 + y^2 = (0.5 + 0.5 z)^2."""
    dims = np.array([[0.5, 0.5, 1.0, -0.5, 3.0]])
    for sign in (1.0, -1.0):  # up and down beside the axis: enters or leaves through the side at z = -0.5 + ...
        way = sign * np.array([0.5, 0.0, 1.0])
        held = T[inside(CONE, dims[0], np.array([0.0, 0.3, 0.0]) + T[:, None] * way)]
        hit, t_in, t_out = interval(CONE, dims, 0, 0.0, 0.3, 0.0, *way)
        assert hit and (t_in, t_out) == pytest.approx((held[0], held[-1]), abs=1e-3)
    assert not interval(CONE, dims, 0, 0.0, 9.0, 0.0, 0.5, 0.0, 1.0)[0]


def test_a_ray_into_a_shape_that_is_placed():
    place, way = se3.exp(np.array([3.0, 0.1, 0.0, 0.3, 0.2, 0.1])), np.array([1.0, 0.05, 0.0])
    center = np.array([-1.0, 0.0, 0.0])
    arrays = ShapeArrays.from_model(single_shape(TruncatedCone(0.5, 0.3, 0.4, -0.8, 1.0)).model)
    local = se3.apply(se3.inverse(place), center + T[:, None] * way)
    held = T[inside(CONE, (0.5, 0.3, 0.4, -0.8, 1.0), local)]
    assert ray_interval(arrays.packed, 0, place, center, *way) == (True, *(pytest.approx(t, abs=1e-3) for t in held[[0, -1]]))
    box = ShapeArrays.from_model(single_shape(Box((1.0, 1.0, 1.0))).model)
    middle = np.eye(4)
    middle[0, 3] = 3.0
    assert ray_interval(box.packed, 0, middle, center, 1.0, 0.0, 0.0) == (True, pytest.approx(3.5), NO_HIT)
    assert not ray_interval(box.packed, 0, middle, center, -1.0, 0.0, 0.0)[0]


def test_views_by_hand():
    place = se3.exp(np.array([1.0, 2.0, 3.0, 0.4, 0.5, 0.6]))
    center, views = np.array([0.5, -1.0, 2.0]), np.zeros((2, N_VIEW_COLUMNS))
    spheres = np.array([[1.5, -1.0, 2.0, 0.5], [0.5, -1.0, 5.0, 4.0]])
    view_shapes(np.stack([place, np.eye(4)]), spheres, center, views)
    np.testing.assert_allclose(views[0, :3], se3.apply(se3.inverse(place), center[None])[0])
    np.testing.assert_allclose(views[1, :3], center)
    np.testing.assert_allclose(views[0, 3:], [1.0, 0.0, 0.0, 1.0, 0.5, 0.55, np.sqrt(1.0 - 0.55**2)])
    np.testing.assert_allclose(views[1, 3:], [0.0, 0.0, 3.0, 9.0, 4.0, 1.0, 0.0])  # the camera is within it


@pytest.mark.parametrize("distance", [1.0, 3.0])
def test_shapes_are_near_where_their_spheres_overlap_in_the_image(distance):
    """A sphere that covers asin(0.33) and one of asin(0.22): 19.3 and 12.7 degrees, so 32 between their middles."""
    for axis in range(3):
        for degrees, near in ((31.5, True), (32.5, False), (100.0, False)):
            a, out = np.radians(degrees), np.zeros(3, dtype=np.int64)
            forward, side = np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            way = np.cos(a) * forward + np.sin(a) * side
            spheres = np.array([[*(-forward), 0.1], [*forward, 0.3], [*(distance * way), 0.2 * distance]])
            views = np.zeros((3, N_VIEW_COLUMNS))
            view_shapes(np.stack([np.eye(4)] * 3), spheres, np.zeros(3), views)
            assert nearby_shapes(views, 1, out) == (1 if near else 0)
            assert not near or out[0] == 2
            assert nearby_shapes(views, 2, out) == (1 if near else 0)
