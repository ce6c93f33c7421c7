"""What a camera sees where the body is not, packed for the kernels: colors, and the variance in steps of three percent."""

import numpy as np
import pytest

from tracker_node.observation.appearance import SceneModel, bin_of
from tracker_node.observation.region.background import LOG_STEP, NO_ROOM, WAY_PX, RegionBackground
from tracker_node.observation.region.colors import N_COLORS

SIZE = (24, 32)
HERE = np.zeros((4, 2))
NOBODY = (0, 0, 128, 96), np.zeros((96, 128), np.uint8)


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
    room.learn(image(50, 60, 70), (8, 8, 16, 16), labels, HERE)
    known = codes(room) > 0
    assert known[0, 0]
    assert not known[10:14, 10:14].any()
    np.testing.assert_array_equal(colors(room.packed[0])[known], np.broadcast_to([50, 60, 70], (known.sum(), 3)))


def test_pixels_of_doubted_colors_are_left_as_they_are():
    """They may be an arm that is elsewhere than it is taken to be; what is known of them stays."""
    room, nothing, wall, arm = RegionBackground([], 4.0, 0.5, 0), np.zeros(SIZE, np.uint8), (50, 60, 70), (200, 90, 40)
    everywhere, doubted, scene = (0, 0, SIZE[1], SIZE[0]), np.zeros(N_COLORS, np.bool_), image(*wall)
    doubted[bin_of(*(np.uint8(channel) for channel in arm))] = True
    scene[:, 20:24] = arm
    room.learn(scene, everywhere, nothing, HERE, 1, doubted)
    known = codes(room) > 0
    assert not known[:, 20:24].any()
    assert known[:, :20].all()
    assert known[:, 24:].all()
    scene[:, 20:24], scene[:, 4:8] = wall, arm  # it moves on
    room.learn(scene, everywhere, nothing, HERE, 1, doubted)
    assert (codes(room) > 0).all()
    np.testing.assert_array_equal(colors(room.packed[0]), np.broadcast_to(wall, (*SIZE, 3)))


def test_later_images_count_by_the_rate_and_in_their_region_alone():
    room = RegionBackground([image(100, 100, 100)], 4.0, 0.5, 0)
    nothing = np.zeros((8, 8), np.uint8)
    room.learn(image(100, 100, 100), (8, 8, 16, 16), nothing, HERE)  # all of the first image is looked at
    room.learn(image(120, 100, 100), (8, 8, 16, 16), nothing, HERE)
    blue = colors(room.packed[0])[..., 0]
    assert set(np.unique(blue[8:16, 8:16])) <= set(range(105, 116))
    outside = np.ones(SIZE, bool)
    outside[8:16, 8:16] = False
    assert set(np.unique(blue[outside])) == {100}


def test_of_a_large_image_rows_are_learnt_in_turn():
    size, nothing = (520, 1000), np.zeros((520, 1000), np.uint8)
    whole, here = (0, 0, 1000, 520), np.zeros((4, 2))
    room = RegionBackground([], 4.0, 0.5, 0)
    room.learn(np.full((*size, 3), 100, np.uint8), whole, nothing, here)
    assert (codes(room) > 0).all()  # what is first seen is seen at once
    for _ in range(2):
        room.learn(np.full((*size, 3), 108, np.uint8), whole, nothing, here)
        blue = colors(room.packed[0])[:, 0, 0]
        assert set(np.unique(blue)) <= {100, 106}  # two rates of a half: three quarters of the way
    assert set(np.unique(blue)) == {106}
    small = RegionBackground([np.full((*size, 3), 100, np.uint8)] * 2, 4.0, 0.5, 0)
    small.learn(np.full((*size, 3), 108, np.uint8), (0, 0, 100, 100), nothing[:100, :100], here)
    small.learn(np.full((*size, 3), 108, np.uint8), (0, 0, 100, 100), nothing[:100, :100], here)
    assert len(np.unique(colors(small.packed[0])[:100, :100, 0])) == 1


def test_labels_may_stand_for_many_pixels_each():
    rng, rooms = np.random.default_rng(3), []
    pictures = [rng.integers(90, 110, (96, 128, 3), dtype=np.uint8) for _ in range(4)]
    coarse = np.zeros((12, 16), np.uint8)
    coarse[4:9, 5:11] = 2
    for every in (1, 4, 2):
        room = RegionBackground([], 4.0, 0.2, 8)
        for k, picture in enumerate(pictures):
            labels = np.kron(coarse, np.ones((4 // every, 4 // every), np.uint8))
            room.learn(picture, (32, 24, 96, 72), labels, HERE + 30.0 * k, every)
        rooms.append(room.packed[0])
    assert (rooms[0] == 0).any() and (rooms[0] > 0).any()
    np.testing.assert_array_equal(rooms[0], rooms[1])
    np.testing.assert_array_equal(rooms[0], rooms[2])


def test_a_room_that_does_not_change_stays():
    room = RegionBackground([image(100, 100, 100)], 4.0, 0.0, 0)
    before = room.packed[0].copy()
    room.learn(image(200, 0, 0), (0, 0, 8, 8), np.zeros((8, 8), np.uint8), HERE)
    np.testing.assert_array_equal(room.packed[0], before)


def striped(shift: int) -> np.ndarray:
    """Stripes four pixels wide on the left, which move; one color on the right, which stands still."""
    picture = plain(100)
    levels = np.random.default_rng(1).integers(0, 255, 400, dtype=np.uint8)
    picture[:, :80] = levels[(np.arange(80) + shift) // 4][None, :, None]
    return picture


def plain(level: int) -> np.ndarray:
    return np.full((96, 128, 3), level, np.uint8)


def gone(n: int, moves: bool = True) -> RegionBackground:
    """A body has gone 4 px from image to image, or has rested, while the stripes went by 3 px."""
    room = RegionBackground([], 4.0, 0.05, 0)
    for k in range(n):
        room.learn(striped(3 * k), *NOBODY, HERE + (4.0 * k if moves else 0.3 * (k % 2)))
    return room


def test_what_moves_with_the_body_is_no_background():
    room = gone(40)
    known = codes(room) > 0
    assert known[:, 80:].all()
    assert known[:, :80].mean() < 0.2  # by chance


def test_a_body_that_rests_proves_nothing():
    """Its fit trembles."""
    room = gone(40, moves=False)
    assert room._way.to(HERE) == 0.0 and not room._proofs.any()


def test_background_that_stands_still_counts_from_the_first_image_on_and_keeps_what_passes_by():
    room = RegionBackground([], 4.0, 0.05, 0)
    for k in range(10):
        room.learn(plain(100), *NOBODY, HERE + 4.0 * k)
        assert (codes(room) > 0).all()
    passing = plain(100)
    passing[:3] = 250
    room.learn(passing, *NOBODY, HERE + 40.0)
    assert (codes(room) > 0).all() and set(np.unique(colors(room.packed[0]))) == {100}


def test_surroundings_that_come_to_rest_are_background_again():
    room = gone(40)
    for k in range(int(4 * WAY_PX)):
        room.learn(striped(0), *NOBODY, HERE + 160.0 + 4.0 * k)
    assert (codes(room) > 0).all()


def test_images_of_the_empty_scene_count_whatever_moves():
    room = RegionBackground([plain(100)], 4.0, 0.05, 0)
    for k in range(40):
        room.learn(striped(3 * k), *NOBODY, HERE + 4.0 * k)
    assert (codes(room) > 0).all()
