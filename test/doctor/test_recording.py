"""What the doctor keeps of a camera's images."""

import cv2
import numpy as np
import pytest

from tracker_node.doctor.recording import SMALL_PX, CameraRecording, ViewShift


def flat(level, height=60, width=80):
    return np.full((height, width, 3), level, np.uint8)


def recorded(*levels, n_expected=8, rate_hz=10.0, period_ns=100):
    recording = CameraRecording("cam01", n_expected, rate_hz)
    for i, level in enumerate(levels):
        recording.add(1000 + i * period_ns, flat(level))
    return recording


def test_stamps_sizes_and_changes():
    recording = CameraRecording("cam01", 8, 10.0)
    assert len(recording) == 0 and recording.size == (0, 0) and recording.shown is None
    recording = recorded(10, 14, 14, 9)
    assert len(recording) == 4 and recording.size == (80, 60)
    assert recording.stamps_ns == [1000, 1100, 1200, 1300]
    assert np.isnan(recording.changes[0]) and recording.changes[1:] == [4.0, 0.0, 5.0]


def test_small_copies_are_gray_and_no_longer_than_their_side():
    recording = CameraRecording("cam01", 2, 10.0)
    image = np.zeros((960, 480, 3), np.uint8)
    image[..., 2] = 100  # red: 0.299 of its level
    recording.add(0, image)
    assert recording.small[0].shape == (320, 160) and recorded(7).small[0].shape == (60, 80) and SMALL_PX == 320
    assert np.unique(recording.small[0]).tolist() == [30]
    assert recording.small[0].dtype == np.uint8


def test_the_picture_is_the_one_in_the_middle():
    recording = CameraRecording("cam01", 6, 10.0)
    for i, expected in enumerate([0, 0, 0, 3, 3, 3]):
        recording.add(i, flat(10 * i))
        assert (recording.shown_index, recording.shown[0, 0, 0]) == (expected, 10 * expected)


def combed(shift):
    """Rows of two time steps: a bright box that has moved by ``shift`` on every other row."""
    image = np.full((240, 320, 3), 60, np.uint8)
    image[60:180:2, 100:160] = 200
    image[61:180:2, 100 + shift : 160 + shift] = 200
    return image


def test_combs_are_looked_for_in_some_of_the_pairs():
    for n_expected, pairs in ((10, 9), (48, 4), (24, 9)):
        recording = CameraRecording("cam01", n_expected, 10.0)
        for i in range(10):
            recording.add(i, np.roll(combed(12), 6 * i, axis=1))
        assert len(recording.combs) == pairs  # of 48 images every other pair
    whole = CameraRecording("cam01", 10, 10.0)
    for i in range(4):
        whole.add(i, np.roll(combed(0), 6 * i, axis=1))
    assert min(recording.combs) > max(whole.combs)
    still = CameraRecording("cam01", 4, 10.0)
    for i in range(4):
        still.add(i, combed(0))
    assert still.combs == []


def test_brightness_is_against_the_first_image_where_it_is_neither_dark_nor_burnt_out():
    assert recorded(99, 199, 49).brightness() == pytest.approx([1.0, 2.0, 0.5])
    for level in (20, 220):
        assert recorded(level, 100).brightness().tolist() == [1.0, 1.0]
    assert recorded(21, 43).brightness() == pytest.approx([1.0, 2.0])
    assert recorded(219, 109).brightness() == pytest.approx([1.0, 0.5])
    recording = CameraRecording("cam01", 2, 10.0)
    first, second = flat(99), flat(149)
    first[:40], second[:40] = 10, 10
    recording.add(0, first)
    recording.add(1, second)
    assert recording.brightness()[1] == pytest.approx(1.5)


def with_shifts(*px, rate_hz=4.0):
    recording = CameraRecording("cam01", 8, rate_hz)
    recording.view_shifts = [ViewShift(i, value) for i, value in enumerate(px)]
    return recording


def moved(recording, least):
    return [(shift.index, shift.px) for shift in recording.moved_from(least)]


def test_a_camera_has_moved_where_the_background_never_comes_back():
    assert moved(with_shifts(0, 0, 5, 6, 7), 3.0) == [(2, 5), (3, 6), (4, 7)]
    assert moved(with_shifts(0, 5, 0, 6, 7), 3.0) == [(3, 6), (4, 7)]
    assert moved(with_shifts(0, 5, 6, 0), 3.0) == []
    assert moved(with_shifts(0, 0, 0, 9), 3.0) == []  # a single one at the end
    assert moved(with_shifts(0, 0, 9, 9, rate_hz=30.0), 3.0) == []  # of two images in a row
    assert moved(with_shifts(2.9, 3.0, 3.0), 3.0) == [(1, 3.0), (2, 3.0)]
    assert moved(with_shifts(), 3.0) == []


