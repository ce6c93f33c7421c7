"""Samples of contours in the image: where they are, what of them is on it, and how wide their shapes are there."""

import numpy as np
import pytest

from helpers.bodies.two_links import cameras
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.objective.per_camera import camera_constants
from tracker_node.render.contour import generators as contour
from tracker_node.render.contour.samples import (
    BEYOND,
    CLASS,
    DEPTH,
    JACOBIAN,
    N_INFO_COLUMNS,
    N_PIXEL_COLUMNS,
    NU,
    NV,
    SHAPE,
    U,
    V,
    chords_px,
    collect_samples,
    keep_inside,
    most_samples,
    project_samples,
)
from tracker_node.render.shape_arrays import ShapeArrays

PLAIN = CameraModel(640, 480, np.array([[600.0, 3.0, 310.0], [0.0, 590.0, 250.0], [0.0, 0.0, 1.0]]))
LENSES = {"plain": PLAIN, "distorted": cameras()[0].model}
N_SAMPLES = 20


def projected(lens, points, normals, outward_px=2.0):
    """(pixels, outwards) of points in the camera's frame, turned and moved there from another."""
    T = se3.exp(np.array([0.3, -0.2, 0.4, 0.5, 0.2, -0.3]))
    back = se3.inverse(T)
    rows = np.zeros((len(points), contour.N_COLUMNS))
    rows[:, contour.P : contour.P + 3] = se3.apply(back, points)
    rows[:, contour.NORMAL : contour.NORMAL + 3] = normals @ back[:3, :3].T
    pixels, outwards = np.full((len(points), N_PIXEL_COLUMNS), np.nan), np.zeros(len(points))
    R, t = np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3])
    project_samples(lens.params, R, t, rows, len(points), outward_px, pixels, outwards)
    return pixels, outwards


