"""Distances from round cones, worked out by hand."""

import numpy as np
import pytest

from tracker_node.model.shapes.primitives import N_CAPSULE, count_held, nearest_on, point_gap, point_gaps


def cone(start, start_radius: float, end, end_radius: float) -> np.ndarray:
    row = np.array([*start, start_radius, *end, end_radius], dtype=float)
    assert len(row) == N_CAPSULE
    return row


CAPSULE = cone((1, 2, 3), 1.0, (5, 2, 3), 1.0)
GROWING = cone((0, 0, 0), 1.0, (0, 5, 0), 4.0)  # 5 long, 3 wider: the slope is that of a triangle of 3, 4 and 5


@pytest.mark.parametrize(
    ("point", "t", "gap"),
    [((2, 5, 3), 0.25, 2.0), ((3, 2, 0), 0.5, 2.0), ((-2, 2, 3), 0.0, 2.0), ((8, 6, 3), 1.0, 4.0), ((2, 2, 3), 0.25, -1.0)],
)
def test_a_capsule(point, t, gap):
    assert nearest_on(CAPSULE, *map(float, point)) == pytest.approx(t)
    assert point_gap(CAPSULE, *map(float, point)) == pytest.approx(gap)


@pytest.mark.parametrize(
    ("point", "t", "gap"),
    [
        ((2, 2, 0), 0.7, 2.5 - 3.1),  # 0.4 + 3 * 2 / (5 * 4); 1.5 along and 2 across from there
        ((0, 2, -2), 0.7, 2.5 - 3.1),
        ((0, 1, 0), 0.2, -1.6),
        ((4, -1, 0), 0.4, 5.0 - 2.2),  # -0.2 + 0.6; 3 along and 4 across
        ((0, -6, 0), 0.0, 5.0),
        ((0, 12, 0), 1.0, 3.0),
    ],
)
def test_a_cone_that_grows(point, t, gap):
    assert nearest_on(GROWING, *map(float, point)) == pytest.approx(t)
    assert point_gap(GROWING, *map(float, point)) == pytest.approx(gap)
    turned = cone((0, 5, 0), 4.0, (0, 0, 0), 1.0)
    assert nearest_on(turned, *map(float, point)) == pytest.approx(1.0 - t)
    assert point_gap(turned, *map(float, point)) == pytest.approx(gap)


def test_one_sphere_may_hold_the_other():
    larger_end, larger_start = cone((0, 0, 0), 1.0, (2, 0, 0), 3.0), cone((0, 0, 0), 3.0, (2, 0, 0), 1.0)
    for x in (-9.0, 0.5, 9.0):
        assert nearest_on(larger_end, x, 1.0, 0.0) == 1.0 and nearest_on(larger_start, x, 1.0, 0.0) == 0.0
    assert point_gap(larger_end, 0.0, 0.0, 0.0) == -1.0 and point_gap(larger_start, 0.0, 0.0, 0.0) == -3.0
    ball = cone((1, 1, 1), 0.5, (1, 1, 1), 0.5)
    assert nearest_on(ball, 4.0, 1.0, 1.0) == 0.0 and point_gap(ball, 4.0, 1.0, 1.0) == 2.5
    almost = cone((0, 0, 0), 1.0, (2, 0, 0), 2.9)
    assert nearest_on(almost, -9.0, 0.0, 0.0) == 0.0


def test_the_nearest_of_several_and_how_many_each_holds():
    points = np.array([[2.0, 5.0, 3.0], [2.0, 2.0, 3.5], [0.0, 1.0, 0.0], [2.0, 2.0, 4.0]])
    gaps = np.full(4, 99.0)
    point_gaps(np.stack([CAPSULE, cone((2, 9, 3), 1.0, (2, 9, 3), 1.0)]), points, gaps)
    assert gaps == pytest.approx([2.0, -0.5, np.sqrt(11.0) - 1.0, 0.0])
    point_gaps(np.zeros((0, 8)), points, gaps)
    assert np.isposinf(gaps).all()
    held = np.full(2, 99)
    count_held(np.stack([CAPSULE, GROWING]), points[[1, 2, 3]], held)
    assert held[0] == 1  # a point on the surface is not held
    count_held(np.stack([CAPSULE, CAPSULE]), np.array([[2.0, 2.0, 3.0], [4.0, 2.0, 3.5], [4.0, 9.0, 3.5]]), held)
    assert held.tolist() == [2, 2]
