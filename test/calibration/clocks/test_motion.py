"""Motion in images: what counts as changed, in which plane a pixel lies, and what a profile holds."""

import numpy as np
import pytest

from tracker_node.calibration.clocks.motion import MotionMeter, _angles, _changed, beginning, plane_numbers, small_size
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError
from tracker_node.geometry import se3

LENS = CameraModel(41, 41, np.array([[40.0, 0.0, 20.0], [0.0, 40.0, 20.0], [0.0, 0.0, 1.0]]))
SIZE = (41, 41)


def camera(name, x):
    """Looks along the world's z; its rows are planes through a line along x."""
    return Camera(name, LENS, se3.from_rotation_translation(np.eye(3), np.array([x, 0.0, 0.0])))


A, B = camera("a", 0.0), camera("b", 1.0)


@pytest.mark.parametrize(
    ("size", "small"),
    [((320, 240), (320, 240)), ((640, 480), (320, 240)), ((480, 640), (240, 320)), ((100, 50), (100, 50)), ((6400, 3), (320, 1))],
)
def test_images_are_made_small_and_never_large(size, small):
    assert small_size(*size) == small


@pytest.mark.parametrize(("one", "other"), [(A, B), (B, A)])
def test_side_by_side_a_plane_is_a_row(one, other):
    angles = _angles(one, one, other, SIZE).reshape(41, 41)
    rows = np.arctan((np.arange(41) - 20.0) / 40.0)
    assert np.allclose(np.abs(angles), np.abs(rows)[:, None], atol=1e-9)
    assert np.allclose(angles, _angles(one, other, one, SIZE).reshape(41, 41))  # in either order
    assert np.allclose(angles[::-1], -angles, atol=1e-9) and angles[30, 0] * _angles(other, one, other, SIZE)[30 * 41] > 0.0


def test_the_common_planes_are_numbered_evenly_from_end_to_end():
    numbers = plane_numbers(A, B, SIZE, SIZE).reshape(41, 41)
    assert (numbers == numbers[:, :1]).all() and numbers.dtype == np.int64
    column = numbers[::-1, 0]  # the planes are counted from the lowest row up
    low, high = np.arctan(-0.5), np.arctan(0.5)
    expected = np.floor(40 * (np.arctan((np.arange(1, 40) - 20) / 40.0) - low) / (high - low) + 1e-9)
    assert np.abs(column[1:-1] - expected).max() <= 1 and np.mean(column[1:-1] == expected) > 0.9
    assert (column[0], column[-1]) == (0, -1)  # the last angle is beyond the last plane


def test_what_only_one_camera_sees_is_in_no_plane():
    up = se3.from_rotation_translation(
        np.array([[1, 0, 0], [0, np.cos(0.6), np.sin(0.6)], [0, -np.sin(0.6), np.cos(0.6)]]).T, B.center
    )
    turned = Camera("b", LENS, up)
    numbers = plane_numbers(A, turned, SIZE, SIZE).reshape(41, 41)[:, 20]
    assert (numbers == -1).sum() > 10 and (numbers >= 0).sum() > 5 and numbers.max() <= 39
    far = se3.from_rotation_translation(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), B.center)
    assert (plane_numbers(A, Camera("b", LENS, far), SIZE, SIZE) == -1).all()  # their views have no plane in common


def test_cameras_one_behind_the_other_have_planes_all_around():
    behind = Camera("b", LENS, se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, -1.0])))
    angles = _angles(A, A, behind, SIZE).reshape(41, 41)
    assert np.ptp(angles) > 6.0  # about the line of sight
    assert np.allclose(np.diff([angles[20, 30], angles[30, 30]]) % (2 * np.pi), [np.pi / 4], atol=1e-9) or np.allclose(
        np.diff([angles[30, 30], angles[20, 30]]) % (2 * np.pi), [np.pi / 4], atol=1e-9
    )


def change(*levels):
    """Of single pixels among many that stay."""
    before = np.full((1000, 3), 100.0, np.float32)
    now = before.copy()
    now[: len(levels)] += np.array(levels, np.float32)
    return _changed(before, now)


def test_a_pixel_has_changed_from_five_levels_on_and_surely_from_seven():
    changed = change((5, 0, 0), (6, 0, 0), (0, 6.5, 0), (0, 0, 7), (-6, 0, 0), (90, 90, 90), (4, 4, 4))
    assert changed[:7].tolist() == pytest.approx([0.0, 0.5, 0.75, 1.0, 0.5, 1.0, 0.0]) and not changed[7:].any()


