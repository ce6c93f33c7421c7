"""The contract of every lens model: OpenCV's projection, exact derivatives, rays that come back."""

import cv2
import numpy as np
import pytest

from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.camera.model import CameraModel

K = np.array([[620.0, 0.0, 310.0], [0.0, 600.0, 250.0], [0.0, 0.0, 1.0]])
LENSES = {
    "none": [],
    "plumb_bob": [-0.25, 0.08, 0.001, -0.002, -0.01],
    "plumb_bob_4": [-0.25, 0.08, 0.001, -0.002],
    "rational_polynomial": [0.4, 0.1, 0.0005, -0.0007, 0.01, 0.7, 0.2, 0.03],
    "equidistant": [-0.02, 0.01, -0.003, 0.0005],
}


@pytest.fixture(params=LENSES)
def lens(request):
    return CameraModel(640, 480, K, request.param.removesuffix("_4"), np.array(LENSES[request.param]))


@pytest.fixture
def points():
    rng = np.random.default_rng(5)
    z = rng.uniform(0.5, 6.0, 200)
    return np.column_stack([rng.uniform(-0.45, 0.45, 200) * z, rng.uniform(-0.4, 0.4, 200) * z, z])


def test_projects_as_opencv_does(lens, points):
    pixels, valid = lens.project(points)
    assert valid.all()
    zero = np.zeros(3)
    if lens.distortion_model == "equidistant":
        expected, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, K, lens.distortion)
    else:
        expected, _ = cv2.projectPoints(points[:, None], zero, zero, K, lens.distortion if lens.distortion.size else None)
    assert np.allclose(pixels, expected[:, 0], atol=1e-9)


def test_jacobian_matches_finite_differences(lens, points):
    for point in [*points[:25], np.array([0.0, 0.0, 2.0]), np.array([1e-7, -1e-7, 1.0])]:
        _, jacobian, _ = lens.project_with_jacobian(point)
        assert_jacobian(jacobian, lambda d, p=point: lens.project(p + d)[0], tolerance=1e-7)


def test_rays_go_through_their_pixels(lens, points):
    pixels, _ = lens.project(points)
    rays, valid = lens.rays(pixels)
    assert valid.all()
    assert np.allclose(np.linalg.norm(rays, axis=1), 1.0)
    assert np.allclose(rays, points / np.linalg.norm(points, axis=1)[:, None], atol=1e-9)


def test_a_skew_is_part_of_k(points):
    skewed = K.copy()
    skewed[0, 1] = 3.5
    pixels, jacobian, _ = CameraModel(640, 480, skewed, "plumb_bob", LENSES["plumb_bob"]).project_with_jacobian(points)
    plain, _ = CameraModel(640, 480, K, "plumb_bob", LENSES["plumb_bob"]).project(points)
    assert np.allclose(pixels[:, 0] - plain[:, 0], 3.5 * (plain[:, 1] - K[1, 2]) / K[1, 1])
    model = CameraModel(640, 480, skewed, "plumb_bob", LENSES["plumb_bob"])
    assert_jacobian(jacobian[0], lambda d: model.project(points[0] + d)[0])


def test_what_is_behind_or_beyond_the_fold_is_invalid(lens):
    _, valid = lens.project(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.1, 0.1, 1.0]]))
    assert valid.tolist() == [False, False, True]
    folding = CameraModel(640, 480, K, "plumb_bob", [-0.5, 0.0, 0.0, 0.0])  # slope 0 at r = sqrt(1 / 1.5) = 0.816
    _, valid = folding.project(np.array([[0.7, 0.0, 1.0], [0.9, 0.0, 1.0], [3.0, 0.0, 1.0]]))
    assert valid.tolist() == [True, False, False]
    # No real point is seen in a pixel that lies beyond what the lens maps to.
    _, valid = folding.rays(np.array([[310.0 + 620.0, 250.0]]))
    assert not valid[0]


def test_shapes_are_kept(lens):
    pixels, jacobian, valid = lens.project_with_jacobian(np.ones((2, 3, 3)))
    assert (pixels.shape, jacobian.shape, valid.shape) == ((2, 3, 2), (2, 3, 2, 3), (2, 3))
    assert lens.project(np.ones((0, 3)))[0].shape == (0, 2)


