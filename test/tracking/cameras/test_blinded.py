"""Cameras that show the body no longer are named, told by what is the matter, and left out where they show nothing of it."""

import numpy as np
import pytest

from tracker_node.tracking.cameras.blinded import BlindedCameras
from tracker_node.tracking.estimate import BLIND, DEFOCUSED, NOISY

NAMES, N_BEFORE = ("a", "b", "c"), 12
USUAL = np.array([12.0, 8.0, 10.0])


def striped(contrast: float = 80.0, noise: float = 2.0, seed: int = 0) -> np.ndarray:
    """Stripes with sharp edges."""
    row = 100.0 + contrast * (np.arange(320) // 20 % 2)
    pixels = row[None, :, None] + np.random.default_rng(seed).normal(0.0, noise, (240, 320, 3))
    return np.clip(np.rint(pixels), 0, 255).astype(np.uint8)


def followed(n: int = N_BEFORE) -> BlindedCameras:
    cameras = BlindedCameras(NAMES)
    for k in range(n):
        cameras.look(k, [striped(seed=3 * k + i) for i in range(3)], USUAL * (1.0 + 0.1 * np.sin(k)))
    assert cameras.faults == () and cameras.blind == cameras.left_out == []
    return cameras


def went_on(cameras: BlindedCameras, picture: np.ndarray, share: float, n: int) -> None:
    """The middle camera shows something else."""
    for k in range(N_BEFORE, N_BEFORE + n):
        cameras.look(k, [striped(seed=k), picture, striped(seed=-k % 1000)], USUAL * (1.0, share, 1.0))


def test_a_camera_that_shows_nothing_is_named_and_left_out_from_the_third_set_on():
    cameras = followed()
    went_on(cameras, striped(), 0.1, 2)
    assert cameras.blind == [1] and cameras.left_out == [] and cameras.faults == ()
    went_on(cameras, striped(), 0.1, 3)
    (fault,) = cameras.faults
    assert (fault.camera, fault.kind, fault.since_ns) == ("b", BLIND, N_BEFORE)
    assert "b shows nothing of the body" in fault.text and "(10 % of what is usual)" in fault.text
    assert cameras.left_out == [1]


def test_a_camera_that_is_left_out_is_looked_at_again_and_comes_back():
    cameras = followed()
    went_on(cameras, striped(), 0.1, 3)
    without = 0
    while cameras.left_out and without < 50:
        cameras.look(N_BEFORE + 3 + without, [striped(), None, striped()], USUAL * (1.0, np.nan, 1.0))
        without += 1
        assert [fault.camera for fault in cameras.faults] == ["b"]
    assert 0 < without < 50
    cameras.look(100, [striped()] * 3, USUAL)
    assert cameras.faults == () and cameras.blind == []


def test_sets_that_are_gone_through_again_do_not_count_twice():
    cameras = followed()
    for _ in range(3):
        went_on(cameras, striped(), 0.1, 2)
    assert cameras.blind == [1] and cameras.faults == () and cameras.left_out == []


@pytest.mark.parametrize(("picture", "kind"), [(striped(contrast=8.0), DEFOCUSED), (striped(noise=25.0), NOISY)])
def test_a_picture_that_changes_tells_why_a_camera_finds_less(picture, kind):
    cameras = followed()
    went_on(cameras, picture, 0.6, 6)
    (fault,) = cameras.faults
    assert (fault.camera, fault.kind) == ("b", kind) and cameras.left_out == []
    assert "60 %" in fault.text


@pytest.mark.parametrize("picture", [striped(contrast=8.0), striped(noise=25.0)])
def test_a_picture_that_changes_is_no_fault_while_the_body_is_found(picture):
    cameras = followed()
    went_on(cameras, picture, 1.0, 6)
    assert cameras.faults == ()


def test_a_camera_that_finds_less_in_a_plain_room_is_not_out_of_focus():
    """Its pictures have had no sharp edges that could have gone."""
    cameras = BlindedCameras(NAMES)
    for k in range(N_BEFORE + 6):
        share = np.array([1.0, 1.0 if k < N_BEFORE else 0.6, 1.0])
        cameras.look(k, [striped(contrast=0.0, noise=4.0, seed=3 * k + i) for i in range(3)], USUAL * share)
    assert cameras.faults == ()


def test_a_camera_that_finds_less_before_another_wall_is_no_fault():
    cameras = followed()
    went_on(cameras, striped(), 0.5, 6)
    assert cameras.faults == ()


def test_all_cameras_that_find_less_are_no_fault():
    cameras = followed()
    for k in range(N_BEFORE, N_BEFORE + 6):
        cameras.look(k, [striped(contrast=8.0)] * 3, 0.25 * USUAL)
    assert cameras.faults == ()


def test_a_camera_that_has_never_shown_the_body_is_named_by_what_the_others_find():
    cameras = BlindedCameras(NAMES)
    for k in range(3):
        cameras.look(k, [striped(seed=k)] * 3, USUAL * (1.0, 0.3, 1.0))
    assert [(fault.camera, fault.kind) for fault in cameras.faults] == [("b", BLIND)]


def test_a_camera_in_which_a_detector_finds_the_body_is_not_blind():
    """Clothes of the wall's colors have next to no outline; an image out of focus is named all the same."""
    for shown in (np.array([0.9, 0.9, 0.9]), np.array([0.9, 0.1, 0.9]), None):
        cameras = followed()
        for k in range(N_BEFORE, N_BEFORE + 4):
            cameras.look(k, [striped(seed=k)] * 3, USUAL * (1.0, 0.1, 1.0), shown)
        assert [fault.kind for fault in cameras.faults] == ([] if shown is not None and shown[1] > 0.5 else [BLIND])
    cameras = followed()
    for k in range(N_BEFORE, N_BEFORE + 4):
        cameras.look(k, [striped(), striped(contrast=8.0), striped()], USUAL * (1.0, 0.2, 1.0), np.ones(3))
    assert [fault.kind for fault in cameras.faults] == [DEFOCUSED]


def test_a_detector_that_looks_now_and_then_or_late_tells_for_a_second():
    cameras = followed()
    for k in range(N_BEFORE, N_BEFORE + 40):
        stamp_ns, late = 33_000_000 * k, np.array([True, True, True]) if k % 5 == 0 else None
        cameras.look(stamp_ns, [striped(seed=k)] * 3, USUAL * (1.0, 0.1, 1.0))
        if late is not None:  # the same set again, with its points
            cameras.look(stamp_ns, [striped(seed=k)] * 3, USUAL * (1.0, 0.1, 1.0), late)
        assert k < N_BEFORE + 5 or cameras.left_out == []
    for k in range(N_BEFORE + 40, N_BEFORE + 80):
        cameras.look(33_000_000 * k, [striped(seed=k)] * 3, USUAL * (1.0, 0.1, 1.0))
    assert [fault.kind for fault in cameras.faults] == [BLIND]


def test_what_is_little_is_not_learned_as_usual():
    """Else a camera that shows more again would make the others look blind."""
    cameras = followed()
    for k in range(N_BEFORE, N_BEFORE + 60):
        cameras.look(k, [striped(seed=k)] * 3, USUAL * (1.0, 0.05, 1.0), np.array([False, True, False]))
    for k in range(N_BEFORE + 60, N_BEFORE + 70):
        cameras.look(k, [striped(seed=k)] * 3, USUAL)
        assert cameras.faults == ()


def test_of_one_camera_alone_nothing_is_said():
    cameras = BlindedCameras(NAMES)
    for k in range(6):
        support = np.array([np.nan, 10.0 if k < 3 else 0.0, np.nan])
        cameras.look(k, [None, striped(), None], support)
    assert cameras.faults == ()


def test_after_a_reset_nothing_is_known():
    cameras = followed()
    went_on(cameras, striped(), 0.1, 4)
    cameras.reset()
    assert cameras.faults == () and cameras.left_out == []
    cameras.look(0, [striped()] * 3, USUAL * (1.0, 0.6, 1.0))
    assert cameras.blind == []


def missed(cameras: BlindedCameras, n: int, shown: np.ndarray, since: int = 0) -> None:
    """Image sets at 20 Hz, in which the middle camera has no outline that is compared."""
    for k in range(since, since + n):
        cameras.look(k * 50_000_000, [striped(seed=k)] * 3, USUAL * (1.0, np.nan, 1.0), shown)


def test_a_camera_in_which_a_detector_finds_nothing_for_a_second_is_named():
    cameras = BlindedCameras(NAMES)
    missed(cameras, 20, np.array([0.9, 0.0, 0.8]))
    assert cameras.faults == ()
    missed(cameras, 1, np.array([0.9, 0.0, 0.8]), 20)
    (fault,) = cameras.faults
    assert (fault.camera, fault.kind, fault.since_ns) == ("b", BLIND, 0) and cameras.left_out == []
    missed(cameras, 1, np.array([0.9, 0.2, 0.8]), 21)
    assert cameras.faults == ()


@pytest.mark.parametrize("shown", [(0.9, np.nan, 0.8), (0.9, 0.0, 0.2), (0.9, 0.1, 0.8)])
def test_a_camera_that_need_not_show_the_body_or_shows_some_is_not_named(shown):
    """It is out of the image or nobody has looked; one other camera alone has it; a few points are found."""
    cameras = BlindedCameras(NAMES)
    missed(cameras, 40, np.array(shown))
    assert cameras.faults == ()
