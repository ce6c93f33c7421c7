"""Colors of points against a smooth picture: cost by hand, derivatives by differences."""

import math

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3
from tracker_node.objective.points.photometry import COST, COUNT, N_SUMS, WEIGHT, WEIGHTED_SQUARES, add_points, mirror

MODEL = CameraModel(64, 48, np.array([[100.0, 0.5, 30.0], [0.0, 110.0, 22.0], [0.0, 0.0, 1.0]]))
T_CAM = se3.exp(np.array([0.1, -0.05, 0.2, 0.3, -0.2, 0.15]))
POSITION = np.array([[0.05, 0.02, 0.03]])
HERE = se3.exp(np.array([0.2, 0.1, 0.0, -0.2, 0.4, 0.3]))
SCALE = 5.0


def bend(u, v, n_channels):
    """A picture that is quadratic: its central differences are its derivatives."""
    return np.stack([3.0 * u + 2.0 * v + 0.02 * u * v, -2.0 * u + 4.0 * v, 0.5 * u - v][:n_channels], axis=-1)


def scene(octave=0, u0=2, v0=1, n_channels=2, off=1.5, links=(1,), target=(20.0, 16.0)):
    """One point that falls on the pixel ``target`` of the full image, ``off`` darker than the picture there."""
    ray = np.linalg.solve(MODEL.K, [*target, 1.0]) * 2.0
    place = HERE.copy()
    place[:3, 3] = se3.apply(se3.inverse(T_CAM), ray[None])[0] - HERE[:3, :3] @ POSITION[0]
    step = 2**octave
    rows, columns = np.indices((48 // step - v0, 64 // step - u0), dtype=np.float64)
    full_u, full_v = (columns + 0.5) * step - 0.5 + u0, (rows + 0.5) * step - 0.5 + v0
    pixels = bend(full_u, full_v, n_channels).astype(np.float32)
    features = bend(*np.array(target), n_channels)[None] - off
    return (POSITION, np.array(links), features), place, (pixels, u0, v0, octave)


def added(points, place, picture, derivatives=True, twist=None, used=(True, True), scale=SCALE):
    Ts = np.stack([np.eye(4), place if twist is None else se3.exp(twist) @ place])
    normal, gradient, sums = np.zeros((2, 6, 6)), np.zeros((2, 6)), np.zeros(N_SUMS)
    camera = MODEL.params, np.ascontiguousarray(T_CAM[:3, :3]), np.ascontiguousarray(T_CAM[:3, 3])
    add_points(points, np.array(used), Ts, camera, picture, scale, derivatives, normal, gradient, sums)
    return normal, gradient, sums


@pytest.mark.parametrize(("octave", "u0", "v0"), [(0, 0, 0), (0, 2, 5), (1, 3, 1), (2, 0, 0)])
def test_a_cauchy_cost_of_the_difference(octave, u0, v0):
    _, _, sums = added(*scene(octave, u0, v0))
    square = 2 * 1.5**2  # of two channels
    weight = 1.0 / (1.0 + square / 25.0)
    # 0.02 u v is not quite linear between texels
    assert sums[COST] == pytest.approx(25.0 * math.log(1.0 + square / 25.0), rel=0.05)
    assert sums[WEIGHT] == pytest.approx(weight, rel=0.02)
    assert sums[WEIGHTED_SQUARES] == pytest.approx(weight * square, rel=0.05)
    assert sums[COUNT] == 1.0


@pytest.mark.parametrize("octave", [0, 1])
@pytest.mark.parametrize("target", [(20.0, 16.0), (20.3, 16.8), (35.6, 27.1)])
def test_derivatives_by_twists_at_the_origin(octave, target):
    points, place, picture = scene(octave, target=target, n_channels=3)
    normal, gradient, sums = added(points, place, picture)
    h = 1e-4
    numeric = [(added(points, place, picture, False, t)[2][COST] - added(points, place, picture, False, -t)[2][COST]) / (2.0 * h)
               for t in h * np.eye(6)]  # fmt: skip
    np.testing.assert_allclose(2.0 * gradient[1], numeric, rtol=0.03, atol=0.01 * np.abs(numeric).max())
    assert not gradient[0].any() and not normal[0].any()
    only = scene(octave, target=target, n_channels=1)
    normal, gradient, sums = added(*only)
    np.testing.assert_allclose(
        np.triu(normal[1]) * sums[WEIGHTED_SQUARES], np.triu(np.outer(gradient[1], gradient[1])), rtol=1e-6
    )


def test_channels_add_up():
    normal, gradient, sums = added(*scene(n_channels=2))
    parts = [added(*scene(n_channels=1))]
    points, place, (pixels, *window) = scene(n_channels=2)
    second = (points[0], points[1], points[2][:, 1:].copy())
    parts.append(added(second, place, (np.ascontiguousarray(pixels[:, :, 1:]), *window)))
    for k, whole in ((0, normal[1]), (1, gradient[1])):
        np.testing.assert_allclose(whole / sums[WEIGHT], sum(part[k][1] / part[2][WEIGHT] for part in parts), rtol=1e-5)


def test_only_points_of_used_links_and_no_derivatives_unless_asked():
    points, place, picture = scene()
    assert not added(points, place, picture, used=(True, False))[2].any()
    normal, gradient, sums = added(points, place, picture, derivatives=False)
    assert not normal.any() and not gradient.any() and sums[COST] == added(points, place, picture)[2][COST]
    again = added((np.repeat(points[0], 2, axis=0), np.array([1, 1]), np.repeat(points[2], 2, axis=0)), place, picture)
    np.testing.assert_allclose(again[2], 2.0 * sums)
    np.testing.assert_allclose(again[1], 2.0 * added(points, place, picture)[1])


@pytest.mark.parametrize(
    ("target", "inside"),
    [((1.02, 9.0), True), ((0.98, 9.0), False), ((9.0, 1.02), True), ((9.0, 0.98), False), ((61.98, 9.0), True),
     ((62.02, 9.0), False), ((9.0, 45.98), True), ((9.0, 46.02), False)],
)  # fmt: skip
def test_a_point_off_the_picture_costs_what_a_scale_does(target, inside):
    normal, gradient, sums = added(*scene(u0=0, v0=0, target=target))
    assert sums[COUNT] == 1.0 and (sums[WEIGHT] > 0.0) == inside
    if not inside:
        assert sums[COST] == pytest.approx(25.0 * math.log(2.0))
        assert not normal.any() and not gradient.any() and sums[WEIGHTED_SQUARES] == 0.0


def test_a_point_behind_the_camera_has_left_it():
    points, place, picture = scene()
    behind = place.copy()
    behind[:3, 3] += -4.0 * T_CAM[2, :3]
    assert added(points, behind, picture)[2].tolist() == pytest.approx([25.0 * math.log(2.0), 0.0, 0.0, 1.0])


def test_lower_triangles():
    full = np.random.default_rng(1).normal(size=(2, 6, 6))
    full += full.transpose(0, 2, 1)
    upper = np.triu(full)
    mirror(upper)
    np.testing.assert_array_equal(upper, full)