def test_mapped_sees_the_same_lens_in_other_pixels(lens, points):
    pixel_map = np.array([[1.01, 0.002, -3.0], [0.0, 0.98, 7.0]])
    mapped = lens.mapped(pixel_map, 650, 470)
    before, _ = lens.project(points)
    after, _ = mapped.project(points)
    assert np.allclose(after, before @ pixel_map[:, :2].T + pixel_map[:, 2], atol=1e-9)
    assert (mapped.width, mapped.height) == (650, 470)
    with pytest.raises(ValueError, match="without rotation"):
        lens.mapped(np.array([[1.0, 0, 0], [0.1, 1, 0]]), 640, 480)


def test_resized_follows_the_pixel_centres_of_cv2_resize():
    model = CameraModel(64, 48, np.array([[60.0, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]))
    small = model.resized(32, 24)
    ramp = np.tile(np.arange(64, dtype=np.float32), (48, 1))  # a pixel's value is its own u
    half = cv2.resize(ramp, (32, 24), interpolation=cv2.INTER_AREA)
    point = np.array([0.1, 0.0, 1.0])
    u, v = small.project(point)[0]
    left = int(u)
    value = half[int(v), left] + (u - left) * (half[int(v), left + 1] - half[int(v), left])
    assert np.isclose(value, model.project(point)[0][0])


@pytest.mark.parametrize(("change", "message"), [
    ({"K": np.zeros((3, 3))}, "uncalibrated"),
    ({"K": np.eye(4)}, r"\(4, 4\)"),
    ({"distortion_model": "fish"}, "equidistant"),
    ({"distortion": np.zeros(3)}, "got 3"),
])  # fmt: skip
def test_bad_lenses_are_refused(change, message):
    values = {"width": 640, "height": 480, "K": K, "distortion_model": "plumb_bob", "distortion": np.zeros(5)} | change
    with pytest.raises(ValueError, match=message):
        CameraModel(**values)


def test_in_image_ends_half_a_pixel_beyond_the_outer_centres():
    model = CameraModel(640, 480, K)
    pixels = np.array([[-0.5, 0.0], [-0.6, 0.0], [639.4, 479.4], [639.5, 0.0], [0.0, 479.5]])
    assert model.in_image(pixels).tolist() == [True, False, True, False, False]


@pytest.mark.parametrize(("width", "height"), [(32, 24), (128, 96), (16, 48), (40, 30)])
def test_resized_images_have_the_same_edges(width, height):
    """The outer edges of the image, half a pixel beyond the outer centers, stay edges; between them all is in proportion."""
    model = CameraModel(64, 48, np.array([[60.0, 0.4, 30.0], [0, 62.0, 25.0], [0, 0, 1]]), "plumb_bob", LENSES["plumb_bob"])
    small = model.resized(width, height)
    points = np.array([[0.1, -0.05, 1.0], [-0.3, 0.2, 1.5], [0.0, 0.0, 1.0]])
    before, after = (model.project(points)[0] + 0.5) / [64, 48], (small.project(points)[0] + 0.5) / [width, height]
    assert np.allclose(after, before, atol=1e-12)
    assert (small.width, small.height) == (width, height)


def test_the_nearest_visible_point_is_a_millimetre_away():
    lens = CameraModel(640, 480, K)
    assert lens.project(np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, 0.999e-3]]))[1].tolist() == [True, False]


def test_focal_lengths_must_be_positive_both():
    for row in (0, 1):
        bad = K.copy()
        bad[row, row] = 0.0
        with pytest.raises(ValueError, match="positive focal lengths"):
            CameraModel(640, 480, bad)
    with pytest.raises(ValueError, match="without rotation"):
        CameraModel(640, 480, K).mapped(np.eye(3), 640, 480)


def test_a_lens_cannot_be_written_to():
    lens = CameraModel(640, 480, K, "plumb_bob", np.zeros(5))
    for array in (lens.K, lens.distortion, lens.params):
        assert not array.flags.writeable