def test_a_change_of_the_whole_image_is_none():
    before = np.full((1000, 3), 100.0, np.float32)
    now = before + np.array([50.0, -20.0, 3.0], np.float32)
    now[0, 1] += 6.0
    changed = _changed(before, now)
    assert changed[0] == pytest.approx(0.5) and not changed[1:].any()


def test_noise_is_measured_and_four_times_that_is_no_change():
    before = np.full((1001, 3), 100.0, np.float32)
    now = before + np.where(np.arange(1001) % 2, 2.0, -2.0).astype(np.float32)[:, None]
    now[0] = 100.0 - 2.0 + 16.0  # the median of the change is 2 or -2
    changed = _changed(before, now)
    assert 0.0 <= changed[0] <= 1.0 and not changed[1:].any()
    now[0] = 140.0
    assert _changed(before, now)[0] == 1.0


def film(n, moving=True):
    """A bright dot that goes along a row, from image to image."""
    for i in range(n):
        image = np.full((41, 41, 3), 90, np.uint8)
        if moving:
            image[9:12, i : i + 3] = 250
        yield 1_000_000_000 + 100_000_000 * i, image


def test_profiles_are_at_the_middles_between_images():
    found = MotionMeter("a", ["b"], CameraRig((A, B))).measure(film(20))
    assert found.camera == "a" and found.times_s == pytest.approx(1.05 + 0.1 * np.arange(19))
    assert (found.first_s, found.last_s) == pytest.approx((1.0, 2.9))
    profile = found.profiles["b"]
    assert profile.shape == (19, 40) and profile.min() >= 0.0 and 0.5 < profile.max() <= 1.0
    rows = plane_numbers(A, B, SIZE, SIZE).reshape(41, 41)[:, 0]
    assert set(np.flatnonzero(profile.max(axis=0) > 0.3)) <= set(rows[6:15]) and profile[:, rows[10]].min() > 0.5
    assert not profile[:, rows[20:]].any()


def test_a_few_pixels_count_as_much_as_many():
    meter = MotionMeter("a", ["b"], CameraRig((A, B)))
    meter._small(np.zeros((41, 41, 3), np.uint8))
    planes = meter._planes["b"]
    plane = int(planes[20 * 41])
    changed = np.zeros(41 * 41)
    changed[np.flatnonzero(planes == plane)[:2]] = 1.0
    profile = meter._profile("b", changed)
    assert profile[plane] == pytest.approx(1.0 - np.exp(-1.0)) and np.count_nonzero(profile) == 1
    assert not meter._profile("b", np.where(planes == -1, 1.0, 0.0)).any()  # in no plane


def test_without_a_rig_changed_pixels_are_counted():
    found = MotionMeter("a", ["b"]).measure(film(20))
    assert found.profiles["b"].shape == (19, 1) and found.profiles["b"].min() > 3.0
    meter = MotionMeter("a", ["b"])
    meter._small(np.zeros((41, 41, 3), np.uint8))
    assert meter._profile("b", np.array([1.0, 0.5, *np.zeros(41 * 41 - 2)])).tolist() == [1.5]


def test_cameras_in_one_place_have_one_plane():
    near, far = camera("b", 0.0009), camera("b", 0.0011)
    assert not MotionMeter("a", ["b"], CameraRig((A, near)))._numbers("b", SIZE).any()
    assert MotionMeter("a", ["b"], CameraRig((A, far)))._numbers("b", SIZE).any()


def test_too_few_images_and_images_without_motion_are_refused():
    with pytest.raises(CalibrationError, match="has 19 images; at least 20 are needed to find its time"):
        MotionMeter("a", ["b"]).measure(film(19))
    with pytest.raises(CalibrationError, match="nothing moves in its images, at least not where other cameras look"):
        MotionMeter("a", ["b"]).measure(film(20, moving=False))


@pytest.mark.parametrize("first_ns", [0, 7_000_000_000])
def test_the_first_seconds_are_counted_from_the_first_image(first_ns):
    images = [(first_ns + i * 500_000_000, i) for i in range(10)]
    assert [image for _, image in beginning(iter(images), 2.0)] == [0, 1, 2, 3, 4]
    assert [image for _, image in beginning(iter(images), 1.9)] == [0, 1, 2, 3]
