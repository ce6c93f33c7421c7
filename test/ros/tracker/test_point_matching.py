"""Points meet the image sets that they are of, by their stamps: in time, late, or counted by why they are not used."""

import threading
import time

import numpy as np
import pytest

from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.ros.tracker import keypoint_inbox
from tracker_node.ros.tracker.keypoint_inbox import PointMatching
from tracker_node.runs.messages.people import DetectedPeople

PERIOD_NS = 33_333_333
PIXELS = np.zeros((4, 4, 3), np.uint8)


class Bench:
    """One camera, whose images are of multiples of the period."""

    def __init__(self):
        self.matching = PointMatching(1.0 / 30.0)

    def put(self, *images: float) -> None:
        for i in images:
            self.matching.put("cam", DetectedPeople(round(i * PERIOD_NS), ()))

    def come(self, *images: float) -> None:
        for i in images:
            self.matching.came("cam", round(i * PERIOD_NS))

    def track(self, i: float, waited: bool = False) -> int | None:
        """Track the image set i, which has waited or comes now; stamp of the points that are used, in periods."""
        if not waited:
            self.come(i)
        image = CameraImage("cam", round(i * PERIOD_NS), PIXELS)
        (image,) = self.matching.attached(ImageSet(image.stamp_ns, (image,))).images
        if image.people is None:
            return None
        return round((image.stamp_ns if image.people_stamp_ns is None else image.people_stamp_ns) / PERIOD_NS)

    @property
    def counts(self) -> dict[str, int]:
        return {reason: n for reason, n in self.matching.counts().get("cam", {}).items() if n}


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_points_in_time_are_used_with_their_set(bench):
    bench.put(5, 6)
    assert [bench.track(i) for i in (4, 5, 6, 7)] == [None, 5, 6, None]
    assert bench.counts == {"in time": 2}


def test_late_points_are_used_with_the_next_set_once(bench):
    assert [bench.track(i) for i in range(4)] == [None] * 4
    bench.put(1)
    assert [bench.track(i) for i in (4, 5)] == [1, None]
    assert bench.counts == {"late": 1}


def test_the_newest_late_points_win(bench):
    for i in range(4):
        bench.track(i)
    bench.put(1, 2)
    assert bench.track(4) == 2
    assert bench.counts == {"late": 1, "overtaken": 1}


def test_points_of_an_image_that_was_lost_are_used(bench):
    for i in (0, 1, 3):
        bench.track(i)
    bench.put(2)
    assert bench.track(4) == 2


@pytest.mark.parametrize("of", [1.0e6, -100.0, 45.0])
def test_points_that_match_no_image_are_counted_and_named(bench, of):
    for i in (40, 41, 50):
        bench.track(i)
    bench.put(of)
    assert bench.track(51) is None
    assert bench.counts == {"unmatched": 1}
    assert "match no image" in bench.matching.problems()["cam"]
    bench.put(52)
    assert bench.track(52) == 52 and not bench.matching.problems()


def test_points_that_are_a_second_late_are_too_old(bench):
    for i in range(40):
        bench.track(i)
    bench.put(5)
    assert bench.track(40) is None
    assert bench.counts == {"too old": 1}


def test_an_image_has_points_once(bench):
    bench.put(5)
    assert bench.track(5) == 5
    bench.put(5)
    assert bench.track(6) is None
    assert bench.counts == {"in time": 1, "duplicate": 1}


def test_points_ahead_of_all_images_do_not_pile_up(bench):
    bench.put(*range(100, 120))
    assert bench.counts == {"waiting": 8, "unmatched": 12}


def test_after_a_jump_back_old_points_are_over(bench):
    for i in range(90, 95):
        bench.track(i)
    bench.put(94)
    bench.matching.restart()
    assert bench.track(1) is None
    bench.put(1)
    assert bench.track(2) == 1
    assert bench.counts == {"too old": 1, "late": 1}


def test_points_of_an_image_that_is_forgotten_are_too_old(bench):
    for i in range(100):
        bench.track(i)
    bench.put(5)
    assert bench.track(100) is None
    assert bench.counts == {"too old": 1}


