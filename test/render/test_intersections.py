"""Rays against boxes and meshes, by hand and against every triangle."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import icosahedron, single_shape
from tracker_node.geometry import se3
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.render.shape_arrays import ShapeArrays
from tracker_node.render.solids import NO_HIT, mesh_hit, slab_interval, solid_hit, to_shape, triangle_hit

NODE = np.array([-1.0, -2.0, -3.0, 1.0, 2.0, 3.0, 0.0, 1.0])


def test_a_ray_in_the_frame_of_a_shape():
    rng = np.random.default_rng(0)
    T, center, way = se3.exp(rng.normal(size=6)), rng.normal(size=3), rng.normal(size=3)
    ray = np.array(to_shape(T, center, *way))
    np.testing.assert_allclose(ray[:3], se3.apply(se3.inverse(T), center[None])[0])
    np.testing.assert_allclose(ray[3:], T[:3, :3].T @ way)


@pytest.mark.parametrize("axis", range(3))
def test_slabs(axis):
    def interval(origin, speed, t_min=0.0, t_max=100.0, other=0.0):
        o, v = np.full(3, other), np.zeros(3)
        o[axis], v[axis] = origin, speed
        return tuple(slab_interval(NODE, (*o, *v), t_min, t_max))

    half = axis + 1.0
    assert interval(-5.0, 2.0) == pytest.approx(((5.0 - half) / 2.0, (5.0 + half) / 2.0))
    assert interval(5.0, -2.0) == pytest.approx(((5.0 - half) / 2.0, (5.0 + half) / 2.0))
    assert interval(0.0, 1.0) == pytest.approx((0.0, half))
    assert interval(-5.0, 1.0, t_max=5.0) == pytest.approx((5.0 - half, 5.0))
    for missed in (interval(-5.0, 1.0, t_max=1.0), interval(-5.0, -1.0), interval(5.0, 1.0)):
        assert missed == (1.0, 0.0)
    assert interval(-5.0, 1.0, other=0.5)[0] == pytest.approx(5.0 - half)
    sideways = np.zeros(3)
    sideways[(axis + 1) % 3] = 1.0
    for origin, hit in ((half + 0.1, False), (-half - 0.1, False), (half, True), (-half, True)):
        o = np.zeros(3)
        o[axis] = origin
        t_in, t_out = slab_interval(NODE, (*o, *sideways), 0.0, 100.0)
        assert (t_in <= t_out) == hit


TRIANGLE = np.array([1.0, 1.0, 5.0, 2.0, 0.0, 0.0, 0.0, 4.0, 0.0])  # at z = 5, two wide, four high


@pytest.mark.parametrize(
    ("x", "y", "hit"),
    [(1.5, 1.5, True), (0.9, 1.5, False), (1.5, 0.9, False), (2.9, 1.1, True), (3.1, 0.999, False), (3.1, 1.0, False),
     (1.1, 4.7, True), (1.1, 4.9, False), (2.1, 3.1, False), (2.0, 2.9, True), (1.0, 5.1, False)],
)  # fmt: skip
def test_a_triangle_is_met_from_either_side(x, y, hit):
    assert triangle_hit(TRIANGLE, (x, y, 1.0, 0.0, 0.0, 2.0)) == (pytest.approx(2.0) if hit else NO_HIT)
    assert triangle_hit(TRIANGLE, (x, y, 9.0, 0.0, 0.0, -1.0)) == (pytest.approx(4.0) if hit else NO_HIT)
    assert triangle_hit(TRIANGLE, (x, y, 9.0, 0.0, 0.0, 1.0)) == (pytest.approx(-4.0) if hit else NO_HIT)


def test_a_triangle_that_is_seen_edge_on():
    assert triangle_hit(TRIANGLE, (0.0, 1.5, 5.0, 1.0, 0.0, 0.0)) == NO_HIT


@pytest.mark.parametrize("seed", range(8))
def test_a_slanted_triangle(seed):
    rng = np.random.default_rng(seed)
    a, b, c, origin = rng.normal(size=(4, 3))
    triangle = np.concatenate([a, b - a, c - a])
    for share in ((0.2, 0.3), (0.7, 0.2), (0.7, 0.4), (-0.1, 0.5), (0.5, -0.1), (1.1, 0.1)):
        target = a + share[0] * (b - a) + share[1] * (c - a)
        t = triangle_hit(triangle, (*origin, *(0.5 * (target - origin))))
        assert t == (pytest.approx(2.0) if min(share) > 0.0 and sum(share) < 1.0 else NO_HIT)


ARRAYS = [
    ShapeArrays.from_model(single_shape(p).model) for p in (icosahedron(1.0), Box((2.0, 4.0, 6.0)), Ellipsoid((1.0, 1.0, 1.0)))
]


@pytest.mark.parametrize("seed", range(30))
def test_a_mesh_is_met_where_its_nearest_triangle_is(seed):
    rng = np.random.default_rng(seed)
    _, _, nodes, triangles = ARRAYS[0].surfaces
    origin = rng.normal(size=3) * (3.0 if seed % 2 else 0.2)
    ray = (*origin, *(0.5 * rng.normal(size=3) - origin * (seed % 2)))
    hits = np.array([triangle_hit(t, ray) for t in triangles])
    ahead = np.sort(hits[(hits > 0.0) & (hits < NO_HIT)])
    nearest = ahead[0] if len(ahead) else NO_HIT
    assert mesh_hit(nodes, triangles, 0, ray, NO_HIT, False) == nearest
    assert (mesh_hit(nodes, triangles, 0, ray, NO_HIT, True) < NO_HIT) == (len(ahead) > 0)
    if len(ahead):
        assert mesh_hit(nodes, triangles, 0, ray, NO_HIT, True) in ahead
        assert mesh_hit(nodes, triangles, 0, ray, 0.99 * nearest, False) == NO_HIT
        assert mesh_hit(nodes, triangles, 0, ray, 1.01 * nearest, False) == nearest


def test_solids_of_each_sort():
    T = np.array([[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])  # its y along -x
    center = np.zeros(3)

    def hit(i, way, t_max=NO_HIT, at=center):
        return solid_hit(ARRAYS[i].surfaces, 0, T, at, *way, t_max, False)

    assert hit(2, (1.0, 0.0, 0.0)) == NO_HIT  # round ones are not looked at here
    assert hit(1, (1.0, 0.0, 0.0)) == pytest.approx(3.0)
    assert hit(1, (2.0, 0.0, 0.0)) == pytest.approx(1.5)
    assert hit(1, (-1.0, 0.0, 0.0)) == NO_HIT
    assert hit(1, (1.0, 0.0, 0.0), t_max=2.9) == NO_HIT
    assert hit(1, (1.0, 0.0, 0.0), t_max=3.1) == pytest.approx(3.0)
    assert hit(1, (1.0, 0.0, 0.0), at=np.array([4.5, 0.0, 0.0])) == 0.0  # from within
    assert hit(0, (1.0, 0.001, 0.002)) == pytest.approx(4.1, abs=0.11)
