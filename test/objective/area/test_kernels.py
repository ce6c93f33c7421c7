"""What a drawn shape adds of the maps, and the box around a cone's ends."""

import numpy as np
import pytest

from tracker_node.objective.area.kernels import _add_spans, _cone_box


def test_the_map_of_a_shape_is_summed_where_it_shows_within_its_spans():
    """Beyond what its pixels gain without it; depths are above the label's bits, columns beyond the image are not read."""
    stride, label = 32, 2
    buffer = np.zeros((4, stride), dtype=np.int32)
    buffer[1, 2], buffer[2, 3], buffer[2, 17], buffer[2, 18] = 256 + 1, 512 + 2, 256 + 2, 256 + 1
    buffer[1, 3] = 256  # a depth without a label
    buffer[0, 0] = buffer[3, 1] = buffer[2, 20] = 256 + 2  # rows and columns outside of the spans
    values = np.arange(4 * 19, dtype=np.float32).reshape(4, 19)
    gains = np.full((4, 19), 0.25, dtype=np.float32)
    spans, total = np.array([[0, 0], [1, 5], [2, 19], [0, 0]]), np.array([5.0, 7.0])
    before = buffer.copy()
    _add_spans(label, np.array([0, 1, 19, 3]), spans, stride, buffer.ravel(), values, gains, total)
    assert total.tolist() == [5.0 + values[2, 3] + values[2, 17] - 0.5, 7.0 + 2.0]
    np.testing.assert_array_equal(buffer, before)


@pytest.mark.parametrize("turned", [False, True])
def test_a_box_holds_the_spheres_about_a_cones_ends(turned):
    dims, T, box = np.array([0.2, 0.4, 0.5, -0.5, 1.0]), np.eye(4), np.zeros(4)
    if turned:
        T[:3, :3] = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    T[:3, 3] = [0.3, -0.6, 4.0]
    assert _cone_box(dims, T, box)
    way = np.random.default_rng(0).normal(size=(20000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    points = np.vstack([T[:3, 2] * z + T[:3, 3] + 0.4 * (1.0 + 0.5 * z) * way for z in (-0.5, 1.0)])
    seen = points[:, :2] / points[:, 2:]
    exact = np.concatenate([seen.min(axis=0), seen.max(axis=0)])
    # Short by the middle times the square of the reach at most: 0.33 times 0.15 squared
    assert np.all(box[:2] <= exact[:2] + 0.0075) and np.all(box[2:] >= exact[2:] - 0.0075)
    np.testing.assert_allclose(box, exact, atol=0.015)


@pytest.mark.parametrize(("depth", "inside"), [(0.79, False), (0.802, True), (1.2, True)])
def test_an_end_must_be_in_front(depth, inside):
    """The nearer end lies half a meter before the origin, its sphere has a radius of 0.3 m."""
    T = np.eye(4)
    T[2, 3] = depth
    assert _cone_box(np.array([0.2, 0.4, 0.5, -0.5, 1.0]), T, np.zeros(4)) == inside