def test_points_wait_as_long_as_the_images_that_they_are_of(bench):
    """A lossless tracker that is 20 s behind its cameras, and a detector that is not."""
    for i in range(600):
        bench.come(i)
        bench.put(i)
    assert [bench.track(i, waited=True) for i in range(600)] == list(range(600))
    assert bench.counts == {"in time": 600} and not bench.matching.problems()


def test_points_that_come_during_a_long_search_are_of_images_that_have_come(bench):
    bench.track(0)
    bench.come(*range(1, 90))
    bench.put(*range(1, 90, 6))
    assert bench.track(1, waited=True) == 1
    assert bench.counts == {"in time": 1, "waiting": 14} and not bench.matching.problems()
    bench.put(500)
    bench.track(2, waited=True)
    assert bench.matching.problems()["cam"].endswith("match no image, +13.700 s from its newest image")


def test_late_points_of_a_tracker_that_is_behind_are_used(bench):
    bench.come(*range(600))
    assert [bench.track(i, waited=True) for i in range(10)] == [None] * 10
    bench.put(9)
    assert bench.track(10, waited=True) == 9


def test_points_of_images_that_were_thrown_away_make_room_for_those_of_others(bench):
    bench.come(*range(0, 100, 2))
    bench.put(*range(100))
    assert bench.counts == {"waiting": 58, "unmatched": 42}
    assert [bench.track(i, waited=True) for i in range(0, 100, 2)] == list(range(0, 100, 2))


def test_points_do_not_pile_up_where_images_are_not_tracked(bench):
    for i in range(600):
        bench.come(i)
        bench.put(i)
        bench.matching.passed("cam", i * PERIOD_NS)
    assert bench.counts == {"waiting": 70, "too old": 530}


def test_points_of_images_that_wait_behind_a_jump_back_are_kept(bench):
    bench.come(*range(90, 100), *range(1, 5))
    bench.put(*range(90, 100), 1, 2)
    assert bench.track(90, waited=True) == 90
    bench.matching.restart()
    assert [bench.track(i, waited=True) for i in (1, 2, 3)] == [1, 2, None]
    assert bench.counts == {"in time": 3, "too old": 9}


def waited_s(bench, i: float, cameras=("cam",), given_up=lambda: False) -> float:
    """How long the points of the image set i are waited for."""
    stamp_ns, began_s = round(i * PERIOD_NS), time.monotonic()
    bench.matching.wait(ImageSet(stamp_ns, tuple(CameraImage(name, stamp_ns, PIXELS) for name in cameras)), given_up)
    return time.monotonic() - began_s


def test_points_are_waited_for_until_they_come(bench):
    coming = threading.Timer(0.3, bench.put, (5,))
    coming.start()
    assert 0.2 < waited_s(bench, 5) < 2.0
    assert bench.track(5) == 5


def test_an_image_that_the_detector_has_left_out_is_not_waited_for(bench):
    bench.put(6)
    assert waited_s(bench, 5) < 0.1
    assert [bench.track(i) for i in (5, 6)] == [None, 6]


def test_nothing_is_waited_for_where_nobody_wants_it(bench):
    assert waited_s(bench, 5, given_up=lambda: True) < 0.1


def test_a_camera_without_points_is_waited_for_once_whatever_the_others_have(bench, monkeypatch):
    monkeypatch.setattr(keypoint_inbox, "_PATIENCE_S", 0.3)
    bench.put(5)
    assert waited_s(bench, 5, cameras=("cam", "other")) >= 0.3
    bench.put(6)
    assert waited_s(bench, 6, cameras=("cam", "other")) < 0.1
    assert waited_s(bench, 7, cameras=("cam", "other")) >= 0.3  # the one that has sent some


def test_a_detector_that_sends_nothing_is_waited_for_once(bench, monkeypatch):
    monkeypatch.setattr(keypoint_inbox, "_PATIENCE_S", 0.3)
    assert waited_s(bench, 5) >= 0.3
    assert waited_s(bench, 6) < 0.1
    bench.put(6)  # it is there again
    assert waited_s(bench, 7) >= 0.3
