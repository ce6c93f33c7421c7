"""What a camera sees where the body is not, packed for the kernels: colors, and the variance in steps of three percent."""

import numpy as np
import pytest

from tracker_node.observation.appearance import SceneModel
from tracker_node.observation.region.background import LOG_STEP, NO_ROOM, RegionBackground

SIZE = (24, 32)


def image(*bgr):
    return np.tile(np.array(bgr, dtype=np.uint8), (*SIZE, 1))


def colors(pixels):
    return np.stack([(pixels >> shift) & 255 for shift in (0, 8, 16)], axis=-1).astype(int)


def codes(room):
    return (room.packed[0] >> 24).astype(int)


def test_without_plates_there_is_no_room():
    assert RegionBackground([], 4.0, 0.0, 2).packed is NO_ROOM


def test_a_plate_is_packed_blue_lowest():
    room = RegionBackground([image(10, 120, 250)] * 3, 4.0, 0.0, 2)
    assert room.packed[0].shape == SIZE
    np.testing.assert_array_equal(colors(room.packed[0]), np.broadcast_to([10, 120, 250], (*SIZE, 3)))
    assert room.packed[1] == pytest.approx(SceneModel.from_images([image(10, 120, 250)] * 3, 4.0).floor)
    assert set(np.unique(codes(room))) == {1}  # the least variance


def test_the_variance_is_told_in_steps_of_three_percent():
    """Plates that differ in the right half."""
    backgrounds = [image(100, 100, 100) for _ in range(9)]
    for i, plate in enumerate(backgrounds):
        plate[:, 16:] += np.uint8(6 * i)
    room, scene = RegionBackground(backgrounds, 2.0, 0.0, 2), SceneModel.from_images(backgrounds, 2.0)
    expected = np.floor(np.log(np.maximum(scene.variance / scene.floor, 1.0)) / LOG_STEP + 1.5)
    known = codes(room) > 0
    assert known.any()
    assert np.abs(codes(room) - np.minimum(expected, 255))[known].max() <= 1
    assert codes(room)[:, 20:].min() > codes(room)[:, :12].max()


def test_the_first_image_is_learnt_beside_the_body():
    room = RegionBackground([], 4.0, 0.1, 4)
    labels = np.zeros((8, 8), np.uint8)
    labels[2:6, 2:6] = 3
    room.learn(image(50, 60, 70), (8, 8, 16, 16), labels)
    known = codes(room) > 0
    assert known[0, 0]
    assert not known[10:14, 10:14].any()
    np.testing.assert_array_equal(colors(room.packed[0])[known], np.broadcast_to([50, 60, 70], (known.sum(), 3)))


def test_later_images_count_by_the_rate_and_in_their_region_alone():
    room = RegionBackground([image(100, 100, 100)], 4.0, 0.5, 0)
    nothing = np.zeros((8, 8), np.uint8)
    room.learn(image(120, 100, 100), (8, 8, 16, 16), nothing)
    blue = colors(room.packed[0])[..., 0]
    assert set(np.unique(blue[8:16, 8:16])) <= set(range(105, 116))
    outside = np.ones(SIZE, bool)
    outside[8:16, 8:16] = False
    assert set(np.unique(blue[outside])) == {100}


def test_a_room_that_does_not_change_stays():
    room = RegionBackground([image(100, 100, 100)], 4.0, 0.0, 0)
    before = room.packed[0].copy()
    room.learn(image(200, 0, 0), (0, 0, 8, 8), np.zeros((8, 8), np.uint8))
    np.testing.assert_array_equal(room.packed[0], before)
