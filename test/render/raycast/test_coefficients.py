"""Boxes and depths of posed shapes against points on their surfaces."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3
from tracker_node.render.raycast.coefficients import BOX, farthest_depth, normalized_box, pixel_box
from tracker_node.render.shape_arrays import CONE, ELLIPSOID

SHAPES = {CONE: (0.4, 0.2, -0.3, -0.6, 0.9), ELLIPSOID: (0.3, 0.5, 0.2, 0.0, 0.0), BOX: (0.6, 0.9, 0.4, 0.0, 0.0)}


def surface(kind, dims):
    """Points (n, 3) among which are those farthest out each way, closely."""
    t = np.linspace(0.0, 2.0 * np.pi, 720)
    if kind == CONE:
        a, b, k, z1, z2 = dims
        return np.vstack([np.stack([a * (1 + k * z) * np.cos(t), b * (1 + k * z) * np.sin(t), 0 * t + z], 1) for z in (z1, z2)])
    if kind == ELLIPSOID:
        s = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 361)
        unit = np.stack([np.outer(np.cos(s), np.cos(t)), np.outer(np.cos(s), np.sin(t)), np.outer(np.sin(s), 1.0 + 0.0 * t)], -1)
        return unit.reshape(-1, 3) * dims[:3]
    return np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * dims[:3]


def placed(seed, z=4.0):
    T = se3.exp(np.append(np.zeros(3), np.random.default_rng(seed).normal(size=3)))
    T[:3, 3] = [0.5, -0.7, z]
    return T


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", list(SHAPES))
def test_depth_and_box_are_those_of_the_points(kind, seed):
    dims, T, box = np.array(SHAPES[kind]), placed(seed), np.zeros(4)
    points = se3.apply(T, surface(kind, dims))
    assert farthest_depth(kind, dims, T) == pytest.approx(points[:, 2].max(), abs=1e-4)
    assert normalized_box(kind, dims, T, box)
    seen = points[:, :2] / points[:, 2:]
    exact = np.concatenate([seen.min(axis=0), seen.max(axis=0)])
    if kind == CONE:  # by polygons around its ends, two per cent too large at most
        assert np.all(box[:2] <= exact[:2] + 1e-6) and np.all(box[2:] >= exact[2:] - 1e-6)
        np.testing.assert_allclose(box, exact, atol=0.02 * (exact[2:] - exact[:2]).max())
    else:
        np.testing.assert_allclose(box, exact, atol=1e-5)


@pytest.mark.parametrize("kind", list(SHAPES))
@pytest.mark.parametrize("z", [0.1, -4.0])
def test_a_shape_that_is_not_all_in_front_has_no_box(kind, z):
    assert not normalized_box(kind, np.array(SHAPES[kind]), placed(1, z), np.zeros(4))


CAMERA = CameraModel(100, 80, np.array([[100.0, 0.0, 50.0], [0.0, 50.0, 40.0], [0.0, 0.0, 1.0]]))
LIMITS, WHOLE = np.array([-0.5, -0.8, 0.5, 0.8]), np.array([0, 0, 100, 80])


@pytest.mark.parametrize(
    ("box", "pixels"),
    [
        (
            (-0.202, -0.204, 0.102, 0.304),
            [29, 29, 62, 57],
        ),  # 29.8 .. 60.2, 29.8 .. 55.2, half a pixel more, and the next whole one
        ((-9.0, -9.0, 9.0, 9.0), [0, 0, 100, 80]),
        ((0.6, 0.0, 0.7, 0.1), None),
        ((0.0, -1.0, 0.1, -0.9), None),
    ],
)
def test_pixels_of_a_box(box, pixels):
    out = np.zeros(4, dtype=np.int64)
    pixel_box(CAMERA.params, np.array(box), LIMITS, WHOLE, out)
    assert out.tolist() == (pixels or [0, 0, 0, 0])
    region = np.array([35, 33, 50, 45])
    pixel_box(CAMERA.params, np.array(box), LIMITS, region, out)
    assert out.tolist() == ([35, 33, 50, 45] if pixels else [35, 33, 35, 33])