def with_changes(*changes, period_ns=100):
    recording = CameraRecording("cam01", 8, 10.0)
    recording.changes = [float("nan"), *changes]
    recording.stamps_ns = [1000 + i * period_ns for i in range(len(changes) + 1)]
    return recording


def test_identical_images_are_repeated_and_nearly_identical_ones_where_another_camera_sees_motion():
    moving, still = with_changes(10.0, 10.0, 10.0, 10.0, 10.0), with_changes(10.0, 10.0, 1.0, 10.0, 10.0)
    recording = with_changes(10.0, 0.0, 1.4, 10.0, 1.6)
    # The usual change is the median of 10, 1.4, 10, 1.6, so 5.8: 0.15 of it is 0.87.
    assert recording.repeated([moving]).tolist() == [False, False, True, False, False, False]
    recording = with_changes(10.0, 0.0, 1.4, 10.0, 10.0)
    assert recording.repeated([moving, recording]).tolist() == [False, False, True, True, False, False]
    assert recording.repeated([still]).tolist() == [False, False, True, False, False, False]
    assert recording.repeated([still, moving]).tolist() == [False, False, True, True, False, False]
    assert recording.repeated([recording]).tolist() == [False, False, True, False, False, False]
    edge = with_changes(10.0, 10.0, 1.5, 10.0, 10.0)
    assert not edge.repeated([moving]).any()  # 0.15 of the usual change is no copy


def test_where_nothing_ever_moves_nothing_is_repeated():
    moving = with_changes(10.0, 10.0)
    assert with_changes(0.0, 0.0).repeated([moving]).tolist() == [False] * 3
    assert with_changes().repeated([moving]).tolist() == [False]
    assert with_changes(0.0, 4.0).repeated([]).tolist() == [False, True, False]


def test_motion_at_the_image_nearest_to_a_stamp():
    recording = with_changes(10.0, 5.0, 10.0, 5.1, 10.0)  # stamps 1000, 1100, ... 1500
    assert recording.moves_at(1100) and recording.moves_at(1149) and not recording.moves_at(1151)
    assert not recording.moves_at(1200) and recording.moves_at(1300) and recording.moves_at(1400) and recording.moves_at(9999)
    assert not recording.moves_at(0)  # of the first image no change is known


def textured(shift=0, height=480, width=640, seed=3):
    """A wall with many marks, moved to the right by some pixels."""
    rng = np.random.default_rng(seed)
    wide = np.full((height, width + 200, 3), 90, np.uint8)
    for _ in range(400):
        u, v = (int(x) for x in rng.integers(0, (width + 200, height)))
        cv2.rectangle(
            wide, (u, v), (u + int(rng.integers(4, 16)), v + int(rng.integers(4, 16))), rng.integers(0, 255, 3).tolist(), -1
        )
    return np.ascontiguousarray(wide[:, 100 - shift : 100 - shift + width])


def test_the_background_is_looked_at_every_quarter_of_a_second_and_at_the_end():
    recording = CameraRecording("cam01", 12, 20.0)
    for i in range(12):
        recording.add(i, textured(9 if i >= 10 else 0))
    assert [shift.index for shift in recording.view_shifts] == [5, 10, 11]
    assert [shift.px for shift in recording.view_shifts] == pytest.approx([0.0, 9.0, 9.0], abs=0.5)


def test_the_shift_is_in_pixels_of_the_camera():
    recording = CameraRecording("cam01", 2, 4.0)
    for shift in (0, 12):
        recording.add(shift, cv2.resize(textured(shift), (1920, 1440), interpolation=cv2.INTER_NEAREST))
    assert recording.view_shifts[0].px == pytest.approx(36.0, abs=1.5)


def test_who_walks_before_a_plain_wall_is_not_the_background():
    recording = CameraRecording("cam01", 2, 4.0)
    for left in (100, 190):
        image = flat(90, 480, 640)
        image[100:400, left : left + 150] = textured()[100:400, :150]
        recording.add(left, image)
    assert recording.view_shifts == []


def test_a_view_with_nothing_in_it_says_nothing():
    empty = flat(90, 480, 640)
    for first, second in ((empty, textured()), (textured(), empty), (textured(), textured(seed=8))):
        recording = CameraRecording("cam01", 2, 4.0)
        recording.add(0, first)
        recording.add(1, second)
        assert recording.view_shifts == []
