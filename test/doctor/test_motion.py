"""What moves in images, on one grid of time steps: small patches whose place and time are known."""

import numpy as np
import pytest

from tracker_node.doctor.motion import common_grid, motion_on_grid, period_ns, speed
from tracker_node.doctor.recording import CameraRecording

MS = 1_000_000


def recording(images=(), stamps=None, period=50 * MS, size=None):
    result = CameraRecording("cam", len(images), 20.0)
    result.small = [np.asarray(image, dtype=np.uint8) for image in images]
    result.stamps_ns = list(stamps) if stamps is not None else [i * period for i in range(len(images))]
    if len(images):
        result.size = size or images[0].shape[::-1]
    return result


def flat(n, level=100, shape=(120, 160)):
    return [np.full(shape, level, np.uint8) for _ in range(n)]


def test_the_median_time_between_images():
    assert period_ns(recording(flat(4), [0, 10, 30, 41])) == 11
    assert period_ns(recording(flat(2), [5, 12])) == 7
    assert period_ns(recording(flat(1))) == 1_000_000_000


def test_the_grid_is_of_the_slowest_camera_where_all_have_images():
    a, b = recording(flat(11), range(0, 110, 10)), recording(flat(4), [15, 35, 55, 75])
    assert common_grid({"a": a, "b": b}).tolist() == [15, 35, 55, 75]
    late = recording(flat(9), range(25, 115, 10))
    assert common_grid({"a": a, "late": late}).tolist() == [25, 35, 45, 55, 65, 75, 85, 95]
    assert common_grid({"a": a, "end": recording(flat(3), [0, 20, 40])}).tolist() == [0, 20, 40]


def motion(images, usable=None, grid=None, **how):
    made = recording(images, **how)
    grid = np.array(made.stamps_ns) if grid is None else np.array(grid)
    return motion_on_grid(made, grid, np.ones(len(images), bool) if usable is None else np.array(usable))


def test_a_patch_that_changes_is_motion_there_and_then():
    images = flat(4)
    images[2][30:40, 100:120] = 200
    found = motion(images, size=(640, 480))  # four pixels of the camera in one of the small image
    assert found.valid.tolist() == [False, True, True, True]
    assert not found.at(0).any()
    assert not found.at(1).any()
    assert len(found.pixels) == 200
    assert np.all(found.at(2) == 1.0)  # it comes,
    assert np.all(found.at(3) == 1.0)  # and goes
    assert found.pixels.min(axis=0) == pytest.approx([401.5, 121.5])
    assert found.pixels.max(axis=0) == pytest.approx([477.5, 157.5])


def test_amounts_grow_with_the_change_above_the_noise():
    images = flat(2)
    for i, level in enumerate((106, 111, 116, 126, 150)):
        images[1][10, 10 * i] = level
    found = motion(images)
    assert sorted(found.at(1).tolist()) == pytest.approx([0.25, 0.5, 1.0, 1.0])


def test_light_that_changes_everywhere_is_no_motion():
    images = [*flat(1, 100), *flat(1, 120)]
    assert len(motion(images).amounts) == 0


def test_images_are_compared_over_a_twentieth_of_a_second():
    """At a hundred a second: with the fifth before."""
    images = flat(8)
    for image in images[6:]:
        image[5, 5] = 200
    found = motion(images, stamps=[5000 * MS + 10 * MS * i for i in range(8)])
    assert found.valid.tolist() == [False] * 5 + [True] * 3
    assert found.at(5).sum() == 0.0
    assert found.at(6).sum() == found.at(7).sum() == 1.0


def test_images_that_cannot_be_used_are_not_compared():
    images = flat(6)
    images[2][5, 5] = 200
    assert motion(images, [True, True, False, True, True, True]).valid.tolist() == [False, True, False, False, True, True]


def test_images_far_from_a_time_step_do_not_stand_for_it():
    images = flat(4)
    found = motion(images, stamps=[0, 50 * MS, 300 * MS, 350 * MS], grid=np.arange(0, 351, 50) * MS)
    # at 100 and 250 ms the next image is one step off, at 150 and 200 two
    assert found.valid.tolist() == [False, True, True, False, False, False, True, True]


def moving(step_px, n=20, shape=(160, 200)):
    """A bright textured square that goes to the right."""
    rng, images = np.random.default_rng(1), []
    texture = np.repeat(np.repeat(rng.integers(120, 255, (8, 8)), 4, axis=0), 4, axis=1)
    for i in range(n):
        image = np.full(shape, 60, np.uint8)
        u = round(10 + step_px * i)
        image[60:92, u : u + 32] = texture[:, : max(0, shape[1] - u)]
        images.append(image)
    return images


def test_slow_motion_changes_more_over_two_images_than_over_one():
    slow = speed(recording(moving(2)), np.ones(20, bool))
    assert 1.2 < slow.growth < 2.2
    assert slow.step == pytest.approx(2 / 200, rel=0.3)


def test_what_is_elsewhere_in_every_image_changes_no_more():
    jumping = [image if i % 2 else np.roll(image, 100, axis=1) for i, image in enumerate(moving(3, 20))]
    assert speed(recording(jumping), np.ones(20, bool)).growth < 1.0


def test_nothing_that_moves_has_no_speed():
    assert speed(recording(flat(6)), np.ones(6, bool)) is None
    assert speed(recording(moving(2)), np.zeros(20, bool)) is None
    assert speed(recording(moving(2, 2)), np.ones(2, bool)) is None
    assert speed(recording(moving(2, 3)), np.ones(3, bool)) is not None