@pytest.mark.parametrize("name", LENSES)
def test_samples_are_where_the_lens_says(name):
    rng, lens = np.random.default_rng(1), LENSES[name]
    points = np.column_stack([rng.uniform(-0.5, 0.5, (10, 2)), rng.uniform(1.5, 3.0, 10)])
    normals = rng.normal(size=(10, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pixels, outwards = projected(lens, points, normals)
    expected, valid = lens.project(points)
    assert valid.all()
    assert pixels[:, [U, V]] == pytest.approx(expected)
    assert pixels[:, DEPTH] == pytest.approx(points[:, 2])
    assert outwards == pytest.approx(2.0 * points[:, 2] / lens.params[0])  # two pixels, at that depth
    for k in range(3):  # the derivative by finite differences
        step = 1e-6 * np.eye(3)[k]
        slope = (lens.project(points + step)[0] - lens.project(points - step)[0]) / 2e-6
        assert pixels[:, [JACOBIAN + k, JACOBIAN + 3 + k]] == pytest.approx(slope, rel=1e-5, abs=1e-4)
    moved = lens.project(points + 1e-6 * normals)[0] - lens.project(points - 1e-6 * normals)[0]
    assert pixels[:, [NU, NV]] == pytest.approx(moved / np.linalg.norm(moved, axis=1, keepdims=True), abs=1e-5)


@pytest.mark.parametrize("name", LENSES)
def test_what_is_behind_the_camera_is_not_seen(name):
    pixels, outwards = projected(LENSES[name], np.array([[0.1, 0.1, -1.0], [0.1, 0.1, 1.0]]), np.eye(3)[:2])
    assert outwards[0] == -1.0
    assert outwards[1] > 0.0
    assert np.isnan(pixels[0]).all()
    assert np.isfinite(pixels[1]).all()


def test_samples_on_the_image_are_kept_in_their_order():
    """Pixels reach half a pixel beyond their middles."""
    inside = [(-0.5, 10.0), (99.49, 10.0), (10.0, -0.5), (10.0, 49.49), (50.0, 25.0)]
    outside = [(-0.51, 10.0), (99.5, 10.0), (10.0, -0.51), (10.0, 49.5)]
    order = [inside[0], outside[0], inside[1], outside[1], outside[2], inside[2], inside[3], outside[3], inside[4]]
    pixels = np.zeros((len(order) + 1, N_PIXEL_COLUMNS))
    pixels[: len(order), [U, V]] = order
    rows = np.tile(np.arange(10.0)[:, None], (1, contour.N_COLUMNS))
    info = np.tile(np.arange(10, dtype=np.int32)[:, None], (1, N_INFO_COLUMNS))
    n = keep_inside(rows, pixels, info, len(order), 100, 50)
    assert n == len(inside)
    assert [tuple(one) for one in pixels[:n, [U, V]]] == inside
    assert rows[:n, 0].tolist() == info[:n, 0].tolist() == [0, 2, 5, 6, 8]


RADIUS, DISTANCE = 0.1, 2.0


@pytest.fixture(scope="module")
def balls():
    """Two balls before a camera, one twice as far away and half covered: samples, and what their chords need."""
    shapes = tuple(
        Shape(f"ball{i}", "base", Ellipsoid((RADIUS,) * 3), se3.from_rotation_translation(np.eye(3), place))
        for i, place in enumerate(([0.0, 0.0, 0.0], [0.2, 2.0, 0.0]))
    )
    model = ArticulatedModel("balls", KinematicChain(("base",), ()), shapes)
    lens = CameraModel(640, 480, np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]]))
    camera = Camera("a", lens, se3.from_rotation_translation(so3.exp([-np.pi / 2, 0, 0]), [0.0, -DISTANCE, 0.0]))
    arrays, Ts = ShapeArrays.from_model(model), Configuration(model, State.neutral(model)).Ts_world_shape
    spheres, n_most = np.empty((2, 4)), most_samples(arrays.packed, N_SAMPLES)
    contour.world_spheres(Ts, arrays.bounds, spheres)
    rows, pixels = np.zeros((n_most, contour.N_COLUMNS)), np.zeros((n_most, N_PIXEL_COLUMNS))
    info, packed = np.zeros((n_most, N_INFO_COLUMNS), dtype=np.int32), camera_constants(camera)
    n = collect_samples(arrays.packed, Ts, spheres, packed, N_SAMPLES, 3.0, rows, pixels, info)
    chords = np.full((n, 2), np.nan)
    chords_px(arrays.packed, Ts, packed, rows, pixels, info, n, 100.0, chords)
    return rows[:n], pixels[:n], info[:n], chords


def test_the_contour_of_a_ball_is_a_circle(balls):
    _, pixels, info, _ = balls
    near = pixels[info[:, SHAPE] == 0]
    radius_px = 600.0 * RADIUS / np.sqrt(DISTANCE**2 - RADIUS**2)
    assert np.linalg.norm(near[:, [U, V]] - [319.5, 239.5], axis=1) == pytest.approx(radius_px)
    assert near[:, [NU, NV]] == pytest.approx((near[:, [U, V]] - [319.5, 239.5]) / radius_px)


def test_a_ball_is_as_wide_as_its_circle(balls):
    """To a sixtieth of what is looked at."""
    _, _, info, chords = balls
    radius_px = 600.0 * RADIUS / np.sqrt(DISTANCE**2 - RADIUS**2)
    near = info[:, SHAPE] == 0
    assert chords[near, 0] == pytest.approx(2.0 * radius_px, abs=100.0 / 60.0)
    assert np.isnan(chords[near, 1]).all()  # no crease


def test_what_lies_beyond_a_contour_is_told(balls):
    rows, pixels, info, _ = balls
    far = info[:, SHAPE] == 1
    assert far.any()
    assert set(info[far, BEYOND]) <= {-1, 0}
    before = np.linalg.norm(pixels[far][:, [U, V]] - [319.5, 239.5], axis=1)
    radius_px = 600.0 * RADIUS / np.sqrt(DISTANCE**2 - RADIUS**2)
    assert np.all(before >= radius_px - 1e-6)  # what the near ball covers is not seen
    assert set(info[:, CLASS]) <= {contour.OUTER, contour.INNER}
    assert len(rows) < most_samples_of_two()


def most_samples_of_two():
    return 2 * contour.SAMPLES * N_SAMPLES
